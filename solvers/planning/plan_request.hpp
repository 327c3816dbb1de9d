// What a plan (experiment_plan.hpp, cost_plan.hpp) makes of a design request.
//
// Without costs the number of experiments is to be found, with costs the cheapest campaign. A
// budget limits it then, and at_most the number of its experiments.
#pragma once

#include <cstdint>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/design_request.hpp"
#include "solvers/planning/cost_plan.hpp"
#include "solvers/planning/experiment_plan.hpp"

namespace graybox {

// Throws InputError for what a plan can't take, saying what to do instead. `noise`: standard
// deviation over the one that the set assumes.
void require_plannable(const DesignRequest& request, double noise);

[[nodiscard]] bool has_costs(const DesignRequest& request);

// Keeps references. Throws InputError as resolve() when called.
[[nodiscard]] ConstraintsOf constraints_of_number(const DesignRequest& request,
                                                  const InformationSet& set);

struct BudgetProblem {
  std::vector<double> costs;
  double budget = 0.0;  // the request's, or what at_most of the dearest experiments cost
  ConstraintsOfBudget constraints_of;
};
[[nodiscard]] BudgetProblem budget_problem(const DesignRequest& request, const InformationSet& set,
                                           std::int64_t at_most);

}  // namespace graybox
