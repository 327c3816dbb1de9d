// The derivative of a signal that has nothing above half the sample rate, from even samples:
// differences of neighbours lose a third of it at a quarter of the sample rate already.
//
// With x less the line through its ends a sum of sines, sum_k b_k sin(pi k t / T), T from the first
// to the last sample,
//
//   dx/dt = slope of the line + sum_k b_k (pi k / T) cos(pi k t / T)
//
// (trigonometric collocation: Fornberg, A practical guide to pseudospectral methods, 1996, section
// 2). Exact between the ends for what has no second derivative there; else the error falls off with
// the square of the distance from them. Noise is differentiated up to half the sample rate:
// low-pass before.
#pragma once

#include <Eigen/Core>

namespace graybox {

// `values` at steps of `sample_time` (s), at least three. Cost O(n log n).
[[nodiscard]] Eigen::VectorXd band_limited_derivative(
    double sample_time, const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
