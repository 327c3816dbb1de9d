// Covariance of the parameters of a fit whose residuals have memory and change in size (White 1980;
// Andrews 1991 for blocks): with J the Jacobian and r the residuals,
//
//   C = H^+ (sum over blocks b of g_b g_b') H^+,   H = J'J,   g_b = J_b' r_b.
//
// No variance is below that of white residuals, s^2 (H^+)_ii with s^2 = |r|^2 / (counted - p).
// Residuals that are exactly zero do not count. A parameter that the data do not see has NaN.
// Cost: O(n p^2) for n residuals and p parameters.
#pragma once

#include <Eigen/Core>

#include "diagnosis/predictor/left_out_blocks.hpp"

namespace graybox {

[[nodiscard]] Eigen::MatrixXd robust_covariance(const Eigen::VectorXd& residuals,
                                                const Eigen::MatrixXd& jacobian,
                                                const BlockEdges& edges);

}  // namespace graybox
