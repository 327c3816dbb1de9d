// What further motions would tell of two explanations of a balance of forces (next_experiment.hpp).
//
// Options: each motion that was recorded for the fit, with its amplitude about the middle of its
// range and its speed changed, all joints together or one alone while the others stand in the
// middle of theirs. An amplitude a and a speed s make of q(t)
//
//   q = m + a (q - m),    q' = a s q',    q'' = a s^2 q'',
//
// and of the force what the first explanation says. Nothing is proposed that was not recorded
// already: options whose positions or speeds would exceed the largest recorded ones, or forces by
// more than a tenth, are left out. With y_A and y_B the forces of both explanations along such a
// motion, J the derivatives of y_A by all its parameters and n_j the recordings' effective samples
// at coordinate j,
//
//   M_i = sum over j of n_j / s_j^2  mean over t of [J  y_B - y_A]^T [J  y_B - y_A],
//
// so that every option takes as long as the recordings at hand.
//
// Cost: the columns of the model and of both explanations' laws along each option; those of the
// model are kept for later calls.
#pragma once

#include <mutex>
#include <optional>
#include <vector>

#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/hypotheses/next_experiment.hpp"

namespace graybox {

class RivalMotions {
 public:
  // `fitter` must outlive it. The options are made when they are first asked for.
  explicit RivalMotions(const BalanceFitter& fitter) : fitter_(fitter) {}

  // None where the recordings determine no parameter.
  [[nodiscard]] std::optional<RivalExperiments> between(const ExtendedFit& a,
                                                        const ExtendedFit& b) const;

 private:
  struct Option {
    ExperimentOption described;
    ForceBalanceRows rows;
  };
  void make_options() const;
  [[nodiscard]] bool is_within_recorded(const Motion& motion) const;
  // Derivatives of the force by all parameters, of each coordinate.
  [[nodiscard]] std::vector<Eigen::MatrixXd> columns_of(const ExtendedFit& fit,
                                                        const ForceBalanceRows& rows) const;
  // [J  y_B - y_A]^T [J  y_B - y_A], samples of a coordinate times its weight.
  [[nodiscard]] Eigen::MatrixXd information(const ExtendedFit& a, const ExtendedFit& b,
                                            const ForceBalanceRows& rows,
                                            const Eigen::VectorXd& weights) const;
  [[nodiscard]] bool exceeds_force(const ExtendedFit& fit, const Option& option) const;

  const BalanceFitter& fitter_;
  mutable std::once_flag is_made_;
  mutable std::vector<Option> options_;
};

}  // namespace graybox
