// The force that a model lacks, seen from its prediction errors: what must push on a coordinate for
// the filter's errors to come about.
//
// Let e_k be the filter's error at sample k and K its gain. x_k is how far its state is off before
// that sample corrects it. With A, B and C of stationary_gain.hpp and d the force,
//
//   x_(k+1) = A (x_k - K e_k) + B (d_k + w_k),    e_k = C x_k + v_k,
//   d_(k+1) = exp(-T/memory) d_k + white noise,   w white.
//
// Deviation and memory of d, and the deviation of w, are those of greatest likelihood, by a
// stationary Kalman filter. The force itself is smoothed over the whole recording (de Jong, Journal
// of the American Statistical Association 84, 1989). There w is left out, which would hide what
// changes fast. Laws that are not linear act in the filter, not in A. That is right while d is
// small beside them.
//
//   const LatentForce force = latent_force(data, role, model, intensity, coordinate, threads);
//
// Cost: one pass of the filter, and some 100 passes of a Kalman filter of 1 + states.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct LatentForce {
  bool usable = false;
  DisturbanceForce disturbance;  // of greatest likelihood
  double log_likelihood = 0.0;
  // Samples of all runs, one after the other: the force, its standard deviation, and the filter's
  // q and q' of all coordinates. At a run's first samples the filter has not settled.
  Eigen::VectorXd force;
  double band = 0.0;
  Eigen::MatrixXd motion;
  std::vector<std::uint8_t> settled;  // of each sample
  [[nodiscard]] double rms() const;   // of the settled ones
};

// In the recordings of this role. `coordinate` must move freely; `intensity` is of the force noise
// that the filter's gain is for.
[[nodiscard]] LatentForce latent_force(const PredictionData& data, ExperimentRole role,
                                       const ExtendedLumpedModel& model, double intensity,
                                       Eigen::Index coordinate, int threads);

// The latent force at the free coordinate where it is likeliest; none where no force is recorded or
// nothing moves freely.
[[nodiscard]] std::optional<LatentForce> likeliest_force(const PredictionData& data,
                                                         const ExtendedLumpedModel& model,
                                                         double intensity, int threads);

}  // namespace graybox
