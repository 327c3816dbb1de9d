// Exact designs under constraints against brute force.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/constrained_exact/constrained_exact.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using testing_sets::wishart;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// All designs that obey the constraints, best first.
std::vector<RankedDesign> brute_force(const InformationSet& set,
                                      const DesignConstraints& constraints,
                                      const Criterion& criterion) {
  std::vector<RankedDesign> all;
  DesignValue value(set, constraints, criterion);
  std::vector<std::int64_t> counts(set.candidate_count(), 0);
  const auto visit = [&](const auto& self, std::size_t i) -> void {
    if (i == counts.size()) {
      if (!obeys(constraints, counts)) return;
      const double reached = value(std::span<const std::int64_t>(counts));
      if (std::isfinite(reached)) all.push_back({counts, reached});
      return;
    }
    const auto most = static_cast<std::int64_t>(constraints.largest_effort(i) + 1e-9);
    for (counts[i] = 0; counts[i] <= most; ++counts[i]) self(self, i + 1);
    counts[i] = 0;
  };
  visit(visit, 0);
  std::ranges::stable_sort(all, std::ranges::greater(), &RankedDesign::value);
  return all;
}

struct ExactInstance {
  InformationSet set;
  DesignConstraints constraints;
  Criterion criterion;
};

ExactInstance exact_instance(std::uint64_t seed) {
  Random random(seed);
  const auto d = static_cast<Eigen::Index>(1 + random.below(3));
  const std::size_t count = 4 + random.below(3);
  ExactInstance out{wishart(d, count, d, seed * 3 + 1), {}, {}};
  const double runs = 3.0 + static_cast<double>(random.below(2));
  if (random.below(3) == 0) {
    std::vector<double> costs(count);
    for (double& c : costs) c = 0.7 + random.uniform();
    out.constraints = cost_budget(std::move(costs), runs);
  } else {
    out.constraints = number_of_experiments(out.set, runs);
  }
  if (random.below(2) == 0) out.constraints.upper.assign(count, 1.0 + double(random.below(2)));
  if (random.below(3) == 0) {
    out.constraints.lower.assign(count, 0.0);
    out.constraints.lower[random.below(count)] = 1.0;
  }
  if (random.below(3) == 0) {
    const InformationSet prior = wishart(d, 1, d, seed + 5);
    out.constraints.prior.assign(prior.information(0).begin(), prior.information(0).end());
  }
  if (random.below(2) == 0) {
    std::vector<double> a(count);
    for (double& entry : a) entry = random.below(2) == 0 ? 1.0 : 0.0;
    out.constraints.rows.push_back({"group", std::move(a), -kInfinity, 2.0});
  }
  switch (random.below(3)) {
    case 0:
      out.criterion = Criterion::a();
      break;
    case 1:
      out.criterion = Criterion::ds({0});
      break;
    default:
      break;
  }
  return out;
}

// Constraints that not even shares of experiments can obey are refused: no designs.
ConstrainedExactSolution solved_or_refused(const ExactInstance& instance,
                                           const ConstrainedExactOptions& options) {
  try {
    return solve_constrained_exact(instance.set, instance.constraints, options);
  } catch (const InputError&) {
    return {};
  }
}

// Fewer experiments than parameters, of rank one: every design is singular, which is no optimum.
TEST(ConstrainedExact, SingularDesignsAreNoAnswer) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(seed);
    const InformationSet set = wishart(4, 7, 1, seed);
    DesignConstraints constraints = number_of_experiments(set, 2.0);
    constraints.upper.assign(7, 5.0);
    for (const Criterion& criterion : {Criterion(), Criterion::a(), Criterion::ds({0})}) {
      const ConstrainedExactSolution answer =
          solve_constrained_exact(set, constraints, {.criterion = criterion});
      EXPECT_TRUE(answer.designs.empty());
      EXPECT_EQ(answer.status, ExactStatus::kSingular);
    }
  }
}

TEST(ConstrainedExact, BruteForceFindsNothingBetter) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE(seed);
    const ExactInstance instance = exact_instance(seed);
    const std::vector<RankedDesign> all =
        brute_force(instance.set, instance.constraints, instance.criterion);
    const ConstrainedExactSolution answer =
        solved_or_refused(instance, {.criterion = instance.criterion});
    if (all.empty()) {
      EXPECT_TRUE(answer.designs.empty());
      continue;
    }
    ++found;
    ASSERT_EQ(answer.status, ExactStatus::kOptimal) << answer.message;
    EXPECT_NEAR(answer.designs.front().value, all.front().value, 1.1e-6);
    EXPECT_GE(answer.value_bound + 1e-12, all.front().value);
    EXPECT_TRUE(obeys(instance.constraints, answer.designs.front().counts));
  }
  EXPECT_GE(found, 200);
}

TEST(ConstrainedExact, TheBestFewAreTheBestFew) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    const ExactInstance instance = exact_instance(seed);
    const std::vector<RankedDesign> all =
        brute_force(instance.set, instance.constraints, instance.criterion);
    const ConstrainedExactSolution answer =
        solved_or_refused(instance, {.criterion = instance.criterion, .top = 5});
    ASSERT_EQ(answer.designs.size(), std::min<std::size_t>(5, all.size()));
    for (std::size_t k = 0; k < answer.designs.size(); ++k) {
      EXPECT_NEAR(answer.designs[k].value, all[k].value, 1.1e-6);
      for (std::size_t l = 0; l < k; ++l) {
        EXPECT_NE(answer.designs[k].counts, answer.designs[l].counts);
      }
    }
  }
}

TEST(ConstrainedExact, ThreadsDoNotChangeTheAnswer) {
  const InformationSet set = wishart(4, 60, 2, 3);
  DesignConstraints constraints = number_of_experiments(set, 9.0);
  constraints.upper.assign(60, 1.0);
  const ConstrainedExactSolution one = solve_constrained_exact(set, constraints, {.threads = 1});
  const ConstrainedExactSolution two = solve_constrained_exact(set, constraints, {.threads = 2});
  ASSERT_EQ(one.status, ExactStatus::kOptimal);
  EXPECT_EQ(one.designs.front().counts, two.designs.front().counts);
  EXPECT_EQ(one.nodes, two.nodes);
}

}  // namespace
}  // namespace graybox
