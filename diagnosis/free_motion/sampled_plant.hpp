// A linear plant whose inputs are held between samples, x_{n+1} = A x_n + B u_n, y_n = C x_n, in
// Schur's form: an answer at a point of the unit circle costs O(n^2).
#pragma once

#include <Eigen/Core>
#include <complex>

#include "diagnosis/harmonic_balance/sampled_response.hpp"

namespace graybox {

// x = (q, q') of a plant, its input held between samples.
struct SampledPlant {
  Eigen::MatrixXcd vectors, triangle;  // A = V T V^H, Schur's form
  Eigen::MatrixXcd input;              // V^H B, 2n x n_u
  Eigen::MatrixXcd output;             // C V, n_y x 2n

  // C (z I - A)^-1 V, n_y x 2n. At a pole: entries that are not finite.
  [[nodiscard]] Eigen::MatrixXcd sight(std::complex<double> z) const;
  // G(z), n_y x n_u.
  [[nodiscard]] Eigen::MatrixXcd response(std::complex<double> z) const;
  // (z I - A)^-1 V g: the state of V g = B u + z d.
  [[nodiscard]] Eigen::VectorXcd state(std::complex<double> z, const Eigen::VectorXcd& g) const;
};
[[nodiscard]] SampledPlant sampled_plant(const LinearPlant& plant, double sample_time);

}  // namespace graybox
