// Back-ends that begin from a design that is given, and those that do not.
#include "solvers/core/warm_start.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/certificates/certificate.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/registered_solvers.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using namespace testing_solvers;

std::vector<InformationSet> start_sets() {
  std::vector<InformationSet> sets;
  sets.push_back(wishart(3, 20, 3, 1));
  sets.push_back(wishart(4, 40, 1, 2));
  sets.push_back(wishart(5, 60, 2, 3));
  return sets;
}

std::vector<double> optimum(const InformationSet& set, const Criterion& criterion = {}) {
  return registry()
      .at("column_generation")
      .solve(set, {.duality_gap = 1e-10, .criterion = criterion})
      .design.weights;
}

// Equal weights on the candidates that the optimum leaves out: regular here, and nowhere right.
std::vector<double> wrong_support(const InformationSet& set) {
  std::vector<double> weights = optimum(set);
  for (double& weight : weights) weight = weight > 0.0 ? 0.0 : 1.0;
  return weights;
}

void expect_same_value(const InformationSet& set, const Design& a, const Design& b) {
  const Certificate one = certify(set, a), other = certify(set, b);
  EXPECT_LE(one.log_det - other.log_det, other.log_det_gap + 1e-9);
  EXPECT_LE(other.log_det - one.log_det, one.log_det_gap + 1e-9);
}

class WarmStart : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] const Solver& solver() const { return registry().at(GetParam()); }
  [[nodiscard]] Solution solve(const InformationSet& set, std::span<const double> start) const {
    return solver().solve(
        set,
        {.duality_gap = target_gap(solver()), .time_limit = time_limit(solver()), .start = start});
  }
  void expect_refused(const InformationSet& set, const std::vector<double>& start,
                      const std::string& text) const {
    try {
      static_cast<void>(solve(set, start));
      ADD_FAILURE() << "not refused: " << text;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  }
};

TEST_P(WarmStart, FromTheOptimumTheFirstCheckIsTheLast) {
  for (const InformationSet& set : start_sets()) {
    const std::vector<double> start = optimum(set);
    const Solution warm = solve(set, start), cold = solve(set, {});
    ASSERT_EQ(warm.status, SolveStatus::kSolved) << warm.message;
    ASSERT_EQ(warm.trace.size(), 1U);
    EXPECT_LE(warm.counters.passes, warm.trace[0].passes);
    EXPECT_LE(warm.counters.passes, cold.counters.passes);
    EXPECT_EQ(warm.message, "");
    if (cold.status == SolveStatus::kSolved) expect_same_value(set, warm.design, cold.design);
  }
}

TEST_P(WarmStart, AStartOnTheWrongCandidatesIsLeftBehind) {
  for (const InformationSet& set : start_sets()) {
    const Solution warm = solve(set, wrong_support(set));
    if (promises_the_gap(solver())) {
      ASSERT_EQ(warm.status, SolveStatus::kSolved) << to_string(warm.status) << warm.message;
    }
    if (warm.status != SolveStatus::kSolved) continue;
    EXPECT_EQ(warm.message, "");
    expect_same_value(set, warm.design, {optimum(set)});
  }
}

TEST_P(WarmStart, ASingularStartIsNotUsedAndThatIsSaid) {
  const InformationSet set = wishart(4, 40, 1, 2);
  std::vector<double> start(set.candidate_count(), 0.0);
  start[3] = 1.0;
  const Solution solution = solve(set, start);
  EXPECT_NE(solution.message.find("the start was not used"), std::string::npos);
  if (promises_the_gap(solver())) {
    ASSERT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    expect_same_value(set, solution.design, {optimum(set)});
  }
}

TEST_P(WarmStart, WhatIsNoStartIsRefused) {
  const InformationSet set = wishart(3, 20, 3, 1);
  expect_refused(set, std::vector<double>(19, 0.05), "19 weights");
  expect_refused(set, std::vector<double>(20, 0.0), "all weights are zero");
  std::vector<double> bad(20, 0.05);
  bad[7] = std::numeric_limits<double>::quiet_NaN();
  expect_refused(set, bad, "candidate 7");
  bad[7] = -0.1;
  expect_refused(set, bad, "candidate 7");
}

class NoWarmStart : public WarmStart {};

TEST_P(NoWarmStart, IsSaid) {
  expect_refused(wishart(3, 20, 3, 1), std::vector<double>(20, 0.05), "can't begin from a design");
}

std::vector<std::string> names_that(bool take_starts) {
  std::vector<std::string> names = available_names();
  std::erase_if(names, [&](const std::string& name) {
    return registry().at(name).traits().takes_start != take_starts;
  });
  return names;
}

INSTANTIATE_TEST_SUITE_P(BackEnds, WarmStart, ::testing::ValuesIn(names_that(true)),
                         [](const auto& test) { return test.param; });
INSTANTIATE_TEST_SUITE_P(BackEnds, NoWarmStart, ::testing::ValuesIn(names_that(false)),
                         [](const auto& test) { return test.param; });

TEST(WarmStartOfColumnGeneration, OtherCriteriaBeginFromItToo) {
  const InformationSet set = wishart(5, 60, 2, 3);
  for (const Criterion& criterion : {Criterion::a(), Criterion::e(), Criterion::phi_p(2.0)}) {
    const Solver& solver = registry().at("column_generation");
    const std::vector<double> start = optimum(set, criterion);
    const SolveOptions cold_options{.duality_gap = 1e-8, .criterion = criterion};
    SolveOptions warm_options = cold_options;
    warm_options.start = start;
    const Solution cold = solver.solve(set, cold_options), warm = solver.solve(set, warm_options);
    ASSERT_EQ(warm.status, SolveStatus::kSolved) << warm.message;
    EXPECT_LT(warm.counters.passes, cold.counters.passes);
    const Certificate one = certify(set, warm.design, criterion, 1e-8);
    const Certificate other = certify(set, cold.design, criterion, 1e-8);
    EXPECT_TRUE(proves(one, 1e-8));
    EXPECT_NEAR(one.criterion_value, other.criterion_value, 1e-7 * std::abs(other.criterion_value));
  }
}

// Weights all over the set: most of them have to be left out of the working set.
TEST(WarmStartOfColumnGeneration, ALongSupportIsCutToItsHeaviest) {
  const InformationSet set = wishart(4, 3000, 2, 5);
  std::vector<double> start = optimum(set);
  for (double& weight : start) weight += 1e-7;
  const Solution warm =
      registry().at("column_generation").solve(set, {.duality_gap = 1e-9, .start = start});
  ASSERT_EQ(warm.status, SolveStatus::kSolved) << warm.message;
  EXPECT_TRUE(proves(certify(set, warm.design, {}, 1e-9), 1e-9));
  const auto support = std::ranges::count_if(warm.design.weights, [](double w) { return w > 0.0; });
  EXPECT_LE(support, 40);
}

// The lemma of warm_start.hpp: the mixture gives away at most d log(1 + gap).
TEST(UniformShare, GivesAwayNoMoreThanTheGapLeavesOpen) {
  Random random(4);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const InformationSet set = wishart(4, 30, 1 + static_cast<Eigen::Index>(seed % 3), seed);
    std::vector<double> weights(set.candidate_count(), 0.0);
    for (std::size_t k = 0; k < 12; ++k) weights[random.below(weights.size())] += 1.0 / 12.0;
    const Certificate before = certify(set, {weights});
    if (before.status != CertificateStatus::kCertified || before.duality_gap > 1.0) continue;
    const double share = uniform_share(before.duality_gap);
    const double each = share / static_cast<double>(weights.size());
    for (double& weight : weights) weight = (1.0 - share) * weight + each;
    const double bound = before.log_det - 4.0 * std::log1p(before.duality_gap);
    EXPECT_GE(log_det(set, weights), bound - 1e-12);
  }
  EXPECT_EQ(uniform_share(0.0), 0.0);
  EXPECT_EQ(uniform_share(std::numeric_limits<double>::infinity()), 0.5);
}

TEST(SimplexStart, SumsToOneWhateverItsScale) {
  for (const double scale : {1e-300, 1.0, 1e308}) {
    const std::vector<double> weights =
        simplex_start(std::vector<double>{scale, 0.0, scale, scale});
    EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 1.0, 1e-15);
    EXPECT_EQ(weights[1], 0.0);
  }
}

}  // namespace
}  // namespace graybox
