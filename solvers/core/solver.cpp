#include "solvers/core/solver.hpp"

namespace graybox {

std::string_view to_string(SolveStatus status) {
  switch (status) {
    case SolveStatus::kSolved:
      return "solved";
    case SolveStatus::kIterationLimit:
      return "iteration_limit";
    case SolveStatus::kTimeLimit:
      return "time_limit";
    case SolveStatus::kNumericalFailure:
      return "numerical_failure";
    case SolveStatus::kUnsupported:
      return "unsupported";
  }
  return "unknown";
}

}  // namespace graybox
