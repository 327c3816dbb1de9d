// The cheapest campaign: against the enumeration of all designs.
#include "solvers/planning/cost_plan.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/planning/plan_request.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_sets::matrix_of;
using testing_sets::wishart;

// The worst v_j, by another way than the code under test.
double worst_of(const InformationSet& set, std::span<const std::int64_t> counts,
                std::span<const PrecisionTarget> targets) {
  const auto d = static_cast<Index>(set.dimension());
  MatrixXd sum = MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    sum += static_cast<double>(counts[i]) * matrix_of(set, i);
  }
  const Eigen::FullPivLU<MatrixXd> lu(sum);
  if (!lu.isInvertible()) return std::numeric_limits<double>::infinity();
  double worst = 0.0;
  for (const PrecisionTarget& target : targets) {
    const Eigen::Map<const VectorXd> c(target.combination.data(), d);
    worst = std::max(worst, c.dot(lu.solve(c)) / std::pow(target.standard_error, 2));
  }
  return worst;
}

// The least cost of all designs of no more than `most` that reach the targets.
double least_cost(const InformationSet& set, std::span<const double> costs,
                  std::span<const PrecisionTarget> targets, double most) {
  double best = std::numeric_limits<double>::infinity();
  std::vector<std::int64_t> counts(set.candidate_count(), 0);
  const auto visit = [&](const auto& self, std::size_t i, double cost) -> void {
    if (i == counts.size()) {
      if (cost < best && worst_of(set, counts, targets) <= 1.0) best = cost;
      return;
    }
    for (counts[i] = 0; cost <= std::min(most, best); ++counts[i], cost += costs[i]) {
      self(self, i + 1, cost);
    }
    counts[i] = 0;
  };
  visit(visit, 0, 0.0);
  return best;
}

std::vector<PrecisionTarget> some_targets(const InformationSet& set, std::size_t count,
                                          Random& random) {
  std::vector<PrecisionTarget> targets;
  const std::vector<std::int64_t> even(set.candidate_count(), 1);
  for (std::size_t j = 0; j < count; ++j) {
    PrecisionTarget target{"t", std::vector<double>(set.dimension()), 1.0, 0.0};
    for (double& x : target.combination) x = random.normal();
    const double v = worst_of(set, even, std::vector<PrecisionTarget>{target});
    target.standard_error = std::sqrt(v) * (0.8 + 0.4 * random.uniform());
    targets.push_back(std::move(target));
  }
  return targets;
}

TEST(CostPlan, IsTheCheapestOfAllDesigns) {
  int proven = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Random random(seed);
    const auto d = static_cast<Index>(1 + seed % 3);
    const InformationSet set = wishart(d, 5, d > 1 ? 1 : d, 500 + seed);
    const std::vector<PrecisionTarget> targets = some_targets(set, 1 + seed % 3, random);
    std::vector<double> costs(5);
    for (double& cost : costs) {
      cost =
          seed % 2 == 0 ? 0.5 * static_cast<double>(1 + random.below(6)) : 0.3 + random.uniform();
    }
    const auto of = [&](double budget) { return cost_budget(costs, budget); };
    const CheapestPlan plan =
        plan_cheapest(set, of, costs, targets, {.budget = 200.0, .time_limit = 60.0});
    ASSERT_FALSE(plan.counts.empty()) << seed << ": " << plan.message;
    EXPECT_LE(worst_of(set, plan.counts, targets), 1.0 + 1e-9) << seed;
    const double cost = std::inner_product(costs.begin(), costs.end(), plan.counts.begin(), 0.0);
    EXPECT_NEAR(plan.cost, cost, 1e-12 * cost) << seed;
    const double least = least_cost(set, costs, targets, plan.cost + 1e-9);
    EXPECT_LE(plan.least_cost, least * (1.0 + 1e-12)) << seed;
    EXPECT_GE(plan.cost, least * (1.0 - 1e-12)) << seed;
    if (plan.status != PlanStatus::kProven) continue;
    ++proven;
    const double allowed = seed % 2 == 0 ? 1e-12 : 1.1e-3;  // multiples of 0.5, or any numbers
    EXPECT_LE(plan.cost, least * (1.0 + allowed)) << seed;
  }
  EXPECT_EQ(proven, 40);
}

// With the same cost for all, the cheapest campaign is the smallest; other units are of no matter.
TEST(CostPlan, EqualCostsCountExperiments) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Random random(seed);
    const InformationSet set = wishart(2, 8, 2, 900 + seed);
    const std::vector<PrecisionTarget> targets = some_targets(set, 1, random);
    const auto count = [&](std::int64_t n) {
      return number_of_experiments(set, static_cast<double>(n));
    };
    const ExperimentPlan smallest = plan_experiments(set, count, targets, {.at_most = 60});
    ASSERT_EQ(smallest.status, PlanStatus::kProven) << seed;
    for (const double price : {1.0, 7.5}) {
      const std::vector<double> costs(8, price);
      const auto of = [&](double budget) { return cost_budget(costs, budget); };
      const CheapestPlan plan = plan_cheapest(set, of, costs, targets, {.budget = 60.0 * price});
      EXPECT_EQ(plan.status, PlanStatus::kProven) << seed;
      EXPECT_EQ(plan.experiments(), smallest.experiments) << seed;
      EXPECT_NEAR(plan.cost, price * static_cast<double>(smallest.experiments), 1e-9) << seed;
      EXPECT_EQ(plan.least_cost, plan.cost) << seed;
    }
  }
}

TEST(CostPlan, SaysWhatABudgetCantReachAndWhatIsKnownAlready) {
  Random random(3);
  const InformationSet set = wishart(3, 10, 2, 77);
  const std::vector<PrecisionTarget> targets = some_targets(set, 2, random);
  const std::vector<double> costs(10, 1.0);
  const auto of = [&](double budget) { return cost_budget(costs, budget); };
  EXPECT_EQ(plan_cheapest(set, of, costs, targets, {.budget = 0.5}).status,
            PlanStatus::kOutOfReach);
  const auto known = [&](double budget) {
    DesignConstraints constraints = cost_budget(costs, budget);
    constraints.prior.assign(set.packed_size(), 0.0);
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      for (std::size_t k = 0; k < constraints.prior.size(); ++k) {
        constraints.prior[k] += 100.0 * set.information(i)[k];
      }
    }
    return constraints;
  };
  const CheapestPlan nothing = plan_cheapest(set, known, costs, targets, {.budget = 10.0});
  EXPECT_EQ(nothing.status, PlanStatus::kProven);
  EXPECT_EQ(nothing.experiments(), 0);
  EXPECT_EQ(nothing.cost, 0.0);
  EXPECT_THROW((void)plan_cheapest(set, of, costs, targets, {.budget = 0.0}), InputError);
}

TEST(CostPlan, UnitsAreFound) {
  EXPECT_DOUBLE_EQ(common_unit(std::vector<double>{3.0, 6.0, 12.0}), 3.0);
  EXPECT_DOUBLE_EQ(common_unit(std::vector<double>{0.3, 0.45}), 0.15);
  EXPECT_EQ(common_unit(std::vector<double>{1.0, std::sqrt(2.0)}), 0.0);
}

}  // namespace
}  // namespace graybox
