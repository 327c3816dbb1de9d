// The frame that the exchange methods share: coordinates, start, pricing pass, stop tests and trace
// are the same, so that they differ in nothing but the moves of an iteration.
//
//   conditioned set -> start design -> repeat
//     price all candidates with M^-1            one pass; max w/d - 1 is the duality gap
//     stop?                                     gap, time, observer, iterations, no progress
//     advance()                                 the method's own moves
//     refresh M from the weights                reads the support
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "solvers/core/solver.hpp"
#include "solvers/exchange/exchange_design.hpp"

namespace graybox {

struct ExchangeIteration {
  const InformationSet& set;  // in the coordinates of the run
  ExchangeDesign& design;
  const Extremes& extremes;
  std::span<const double> sensitivities;        // of all candidates, before the iteration's moves
  std::span<const double> uniform_information;  // of the uniform design, packed
};

// The moves of one iteration. Returns false if not one of them could improve the design. An
// iteration of many moves leaves out the rest when it is asked to stop (stop.hpp).
using AdvanceFunction = std::function<bool(const ExchangeIteration&)>;

// Statuses as in solver.hpp; numerical_failure where no move gains in double precision. Throws
// InputError as ConditionedSet and Tracer do.
[[nodiscard]] Solution run_exchange_method(const InformationSet& set, const SolveOptions& options,
                                           SolveObserver* observer, std::int64_t default_limit,
                                           const AdvanceFunction& advance);

}  // namespace graybox
