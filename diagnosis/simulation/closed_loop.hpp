// The experiment itself: a plant under its sampled PI controller follows a periodic reference
// (paper, Sections II and VI-B),
//
//   u(t) = F(q) (r(t) - y(t)),   F = K_p (1 + (T_s/T_i) / (1 - q^-1)),   y = plant output + v.
//
// At sample t the controller sees y(t) and sets u(t), which is held until t + 1: no computing
// delay, so that G of frequency_response.hpp (with its hold factor) and F describe the loop
// exactly.
//
// The noise v is the difference quotient of white noise n on the motor angles. With v(t) = (n(t) -
// n(t-1)) / T_s and variance C_v of n, Phi_v(w) = C_v |1 - exp(-j w T_s)|^2 / T_s^2. This is C_v
// w^2 but for less than 0.1 % below 17 Hz and 1.2 % at 60 Hz (T_s = 0.5 ms): the paper's Phi_v =
// C_v w^2, sampled. PSD in the DFT scaling of multisine.hpp. White noise may come on top.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "diagnosis/simulation/plant.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

struct ClosedLoopOptions {
  std::size_t settling_periods = 1;  // simulated before the recording
  std::size_t periods = 2;           // recorded
  double noise_psd_slope = 0.0;      // C_v; 0: no noise
  Eigen::VectorXd white_noise{};  // standard deviation of white noise on each output; empty: none
  std::uint64_t seed = 1;         // of the noise
};

// n x (periods * N) each.
struct Recording {
  Eigen::MatrixXd reference;  // r
  Eigen::MatrixXd input;      // u, for robots from the holding torque
  Eigen::MatrixXd output;     // y, with noise
};

// The `reference` is one period, n_u x N; without a controller it is the input itself. The callback
// `keep_going` is asked several times a second; where it says no, the recording is empty. The
// callback `progress` is told then how many samples have been simulated since the last time. The
// plant is restarted first. Throws UnstableMotion (plant.hpp).
[[nodiscard]] Recording simulate_closed_loop(
    Plant& plant, const std::optional<PiController>& controller, double sample_time,
    const Eigen::MatrixXd& reference, const ClosedLoopOptions& options,
    const std::function<bool()>& keep_going = {},
    const std::function<void(Eigen::Index)>& progress = {});

}  // namespace graybox
