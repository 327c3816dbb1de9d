// The next experiments, and the study of sequential design.
#include "diagnosis/studies/sequential_design.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/families/families.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/core/sensitivity.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Counts = std::vector<std::int64_t>;

std::int64_t total(const Counts& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
}

double log_det(const InformationSet& set, const Counts& counts) {
  std::vector<double> weights(counts.begin(), counts.end()), packed(set.packed_size());
  information_matrix(set, weights, packed);
  InverseFactor factor;
  EXPECT_TRUE(invert(packed, set.dimension(), factor));
  return factor.log_det;
}

Counts sum(const Counts& a, const Counts& b) {
  Counts result(a);
  for (std::size_t i = 0; i < b.size(); ++i) result[i] += b[i];
  return result;
}

TEST(NextExperiments, AreAsManyAsAskedAndNearTheRelaxedOptimum) {
  const InformationSet set = make_family("wis", 200, 4, 3);
  const Counts counts = next_experiments(set, {}, 400);
  EXPECT_EQ(total(counts), 400);
  std::vector<double> weights(counts.begin(), counts.end());
  for (double& weight : weights) weight /= 400.0;
  EXPECT_LT(duality_gap(set, weights), 0.02);
}

// Where all experiments so far went to one candidate, the next ones make up for it, and exchanging
// one of them for another gains nothing.
TEST(NextExperiments, ComplementWhatWasDone) {
  const InformationSet set = make_family("wis", 200, 4, 3);
  Counts past(200, 0);
  past[7] = 50;
  const Counts next = next_experiments(set, past, 100);
  EXPECT_EQ(total(next), 100);
  const double both = log_det(set, sum(past, next));
  EXPECT_GT(both, log_det(set, sum(past, next_experiments(set, {}, 100))) + 1e-3);
  double best = both;
  for (std::size_t out = 0; out < 200; ++out) {
    if (next[out] == 0) continue;
    for (std::size_t in = 0; in < 200; ++in) {
      Counts moved = next;
      --moved[out];
      ++moved[in];
      best = std::max(best, log_det(set, sum(past, moved)));
    }
  }
  EXPECT_LT(best - both, 1e-9);
}

TEST(NextExperiments, RefuseNothingToDoAndCountsOfAnotherSet) {
  const InformationSet set = make_family("wis", 50, 3, 1);
  EXPECT_THROW((void)next_experiments(set, {}, 0), InputError);
  EXPECT_THROW((void)next_experiments(set, Counts(49, 1), 5), InputError);
}

// ---- the study ---------------------------------------------------------------------------------

class SequentialStudy : public ::testing::Test {
 protected:
  // The paper's robot with every eighth frequency and a small grid: a repetition takes less than a
  // second.
  static RobotModel quick_robot() {
    RobotModel robot = robot_test::paper_robot();
    std::vector<double> frequencies;
    for (std::size_t f = 0; f < robot.frequencies.size(); f += 8) {
      frequencies.push_back(robot.frequencies[f]);
    }
    robot.frequencies = frequencies;
    robot.velocity_psd_slope *= 1e-6;
    return robot;
  }
  static SequentialOptions quick_options() {
    return {.stages = 2,
            .experiments_per_stage = 12,
            .repetitions = 2,
            .start_error = 0.3,  // few frequencies: further off, fits need many starts
            .seed = 4};
  }
  static std::vector<StageRecord> run(const SequentialOptions& options) {
    std::vector<StageRecord> records;
    run_sequential_study(quick_robot(), robot_grid(100), options,
                         [&](const std::vector<StageRecord>& repetition) {
                           records.insert(records.end(), repetition.begin(), repetition.end());
                           return true;
                         });
    std::ranges::stable_sort(records, {}, &StageRecord::repetition);
    return records;
  }
};

TEST_F(SequentialStudy, ConvergesFromAWrongStartAndBeatsTheFixedDesign) {
  const std::vector<StageRecord> records = run(quick_options());
  ASSERT_EQ(records.size(), 2U * 4U * 3U);
  for (const StageRecord& record : records) {
    if (record.stage == 0) {
      EXPECT_NEAR(record.parameter_error, 0.3, 1e-12);
      EXPECT_NEAR(record.largest_error, 0.3, 1e-12);
    } else {
      EXPECT_EQ(record.experiments, 12 * record.stage);
      EXPECT_LE(record.design_efficiency, 1.0 + 1e-7);
    }
  }
  for (const int repetition : {0, 1}) {
    const auto at = [&](DesignStrategy strategy, int stage) {
      return *std::ranges::find_if(records, [&](const StageRecord& record) {
        return record.repetition == repetition && record.strategy == strategy &&
               record.stage == stage;
      });
    };
    const StageRecord start = at(DesignStrategy::kSequential, 1);
    const StageRecord end = at(DesignStrategy::kSequential, 2);
    EXPECT_GT(end.design_efficiency, start.design_efficiency + 0.2);
    EXPECT_GT(end.design_efficiency, at(DesignStrategy::kFixed, 2).design_efficiency + 0.2);
    EXPECT_GT(at(DesignStrategy::kOracle, 2).design_efficiency, 0.9);
    EXPECT_LT(end.parameter_error, 0.02);
    EXPECT_LT(end.lack_of_fit, 5.0);
    EXPECT_LT(end.expected_error, at(DesignStrategy::kFixed, 2).expected_error);
    // The first stage knows nothing but the start: fixed and sequential are the same experiment.
    EXPECT_EQ(start.theta, at(DesignStrategy::kFixed, 1).theta);
  }
}

TEST_F(SequentialStudy, DoesNotDependOnThreadsAndStopsWhenTold) {
  SequentialOptions options = quick_options();
  options.stages = 1;
  options.start_error = 0.1;
  const std::vector<StageRecord> one = run(options);
  options.threads = 2;
  const std::vector<StageRecord> two = run(options);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].theta, two[i].theta);
    EXPECT_EQ(one[i].design_efficiency, two[i].design_efficiency);
  }
  options.repetitions = 50;
  int calls = 0;
  run_sequential_study(quick_robot(), robot_grid(100), options,
                       [&](const std::vector<StageRecord>&) { return ++calls < 2; });
  EXPECT_EQ(calls, 2);
}

TEST_F(SequentialStudy, CountsItsStages) {
  SequentialOptions options = quick_options();
  options.stages = 1;
  options.start_error = 0.1;
  std::size_t next = 0;
  run_sequential_study(
      quick_robot(), robot_grid(100), options, [](const std::vector<StageRecord>&) { return true; },
      [&](std::size_t done, std::size_t total) {
        EXPECT_EQ(done, next++);
        EXPECT_EQ(total, 2U * 4U * 1U);
      });
  EXPECT_EQ(next, 9U);
}

TEST_F(SequentialStudy, RefusesBadOptions) {
  const auto refused = [](auto&& spoil) {
    SequentialOptions options = quick_options();
    spoil(options);
    EXPECT_THROW((void)run(options), InputError);
  };
  refused([](SequentialOptions& o) { o.stages = 0; });
  refused([](SequentialOptions& o) { o.experiments_per_stage = 0; });
  refused([](SequentialOptions& o) { o.repetitions = 0; });
  refused([](SequentialOptions& o) { o.threads = 0; });
  refused([](SequentialOptions& o) { o.start_error = 1.0; });
  refused([](SequentialOptions& o) { o.start_error = -0.1; });
}

TEST(SequentialSummary, HasMeansSpreadsAndQuartiles) {
  std::vector<StageRecord> records;
  for (const double error : {1.0, 2.0, 3.0, 4.0, 10.0}) {
    StageRecord record;
    record.stage = 1;
    record.parameter_error = error;
    record.lack_of_fit = error;
    records.push_back(record);
  }
  const std::vector<StageSummary> summaries = summarise(records);
  ASSERT_EQ(summaries.size(), 1U);
  EXPECT_EQ(summaries[0].repetitions, 5U);
  EXPECT_EQ(summaries[0].rejected_fits, 2U);  // 4 and 10
  const StageSummary::Spread& spread = summaries[0].parameter_error;
  EXPECT_DOUBLE_EQ(spread.mean, 4.0);
  EXPECT_DOUBLE_EQ(spread.standard_deviation, std::sqrt(50.0 / 4.0));
  EXPECT_DOUBLE_EQ(spread.lower_quartile, 2.0);
  EXPECT_DOUBLE_EQ(spread.median, 3.0);
  EXPECT_DOUBLE_EQ(spread.upper_quartile, 4.0);
}

}  // namespace
}  // namespace graybox
