// Laws that hold on the average only: whether a balance of forces sees that they change with the
// time or the position, and how often it says so of those that don't.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <string>

#include "diagnosis/evidence/trend_reason.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "problems/base/random.hpp"
#include "tests/support/carriage_files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

// Of time (0 to 1 within a recording), position and velocity, N.
using Friction = std::function<double(double, double, double)>;

constexpr double kMemory = 0.9;  // of the noise, from sample to sample

void write_run(const std::string& file, const Friction& friction, double phase, Random& random) {
  std::ofstream rows(file);
  rows.precision(12);
  rows << "force,x,v,a\n";
  double noise = random.normal();
  for (int k = 0; k < 1500; ++k) {
    noise = kMemory * noise + std::sqrt(1.0 - kMemory * kMemory) * random.normal();
    const double t = 0.01 * k;
    double x = 0.0, v = 0.0, a = 0.0;
    for (const auto& [amplitude, w] :
         {std::array{0.3, 1.1}, std::array{0.1, 2.9}, std::array{0.03, 6.1}}) {
      x += amplitude * std::sin(w * t + phase);
      v += amplitude * w * std::cos(w * t + phase);
      a -= amplitude * w * w * std::sin(w * t + phase);
    }
    rows << 12.0 * a + friction(k / 1500.0, x, v) + 0.5 * noise << ',' << x << ',' << v << ',' << a
         << '\n';
  }
}

Diagnosis diagnosis_of(const Friction& friction, std::uint64_t seed) {
  const testing::TemporaryFolder folder;
  Random random(seed);
  write_run(folder.file("run_1.csv"), friction, 0.0, random);
  write_run(folder.file("run_2.csv"), friction, 1.3, random);
  std::ofstream(folder.file("drive.yaml")) << testing::kCarriageModel;
  std::ofstream(folder.file("campaign.yaml"))
      << testing::kCarriageCampaign
      << "  - {file: run_1.csv}\n  - {file: run_2.csv, role: validation}\n";
  return diagnose(*force_balance_problem(folder.file("drive.yaml"),
                                         read_campaign(folder.file("campaign.yaml"))));
}

double direction_of(double v) { return std::tanh(v / 0.002); }

bool is_told(const Diagnosis& diagnosis) {
  return !told_trends(diagnosis.trends, diagnosis.effects).empty();
}

TEST(LawTrends, FrictionThatFadesIsUnknownAndSaysFromWhatToWhat) {
  const Diagnosis diagnosis = diagnosis_of(
      [](double share, double, double v) { return (6.0 - 3.0 * share) * direction_of(v); }, 3);
  ASSERT_TRUE(is_told(diagnosis));
  const LawTrend trend = told_trends(diagnosis.trends, diagnosis.effects).front();
  EXPECT_EQ(trend.on, LawTrend::On::kTime);
  EXPECT_NEAR(trend.from, 6.0, 0.3);
  EXPECT_NEAR(trend.to, 3.0, 0.3);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  // It is named before what it spoils.
  const auto first = std::ranges::find_if(diagnosis.reasons, has_failed);
  EXPECT_TRUE(first->test.starts_with("what was found changes")) << first->test;
  EXPECT_NE(trend_words(trend, diagnosis.effects).find("where recordings begin"),
            std::string::npos);
}

// Its rms over that of the force, by the sums themselves: (share - 1/2) takes 3/sqrt(12) N, less
// what a constant level and the noise take or leave of it.
TEST(LawTrends, WhatAChangeTakesOfTheSignalIsTold) {
  const double change = 3.0;
  const Diagnosis diagnosis = diagnosis_of(
      [&](double share, double, double v) { return (6.0 - change * share) * direction_of(v); }, 3);
  ASSERT_FALSE(diagnosis.trends.empty());
  double squares = 0.0;  // of the force about its mean, which is nearly zero
  for (int k = 0; k < 1500; ++k) {
    const double t = 0.01 * k;
    double v = 0.0, a = 0.0;
    for (const auto& [amplitude, w] :
         {std::array{0.3, 1.1}, std::array{0.1, 2.9}, std::array{0.03, 6.1}}) {
      v += amplitude * w * std::cos(w * t);
      a -= amplitude * w * w * std::sin(w * t);
    }
    squares += std::pow(12.0 * a + (6.0 - change * k / 1500.0) * direction_of(v), 2);
  }
  const double wanted = change / std::sqrt(12.0) / std::sqrt(squares / 1500.0);
  EXPECT_NEAR(diagnosis.trends.front().of_signal, wanted, 0.15 * wanted);
}

// A guide that is worn by little is told, and spoils no verdict: it takes less than a rest that
// depends on the motion may leave.
TEST(LawTrends, AChangeThatTakesLittleOfTheSignalIsToldAndPasses) {
  FoundEffect effect;
  effect.law.parameters.push_back({"value", "N", 3.2, 0.02});
  const std::array effects{effect};
  std::array trends{
      LawTrend{0, 0, LawTrend::On::kPosition, 2.2, 4.2, 12.0, "offset at axis", 0.02}};
  EXPECT_TRUE(trend_reason(trends, effects, "").passed);
  EXPECT_EQ(told_trends(trends, effects).size(), 1U);
  trends.front().of_signal = 0.04;
  EXPECT_FALSE(trend_reason(trends, effects, "").passed);
  trends.front().of_signal = std::numeric_limits<double>::quiet_NaN();  // not known
  EXPECT_FALSE(trend_reason(trends, effects, "").passed);
}

TEST(LawTrends, FrictionThatGrowsAlongTheWayIsNotSure) {
  const Diagnosis diagnosis =
      diagnosis_of([](double, double x, double v) { return (4.0 + 5.0 * x) * direction_of(v); }, 4);
  ASSERT_TRUE(is_told(diagnosis));
  EXPECT_EQ(told_trends(diagnosis.trends, diagnosis.effects).front().on, LawTrend::On::kPosition);
  EXPECT_NE(diagnosis.verdict, Verdict::kExplained);
}

// A law that holds is told to change in fewer than one diagnosis in a hundred; GRAYBOX_TEST_RUNS
// asks for so many times ten.
TEST(LawTrends, ALawThatHoldsDoesNotChange) {
  const char* const runs = std::getenv("GRAYBOX_TEST_RUNS");
  const unsigned draws = 10 * (runs == nullptr ? 1 : static_cast<unsigned>(std::atoi(runs)));
  unsigned told = 0;
  for (unsigned seed = 100; seed < 100 + draws; ++seed) {
    const Diagnosis diagnosis = diagnosis_of(
        [](double, double, double v) { return 4.0 * direction_of(v) + 8.0 * v; }, seed);
    ASSERT_FALSE(diagnosis.trends.empty());
    told += is_told(diagnosis) ? 1U : 0U;
  }
  std::printf("%u of %u told\n", told, draws);
  EXPECT_LE(told, draws / 100 + 1);
}

TEST(LawTrends, BeyondZeroALineSaysNoMoreThanNone) {
  FoundEffect effect;
  effect.law.parameters.push_back({"level", "N", 0.3, 0.02});
  const LawTrend trend{0, 0, LawTrend::On::kSpeed, -0.1, 0.7, -7.0, "coulomb at axis"};
  const std::array effects{effect};
  EXPECT_EQ(trend_words(trend, effects),
            "level of coulomb at axis: none in fast motion, more than 0.3 N in slow motion");
  const LawTrend wave{0, 0, LawTrend::On::kPosition, 0.2, 0.4, 9.0, "coulomb at axis"};
  EXPECT_EQ(trend_words(wave, effects),
            "level of coulomb at axis: between about 0.2 and 0.4 N along the way");
}

// The line goes through the parameter's value where that is told, and ends where it is.
TEST(LawTrends, EndWhereTheParameterIsTold) {
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(11, 0.0, 1.0);
  Eigen::VectorXd told = Eigen::VectorXd::Zero(11);
  told(2) = 3.0;
  told(8) = 1.0;
  const ToldRange range(time, told);
  EXPECT_TRUE(range.is_wide());
  EXPECT_NEAR(range.ends(5.0, 2.0).from, 5.0 - 2.0 * 0.15, 1e-12);
  EXPECT_NEAR(range.ends(5.0, 2.0).to, 5.0 + 2.0 * 0.45, 1e-12);
}

// A step of the drive tells a delay once, and not whether it grows.
TEST(LawTrends, WhatIsToldInOnePlaceHasNone) {
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(500, 0.0, 1.0);
  Eigen::VectorXd told = Eigen::VectorXd::Constant(500, 1e-6);
  told.segment(350, 60).setOnes();
  EXPECT_FALSE(ToldRange(time, told).is_wide());
  told.segment(50, 60).setOnes();
  EXPECT_TRUE(ToldRange(time, told).is_wide());
  EXPECT_FALSE(ToldRange(time, Eigen::VectorXd::Zero(500)).is_wide());
}

// A run-down has one way, and says nothing of the other.
TEST(RateCovariates, CompareDirectionsWhereItMovesBothWays) {
  const Eigen::VectorXd there = Eigen::VectorXd::LinSpaced(100, 9.0, 0.5);
  Eigen::VectorXd back = there;
  back.tail(50) *= -1.0;
  const auto compares = [](const Eigen::VectorXd& rate) {
    std::vector<TrendCovariate> covariates;
    append_rate_covariates(rate, covariates);
    return std::ranges::any_of(covariates, [](const TrendCovariate& covariate) {
      return covariate.on == LawTrend::On::kDirection;
    });
  };
  EXPECT_FALSE(compares(there));
  EXPECT_FALSE(compares(-there));
  EXPECT_TRUE(compares(back));
}

}  // namespace
}  // namespace graybox
