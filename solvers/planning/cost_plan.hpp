// The cheapest campaign: whole numbers m_i of experiments that reach every target
// c_j^T M(m)^-1 c_j <= s_j^2 (precision_target.hpp) at the least cost sum_i c_i m_i.
//
// The cost is proven from both sides:
//   - a design that reaches every target, and what it costs;
//   - a budget below it with which none does. Where the relaxed problem of a budget already misses
//     a target (minimax_precision.hpp), no whole numbers of that budget reach it. Above that budget
//     branch and bound shows the same (whole_design_search.hpp).
// A larger budget allows all that a smaller one does, so one budget excludes all below it.
//
// Costs are often multiples of a unit: minutes, euros. Then no design costs between C - unit and C,
// and a budget just below C - unit/2 that is excluded proves C to be the least. Otherwise, and
// where the unit is finer than the gap, C is proven to within the gap: no design costs less than
// C/(1 + gap).
//
//   const auto of = [&](double budget) { return cost_budget(costs, budget); };
//   const CheapestPlan plan = plan_cheapest(set, of, costs, targets, {.budget = 480.0});
//
// Cost: some ten relaxed problems, as many roundings, then a tree or a few.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "solvers/planning/experiment_plan.hpp"

namespace graybox {

struct CheapestPlanOptions {
  double budget = 0.0;                                          // no more may be spent
  double gap = 1e-3;                                            // of the cost, relative
  double time_limit = std::numeric_limits<double>::infinity();  // wall seconds
  std::uint64_t seed = 1;
  int threads = 1;
};

struct CheapestPlan {
  PlanStatus status = PlanStatus::kNotFound;
  double cost = 0.0;                    // of `counts`
  double least_cost = 0.0;              // no design that reaches the targets costs less: proven
  std::vector<std::int64_t> counts;     // Q numbers; empty where none were found
  std::vector<double> standard_errors;  // of each target, by `counts`
  double worst_ratio = 0.0;             // kOutOfReach: as of ExperimentPlan
  std::string message;

  [[nodiscard]] std::int64_t experiments() const;
};

// The constraints of a budget, which is row 0 (cost_budget()). What a budget allows, a larger one
// has to allow too.
using ConstraintsOfBudget = std::function<DesignConstraints(double)>;

// Throws InputError for targets that are none, a budget that is not positive, and as
// solve_constrained().
[[nodiscard]] CheapestPlan plan_cheapest(const InformationSet& set,
                                         const ConstraintsOfBudget& constraints_of,
                                         std::span<const double> costs,
                                         std::span<const PrecisionTarget> targets,
                                         const CheapestPlanOptions& options);

// The largest unit, of at most six decimals, that all numbers are multiples of; 0 where there is
// none.
[[nodiscard]] double common_unit(std::span<const double> numbers);

}  // namespace graybox
