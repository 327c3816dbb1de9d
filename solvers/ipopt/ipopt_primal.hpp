// ipopt_primal: the problem as formula (9) of the paper states it, handed to Ipopt as it stands:
//
//   minimise  -log det(sum_i x_i B_i / Q)   subject to  sum_i x_i = Q,  x >= 0,      x = Q lambda,
//
// where B_i = L^-1 H_i L^-T is whitened by the mean information matrix L L^T. First and second
// derivatives are exact,
//
//   df/dx_i = -tr(M^-1 B_i) / Q,      d2f/dx_i dx_j = tr(M^-1 B_i M^-1 B_j) / Q^2,
//
// and the Hessian is full: Q (Q + 1) / 2 numbers, held several times over by Ipopt and factored by
// MUMPS as a dense matrix. Time grows as Q^3 and memory as about 30 Q^2 bytes (1.9 GB at
// Q = 7920): a general solver told the problem badly. Sets beyond 30 000 candidates are
// `unsupported`.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class IpoptPrimal final : public Solver {
 public:
  static constexpr std::string_view kName = "ipopt_primal";
  static constexpr std::string_view kDescription =
      "Ipopt on the weights, formula (9), with its dense Q x Q Hessian";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] SolverTraits traits() const override;
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;
};

}  // namespace graybox
