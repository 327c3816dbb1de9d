// dual_interior_point_sparse: the steps of dual_interior_point (dual_newton.hpp), with the Newton
// matrix formed and factorised by CHOLMOD's sparse kernels (sparse_range_system.hpp): the paper's
// sparse-against-dense comparison. Information matrices are dense as a rule, so sparse storage
// saves nothing here and its index arithmetic is paid in full.
//
// Same answers and statuses as dual_interior_point; linear in Q; one thread. Its own library,
// graybox::solvers_cholmod, because parts of CHOLMOD are under the GPL.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class DualInteriorPointSparse final : public Solver {
 public:
  static constexpr std::string_view kName = "dual_interior_point_sparse";
  static constexpr std::string_view kDescription =
      "dual_interior_point through CHOLMOD's sparse kernels: linear in Q";

  [[nodiscard]] std::string_view name() const override { return kName; }
  [[nodiscard]] std::string_view description() const override { return kDescription; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
