// How well a balance of forces determines what it estimates.
//
// Estimates x solve normal equations, so each is a sum over time of what residuals and prior add to
// its error (its influences). Residuals follow one another in time: the variance of that sum is a
// long-run variance (long_run_variance.hpp). Standard errors are at least as wide as the spread
// between recordings (recording_spread.hpp).
//
// Cost: O(n (N p + N p^2)) for n coordinates of N samples and p parameters.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"

namespace graybox {

// Covariance of sums over time of such scores (samples x sums), which follow one another. `fitted`:
// so many parameters were, by which the residuals in them are too small.
[[nodiscard]] Eigen::MatrixXd covariance_of_sums(const ForceBalanceRows& rows,
                                                 const Eigen::MatrixXd& scores,
                                                 Eigen::Index fitted);

// A parameter of a law, as one column of the information about all.
struct LawColumn {
  std::size_t law = 0, parameter = 0;
};

// Columns of all parameters that a fit has estimated over `noise`, coordinate after coordinate: the
// model's, the laws' (`of_laws` says which they are), and gains that only a payload tells.
[[nodiscard]] Eigen::MatrixXd information_columns(const ForceBalanceData& data,
                                                  std::span<const PlacedLaw> laws,
                                                  const Eigen::VectorXd& noise,
                                                  std::vector<LawColumn>& of_laws);

// The prior precision of so many parameters: those of laws have none.
[[nodiscard]] Eigen::VectorXd prior_precision(const ForceBalanceRows& rows,
                                              Eigen::Index parameters);
// Adds the rows of the prior below those of the data.
void append_prior_rows(const ForceBalanceRows& rows, Eigen::MatrixXd& columns);

// Standard deviations; NaN where the data do not see a parameter.
struct BalanceDeviations {
  Eigen::VectorXd model;              // of the model's parameters
  std::vector<LawColumn> parameters;  // of laws, and gains at the end
  std::vector<double> of_parameters;
};
[[nodiscard]] BalanceDeviations balance_deviations(const ForceBalanceData& data,
                                                   std::span<const PlacedLaw> laws,
                                                   const BalanceFit& fitted);

// Wald statistic of each law's amplitudes, shapes held. `laws`: the columns of each.
[[nodiscard]] std::vector<double> wald_statistics(const ForceBalanceData& data,
                                                  std::span<const BalanceColumns> laws,
                                                  const BalanceFit& fitted);

}  // namespace graybox
