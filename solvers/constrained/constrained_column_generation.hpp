// Column generation for designs under constraints (design_constraints.hpp): all criteria.
//
// The scheme is that of column_generation.hpp. The problem is solved on a working set of a few
// dozen candidates (constrained_working_set.hpp), whose multipliers y price the rows. A pass over
// the others asks for
//
//   r_i = tr(G H_i) - sum_j a_ji y_j > 0,
//
// and takes in those that gain most. Between passes over the whole set it goes on with a short
// list. The rows destroy the structure that lets the duals of the paper be solved directly (its
// footnote 8); priced by their multipliers they cost m multiplications a candidate, and nothing
// else changes.
//
// It ends on a pass over all candidates whose gap is at most the one asked for. The gap is the
// bound of multiplier_bound.hpp, the one that the checker takes.
//
// The start: a linear programme (linear_programme.hpp) finds candidates that can obey the
// constraints, or tells which rows contradict each other. A spread sample, uniformly run, prices
// the rest.
//
// Where rounding could hide a tenth of the gap asked for, the set is whitened first
// (conditioned_set.hpp).
//
// Cost: 2 Q (p + m) flops and one read of the set a pass, 3 to 8 passes. Results do not depend on
// the number of threads.
#pragma once

#include <string>
#include <vector>

#include "solvers/constrained/design_constraints.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

struct ConstrainedSolution {
  std::vector<double> efforts;      // x, Q numbers; empty where `status` is unsupported
  std::vector<double> multipliers;  // y of the rows, as the solver has them
  SolveStatus status = SolveStatus::kNumericalFailure;
  std::vector<TracePoint> trace;
  SolveCounters counters;
  std::string message;
  double sharpness = 1.0;   // of the barrier of E and G, whose G at M goes with y
  bool infeasible = false;  // no design obeys the constraints; status unsupported
};

// Throws InputError for constraints that do not fit the set and for those that no design obeys
// (naming the rows that contradict each other). Where the prior and all candidates together are
// singular the status is `unsupported`.
[[nodiscard]] ConstrainedSolution solve_constrained(const InformationSet& set,
                                                    const DesignConstraints& constraints,
                                                    const SolveOptions& options,
                                                    SolveObserver* observer = nullptr);

// The same for constraints that are known to fit the set (require_fits()), without exceptions:
// where no design obeys them the answer says so.
[[nodiscard]] ConstrainedSolution try_constrained(const InformationSet& set,
                                                  const DesignConstraints& constraints,
                                                  const SolveOptions& options,
                                                  SolveObserver* observer = nullptr);

}  // namespace graybox
