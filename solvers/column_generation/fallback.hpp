// What happens where a method gives up: another one finishes. The one place that knows which.
//
// column_generation leaves a problem to it where its own steps end short of the gap asked for
// although rounding would allow it (status numerical_failure in whitened coordinates). The
// work then goes on from scratch, in the same coordinates, with the methods of another kind in
// this order, until one reaches the gap:
//
//   dual_interior_point   Newton's method on all candidates: needs no good working set
//   vertex_exchange       pairwise exchanges: slow, but each of them gains
//
// Each claim is verified by a pricing pass with its own rounding bound (sensitivity_error.hpp). The
// clock, the passes, the observer and the trace are those of the run that stopped, and go on: time
// never falls in a trace, and the time limit is one for all. The message says who finished.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "problems/information/information_set.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {

// How one method's run on a problem ended, before it becomes a Solution.
struct MethodOutcome {
  Design design;
  SolveStatus status = SolveStatus::kNumericalFailure;
  double gap = 0.0;        // of the design, as computed; infinite where there is none
  double gap_error = 0.0;  // how far rounding may have moved the gap
  std::int64_t iterations = 0;
  std::string message;
};

// `set` in good coordinates; `stopped`, of method `name`, ended with numerical_failure or
// unsupported.
[[nodiscard]] MethodOutcome finish_with_another(const InformationSet& set,
                                                const SolveOptions& options, std::string_view name,
                                                MethodOutcome stopped, Tracer& tracer);

}  // namespace graybox
