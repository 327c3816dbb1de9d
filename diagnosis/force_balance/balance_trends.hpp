// Whether a law found in a balance of forces changes with the time, or with the position.
//
// Let d be the law's column over the noise times the covariate about its mean, less what all
// columns of the fit imitate, and r the residuals over the noise. The parameter then changes by
//
//   a = d'r / d'd   a unit of the covariate,     z = a d'd / sqrt(V),
//
// V the long-run variance (long_run_variance.hpp) of sum over coordinates d_t (r_t - a d_t): what
// is left has memory, and a trend must not pass for noise. Only parameters are asked in which the
// force is linear. Cost: a QR of all columns, and O(n N) for each covariate and parameter.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"

namespace graybox {

// The most significant trend of each law, in their order; one of z = 0 where the recordings do not
// tell. `residuals`: of the fit with these laws, samples x coordinates.
[[nodiscard]] std::vector<LawTrend> balance_trends(const ForceBalanceData& data,
                                                   std::span<const PlacedLaw> laws,
                                                   const Eigen::MatrixXd& residuals);

}  // namespace graybox
