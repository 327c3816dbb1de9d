// Covariances pooled over neighbouring lines where one line has too few degrees of freedom.
//
// Line k takes the lines k - b ... k + b (fewer beyond an end) with the smallest b that gives the
// degrees of freedom asked for. The noise of a velocity rises with w^2, so the scatter matrices of
// neighbours are first brought to the level of line k. This is done by a power of frequency, common
// to all outputs, that least squares fits to the mean logarithm of their diagonals.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/responses/frequency_response_estimate.hpp"

namespace graybox {

struct LineScatter {
  Eigen::MatrixXcd scatter;         // sum of v v^H, n_y x n_y: q Phi
  double degrees_of_freedom = 0.0;  // q
  std::vector<std::size_t> bins;    // it was taken from; neighbours may share some. Empty: its own
};

// Degrees of freedom of all lines together. Shared bins count once.
[[nodiscard]] double independent_samples(const std::vector<LineScatter>& lines);

// One covariance for each line. Shared bins count once for the degrees of freedom.
[[nodiscard]] std::vector<OutputCovariance> pool_covariances(const std::vector<LineScatter>& lines,
                                                             const std::vector<double>& frequencies,
                                                             double degrees_of_freedom);

}  // namespace graybox
