// One recording of a case in any motion: the machine under its sampled controller.
//
// At sample k the controller reads the sensors at t_k and sets the torque u_k, held until t_(k+1).
// Between samples the equations of any_motion_system.hpp, with the hidden elements, go by
// StiffIntegrator. A late actuator's torque changes within the sample, and the integrator stops
// there; a late sensor reads the motion of then by the cubic through both ends of the step and its
// slopes. Each sample's force noise is held, as the torque is:
//
//   w_(k+1) = a w_k + sigma sqrt(1 - a^2) n,   a = exp(-T_s / memory),   w_0 drawn alike.
//
// Cost: about 50 ms for 4000 samples of a drive; friction that sticks takes twice that.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "bench/any_motion_challenge/any_motion_system.hpp"
#include "problems/elements/element.hpp"

namespace graybox::bench {

struct DriveNoise {
  double force = 0.0;  // standard deviation of w, N m
  std::uint64_t seed = 1;
};

struct DriveRecording {
  Eigen::VectorXd time;    // s, when the samples were taken
  Eigen::VectorXd input;   // the torque as commanded and recorded, N m
  Eigen::MatrixXd output;  // as the sensors read, samples x outputs
  // What really was, at the samples; samples x masses.
  Eigen::MatrixXd position, velocity;
};

// Recording `index` of the plan. Its reference depends on `seed` alone. Without `noise` there is
// neither force noise nor jitter, and sensors are exact. Empty where `keep_going` says no. Throws
// UnstableMotion where the motion leaves a hundred times its amplitude (a position under speed
// control may), and std::logic_error for elements that it can't place.
[[nodiscard]] DriveRecording simulate_drive(const AnyMotionSystem& system,
                                            const std::vector<Element>& elements, std::size_t index,
                                            std::uint64_t seed, const DriveNoise* noise,
                                            const std::function<bool()>& keep_going = {});

// Root mean square about zero.
[[nodiscard]] double root_mean_square(const Eigen::VectorXd& values);

}  // namespace graybox::bench
