// Does what a fit leaves still depend on the motion? The measure is the share of its variance that
// is predicted, in cross-validation over contiguous fifths, by a regression on steps. For each
// joint these are 16 bins of its position, 16 of its velocity (edges at quantiles of the recorded
// motion) and the sign of its velocity. It has a ridge. Few samples do not tell so many steps:
// where a constant, the velocity and its sign alone leave clearly less, these are taken. About 0
// (or less: then 0) for noise and for physics that is no function of one joint's motion; near 1
// where a law is missing.
#pragma once

#include <Eigen/Core>

#include "diagnosis/force_balance_data/force_balance_data.hpp"

namespace graybox {

// `residuals`: samples x coordinates.
[[nodiscard]] double remaining_structure(const ForceBalanceRows& rows,
                                         const Eigen::MatrixXd& residuals);
// What that regression does not predict, sample by sample.
[[nodiscard]] Eigen::MatrixXd unpredicted(const ForceBalanceRows& rows,
                                          const Eigen::MatrixXd& residuals);

}  // namespace graybox
