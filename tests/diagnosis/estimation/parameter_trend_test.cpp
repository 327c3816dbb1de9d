// Residuals made white, parameters that change, and laws that give way to plainer ones: closed
// forms, rates of chance, and simulated machines.
#include "diagnosis/predictor/parameter_trend.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "diagnosis/predictor/residual_whitener.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kSamples = 1200;  // a run

PredictionTask two_runs() {
  PredictionTask task;
  task.horizon = 1;
  for (const std::size_t recording : {0U, 1U}) {
    PredictionRun run;
    run.recording = recording;
    run.samples = kSamples;
    run.horizon = 1;
    task.runs.push_back(run);
  }
  return task;
}

VectorXd normal_values(Index count, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return VectorXd::NullaryExpr(count, [&] { return normal(random); });
}

// e_k = a e_(k-1) + noise, each run from the start.
VectorXd with_memory(double a, std::mt19937_64& random) {
  VectorXd e = normal_values(2 * kSamples, random);
  for (Index k = 1; k < e.size(); ++k) {
    if (k != kSamples) e(k) += a * e(k - 1);
  }
  return e;
}

double correlation(const VectorXd& values, Index lag) {
  const Index n = values.size() - lag;
  return values.head(n).dot(values.tail(n)) / values.squaredNorm();
}

TEST(ResidualWhitener, LeavesTheNoiseThatResidualsWereMadeFrom) {
  std::mt19937_64 random(4);
  const VectorXd noise = normal_values(2 * kSamples, random);
  VectorXd e = noise;
  for (Index k = 2; k < e.size(); ++k) {
    if (k != kSamples && k != kSamples + 1) e(k) += 1.2 * e(k - 1) - 0.6 * e(k - 2);
  }
  const PredictionTask task = two_runs();
  const VectorXd white = ResidualWhitener(task, 1, e).apply(e);
  EXPECT_GT(correlation(e, 1), 0.5);
  for (const Index lag : {1, 2, 5}) EXPECT_NEAR(correlation(white, lag), 0.0, 0.06) << lag;
  EXPECT_NEAR((white - noise).norm() / noise.norm(), 0.0, 0.15);
  // A run knows nothing of the one before.
  EXPECT_EQ(white(kSamples), e(kSamples));
}

TEST(ResidualWhitener, TakesEachOutputByItself) {
  std::mt19937_64 random(5);
  const VectorXd first = with_memory(0.9, random), second = normal_values(2 * kSamples, random);
  VectorXd both(4 * kSamples);
  for (Index k = 0; k < 2 * kSamples; ++k) {
    both(2 * k) = first(k);
    both(2 * k + 1) = 5.0 * second(k);
  }
  const PredictionTask task = two_runs();
  const VectorXd white = ResidualWhitener(task, 2, both).apply(both);
  const VectorXd alone = ResidualWhitener(task, 1, first).apply(first);
  for (Index k = 0; k < 2 * kSamples; ++k) EXPECT_NEAR(white(2 * k), alone(k), 1e-9);
}

// A linear model with two columns.
PredictionFit linear_fit(const VectorXd& residuals, std::mt19937_64& random) {
  PredictionFit fit;
  fit.usable = true;
  fit.residuals = residuals;
  fit.jacobian.resize(residuals.size(), 2);
  for (Index c = 0; c < 2; ++c) fit.jacobian.col(c) = normal_values(residuals.size(), random);
  fit.edges = two_runs().edges(1);
  return fit;
}

// r beside the columns: what a fit of constants leaves.
void leave_what_is_beside(PredictionFit& fit) {
  const VectorXd step = fit.jacobian.colPivHouseholderQr().solve(fit.residuals);
  fit.residuals -= fit.jacobian * step;
}

TEST(ParameterTrends, IsTheSlopeThatAConstantLeavesOut) {
  constexpr double kSlope = -0.7;
  std::mt19937_64 random(6);
  const PredictionTask task = two_runs();
  PredictionFit fit = linear_fit(VectorXd::Zero(2 * kSamples), random);
  const VectorXd time = ParameterTrends(task, 1, fit).time();
  EXPECT_DOUBLE_EQ(time(0), -0.5 * (kSamples - 1.0) / kSamples);
  EXPECT_DOUBLE_EQ(time(kSamples), time(0));
  fit.residuals = -kSlope * time.cwiseProduct(fit.jacobian.col(1));
  leave_what_is_beside(fit);
  const ParameterTrends trends(task, 1, fit);
  EXPECT_NEAR(trends.with(time, 1).slope, kSlope, 1e-9);
  // A constant is no trend, and another covariate's mean is none either.
  EXPECT_NEAR(trends.with(time.array() + 3.0, 1).slope, kSlope, 1e-9);
  EXPECT_EQ(trends.with(VectorXd::Ones(2 * kSamples), 1).z, 0.0);
  EXPECT_NEAR(trends.with(2.0 * time, 1).slope, 0.5 * kSlope, 1e-9);
}

// By least squares with the product as a third column.
TEST(ParameterTrends, IsThatOfLeastSquaresWithOneColumnMore) {
  std::mt19937_64 random(7);
  const PredictionTask task = two_runs();
  PredictionFit fit = linear_fit(normal_values(2 * kSamples, random), random);
  leave_what_is_beside(fit);
  const ParameterTrends trends(task, 1, fit);
  const VectorXd time = trends.time();
  MatrixXd columns(2 * kSamples, 3);
  columns << fit.jacobian, time.cwiseProduct(fit.jacobian.col(0));
  const VectorXd solved = columns.colPivHouseholderQr().solve(-fit.residuals);
  EXPECT_NEAR(trends.with(time, 0).slope, solved(2), 1e-9);
}

// Residuals with memory, far shorter than a block: 24 blocks, so about Student's t.
TEST(ParameterTrends, ChanceIsAsRareAsStudentsT) {
  std::mt19937_64 random(8);
  const PredictionTask task = two_runs();
  constexpr int kDraws = 1500;
  int beyond_two = 0, beyond_limit = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    PredictionFit fit = linear_fit(with_memory(0.8, random), random);
    leave_what_is_beside(fit);
    const ParameterTrends trends(task, 1, fit);
    const double z = std::abs(trends.with(trends.time(), 0).z);
    if (z > 2.07) ++beyond_two;
    if (z > 4.5) ++beyond_limit;
  }
  EXPECT_GT(beyond_two, kDraws * 3 / 100);
  EXPECT_LT(beyond_two, kDraws * 8 / 100);
  EXPECT_LE(beyond_limit, 3);
}

// A carriage on a spring, driven by four sines and a pulse, dry friction: the log of a newcomer.
void write_carriage(const testing::TemporaryFolder& folder) {
  constexpr double kMass = 2.0, kDamping = 14.0, kSpring = 5.0, kLevel = 2.0, kStep = 2e-4;
  constexpr std::array kPhases{0.537877, 1.487170, 5.032004, 3.655978};
  constexpr std::array kFrequencies{0.441193, 0.949690, 1.018577, 0.539608};
  const auto force = [&](double t) {
    double sum = t > 4.0 && t < 4.7 ? 16.0 : 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      sum += 4.8 * std::sin(2.0 * std::numbers::pi * kFrequencies[i] * t + kPhases[i]);
    }
    return sum;
  };
  const auto rate = [&](double t, const Eigen::Vector2d& x) -> Eigen::Vector2d {
    return {x(1), (force(t) - kDamping * x(1) - kSpring * x(0) - kLevel * std::tanh(x(1) / 0.002)) /
                      kMass};
  };
  std::ofstream log(folder.file("log.csv"));
  log << "time,force,position\n";
  log.precision(9);
  Eigen::Vector2d x(0.0, 0.0);
  for (int k = 0; k < 120000; ++k) {
    const double t = kStep * k;
    if (k % 10 == 0) log << t << ',' << force(t) << ',' << std::round(x(0) * 1e6) * 1e-6 << '\n';
    x += kStep * rate(t + 0.5 * kStep, x + 0.5 * kStep * rate(t, x));
  }
  std::ofstream(folder.file("model.yaml"))
      << "format: graybox-lumped/1\nsample_time: 0.002\nmotion: translation\nmasses: {axis: 1.96}\n"
         "elements:\n  - {name: bearing, location: {kind: element, mass: axis}, law: viscous, "
         "parameters: {damping: {value: 14.2, unit: N s/m}}}\n"
         "inputs:\n  - {name: force, mass: axis}\noutputs:\n  - {name: position, mass: axis, "
         "quantity: position}\n";
  std::ofstream(folder.file("campaign.yaml"))
      << "format: graybox-campaign/1\nsample_time: 0.002\nchannels:\n"
         "  - {name: force, unit: N, is: input}\n  - {name: position, unit: m, is: output}\n"
         "experiments:\n  - {file: log.csv, segments: [[0, 5999]]}\n"
         "  - {file: log.csv, segments: [[6000, 11999]], role: validation}\n";
}

// A spring is a clearance of no width. The search takes the clearance first.
TEST(PlainerLaws, ASpringIsNoClearance) {
  const testing::TemporaryFolder folder;
  write_carriage(folder);
  const PredictionDiagnosis result = diagnose_by_prediction(
      folder.file("model.yaml"), read_campaign(folder.file("campaign.yaml")), {}, 2);
  std::vector<std::string> found;
  for (const FoundEffect& effect : result.diagnosis.effects) {
    found.push_back(result.hypotheses[effect.law.hypothesis].law);
    const double size = effect.law.parameters[0].value;
    const bool is_spring = found.back() == "stiffness";
    EXPECT_NEAR(size, is_spring ? 5.0 : 2.0, is_spring ? 0.15 : 0.05) << found.back();
  }
  std::ranges::sort(found);
  EXPECT_EQ(found, (std::vector<std::string>{"coulomb", "stiffness"}));
  EXPECT_EQ(result.diagnosis.verdict, Verdict::kExplained);
}

}  // namespace
}  // namespace graybox
