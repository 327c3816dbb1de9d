#include "solvers/planning/plan_request.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {

bool has_costs(const DesignRequest& request) {
  return !request.costs.empty() || !request.numbers.costs.empty();
}

void require_plannable(const DesignRequest& request, double noise) {
  if (request.budget.has_value() && !has_costs(request)) {
    throw InputError("budget: say what each experiment costs (costs)");
  }
  if (request.experiments.has_value()) {
    throw InputError("experiments: their number is what a plan finds; limit it by at_most");
  }
  if (!request.block_sizes.empty()) {
    throw InputError(
        "block_sizes: they fix the number of experiments, which a plan finds; limit blocks by "
        "constraints");
  }
  if (!(noise > 0.0) || !std::isfinite(noise)) {
    throw InputError("noise: a positive factor of the noise that the set assumes");
  }
  if (noise != 1.0 && !(request.prior.empty() && request.numbers.prior.empty())) {
    throw InputError(
        "noise: scale the matrix of the prior yourself, the factor is the set's alone");
  }
}

ConstraintsOf constraints_of_number(const DesignRequest& request, const InformationSet& set) {
  return [&request, &set](std::int64_t experiments) {
    DesignRequest now = request;
    now.experiments = static_cast<double>(experiments);
    return resolve(now, set);
  };
}

BudgetProblem budget_problem(const DesignRequest& request, const InformationSet& set,
                             std::int64_t at_most) {
  DesignRequest now = request;
  now.budget = request.budget.value_or(1.0);
  DesignConstraints constraints = resolve(now, set);
  BudgetProblem problem{
      .costs = constraints.rows.front().coefficients, .budget = 0.0, .constraints_of = {}};
  const auto [least, most] = std::ranges::minmax(problem.costs);
  const auto number = static_cast<double>(at_most);
  problem.budget =
      std::min(request.budget.value_or(std::numeric_limits<double>::infinity()), number * most);
  if (problem.budget > number * least) {  // otherwise the budget allows fewer
    LinearConstraint row = number_of_experiments(set, number).rows.front();
    row.lower = -std::numeric_limits<double>::infinity();
    constraints.rows.push_back(std::move(row));
  }
  problem.constraints_of = [constraints = std::move(constraints)](double budget) {
    DesignConstraints with = constraints;
    with.rows.front().upper = budget;
    return with;
  };
  return problem;
}

}  // namespace graybox
