// ipopt_lifted: formula (9) of the paper with the p entries of the information matrix as variables
// of their own,
//
//   minimise  -log det M   subject to  M = sum_i x_i B_i / Q,   sum_i x_i = Q,   x >= 0,
//
// x = Q lambda and B_i whitened as in ipopt_primal.hpp. The Hessian is now p x p in the entries of
// M, whatever Q is, and the weights enter linearly. The KKT matrix
//
//        x    M    y
//      | D         A^T |     D: diagonal (barrier), Q x Q
//      |      H   -I   |     H: p x p
//      | A   -I        |     A: the columns B_i / Q, and a row of ones
//
// is factored by eliminating x first, which leaves a dense block of order 2 p + 1: time per
// iteration O(Q p^2), memory O(Q p). The same problem as ipopt_primal, told well.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class IpoptLifted final : public Solver {
 public:
  static constexpr std::string_view kName = "ipopt_lifted";
  static constexpr std::string_view kDescription =
      "Ipopt with the information matrix as variables: a sparse form, linear in Q";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override;
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

}  // namespace graybox
