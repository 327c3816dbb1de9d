// What a fitted model leaves, as a force: how large it is, what of it depends on the motion, and
// whether it and the sensors' noise account for the errors at every horizon.
//
// A real machine is disturbed, and no prediction is at the noise of its encoders. So the rest is
// taken for a disturbance where nothing speaks against it: one force of one size and memory
// (latent_force.hpp) foretells the errors of all horizons, and no curve of the motion foretells the
// force (latent_structure.hpp). It is asked for at each free coordinate; the likeliest is taken.
//
//   const UnmodelledForce rest(data, findings, fit.model, threads);
//   rest.force()      // null: nothing moves freely, or no force is recorded
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "diagnosis/prediction_error/latent_structure.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"

namespace graybox {

struct HorizonError {
  Eigen::Index horizon = 0;  // samples; 0: free run
  Eigen::VectorXd error;     // rms by output, recordings of the fit
  Eigen::VectorXd by_noise;  // what the sensors' noise alone would leave
  Eigen::VectorXd by_rest;   // what that and the remaining force would
};

// Errors up to so many times what is to be expected are that.
inline constexpr double kNoiseMultiple = 2.0;

class UnmodelledForce {
 public:
  UnmodelledForce(const PredictionData& data, const PredictionFindings& findings,
                  const ExtendedLumpedModel& model, int threads);

  [[nodiscard]] const LatentForce* force() const { return force_ ? &*force_ : nullptr; }
  [[nodiscard]] const std::vector<LatentStructure>& structures() const { return structures_; }
  // What depends on the motion most; null: nothing that is told from chance.
  [[nodiscard]] const LatentStructure* structure() const;
  // rms, of that of the forces that act: of the whole, and of what depends on the motion.
  [[nodiscard]] double share() const { return share_; }
  [[nodiscard]] double structured_share() const;
  [[nodiscard]] const std::vector<HorizonError>& horizons() const { return horizons_; }
  // The most, of horizons and outputs, that an error is over what is to be expected.
  [[nodiscard]] double multiple_of_noise() const;
  [[nodiscard]] double multiple_of_rest() const;
  // The longest horizon at which the remaining force costs at most `share` of each output's signal;
  // none: not even the shortest.
  [[nodiscard]] std::optional<Eigen::Index> foreseeable(double share) const;
  // The largest error over the whole of the shortest recording, of an output's signal, that is more
  // than noise and force leave there; 0: none is.
  [[nodiscard]] double unexpected_in_the_end() const;
  // Whether it costs no more over the whole of the shortest recording.
  [[nodiscard]] bool is_foreseeable_to_the_end(double share) const;

 private:
  [[nodiscard]] bool costs_at_most(double share, const HorizonError& at) const;

  std::optional<LatentForce> force_;
  std::vector<LatentStructure> structures_;
  std::vector<HorizonError> horizons_;  // of the search: short ones first
  HorizonError whole_;                  // of the shortest recording
  Eigen::VectorXd output_scale_;
  double share_ = 0.0;
};

}  // namespace graybox
