// Detectability of a hidden effect in any motion, from noise-free data and never from a diagnosis.
//
// The true machine without the effect is linear, and its noise is known: force noise with memory,
// and white sensor noise. Rounding counts as white, of quantum / sqrt(12). So does what jitter
// makes of the motion, also where stamps could tell it: its covariance is s^2 mean(y' y'^T), s its
// deviation in seconds and y' the outputs' rates. With these, the innovations of the machine's
// stationary Kalman filter are white, of covariance S:
//
//   x' = A x + B u + K e,   e = y - C x,   x = (q, q', w),  sampled exactly for held u.
//
// Each estimation recording is simulated with the effect, without noise and jitter: u and y, in
// closed loop. The filter runs over them and leaves S^(-1/2) e, stacked to r: what the effect adds
// to the innovations of a noisy recording. A refit of the model's parameters theta takes away the
// part in the span of J = dr/dtheta, by central differences of the filter's machine with its gain
// kept:
//
//   lambda = min_x |r - J x|^2
//
// is the non-centrality of the lack-of-fit statistic of the innovations after the refit, to first
// order in the refit: the definition of bench/challenge/detectability.hpp, with innovations for
// lines. An effect is detectable if the chi-square test of lack of fit at level 5 %, on all samples
// of all outputs less the parameters, has 90 % power. One sample ahead no errors pile up, so masses
// without a spring make no trouble.
//
// Cost: a simulation and 1 + 2 p passes of the filter a recording, about 0.3 s.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "bench/any_motion_challenge/any_motion_system.hpp"
#include "bench/any_motion_challenge/drive_simulation.hpp"

namespace graybox::bench {

// Sampled exactly, with the force noise as last state.
struct SampledDrive {
  Eigen::MatrixXd transition;  // N x N
  Eigen::VectorXd input;       // of the held torque
  Eigen::MatrixXd output;      // outputs x N
};
[[nodiscard]] SampledDrive sampled_drive(const AnyMotionSystem& system,
                                         const Eigen::VectorXd& values);

struct StationaryFilter {
  Eigen::MatrixXd gain;      // K, N x outputs
  Eigen::MatrixXd whitener;  // S^(-1/2)
};
// For a force noise of this standard deviation, N m, and this covariance of the sensors' noise.
[[nodiscard]] StationaryFilter stationary_filter(const SampledDrive& drive, double force_noise,
                                                 const Eigen::MatrixXd& sensor_noise);
// Of the noise that comes with a recording that moves as this one, simulated without any.
[[nodiscard]] StationaryFilter filter_for(const AnyMotionSystem& system, const SampledDrive& drive,
                                          const DriveRecording& quiet);

// Whitened, all outputs of a sample in turn. The machine stands at first.
[[nodiscard]] Eigen::VectorXd innovations(const SampledDrive& drive, const StationaryFilter& filter,
                                          const DriveRecording& recording);

class InnovationDetectability {
 public:
  // Simulates the case without effect. Keeps a reference to the system.
  InnovationDetectability(const AnyMotionSystem& system, std::uint64_t seed);

  [[nodiscard]] double degrees_of_freedom() const;
  // Simulates with these elements. Throws UnstableMotion.
  [[nodiscard]] double noncentrality(const std::vector<Element>& elements) const;
  // How a place moves without the effect, rms over the estimation recordings.
  [[nodiscard]] PlaceScale scale_at(const ChallengePlace& place) const;

 private:
  struct Record {
    std::size_t index = 0;  // of the plan
    DriveRecording without;
    StationaryFilter filter;
  };

  const AnyMotionSystem* system_;
  std::uint64_t seed_;
  SampledDrive nominal_;
  std::vector<std::pair<SampledDrive, SampledDrive>> beside_;  // below and above, each parameter
  std::vector<Record> records_;
};

}  // namespace graybox::bench
