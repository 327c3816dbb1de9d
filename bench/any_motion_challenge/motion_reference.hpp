// References of machines at work, sampled; none of them repeats.
//
//   steps            held for 0.4 to 1 s each
//   work_cycle       moves of trapezoidal rate between places, with standstill of 0.2 to 0.6 s
//   smooth           eight sines from 0.15 to 4 Hz, each the smaller the faster
//   random_targets   new targets every 0.3 to 0.8 s, reached by two lags of 0.08 s in a row
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "problems/base/random.hpp"

namespace graybox::bench {

enum class MotionKind : std::int8_t { kSteps, kWorkCycle, kSmooth, kRandomTargets };
inline constexpr int kMotionKinds = 4;

// Values at samples 0, 1, ... that start at 0 and stay about within +-1.
[[nodiscard]] Eigen::VectorXd motion_reference(MotionKind kind, Eigen::Index samples,
                                               double sample_time, Random& random);

}  // namespace graybox::bench
