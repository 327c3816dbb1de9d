// Standard errors that allow for the spread between recordings.
#include "diagnosis/estimation/recording_spread.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kSamples = 300;
constexpr double kTruth = 2.0;

// y = x p_g + noise, where p differs from recording to recording by `spread`.
TorqueRows recordings(Eigen::Index count, double spread, Random& random) {
  TorqueRows rows;
  rows.columns.resize(count * kSamples, 1);
  rows.torque.resize(count * kSamples);
  for (Eigen::Index g = 0; g < count; ++g) {
    const double own = kTruth + spread * random.normal();
    for (Eigen::Index t = 0; t < kSamples; ++t) {
      const Eigen::Index row = g * kSamples + t;
      rows.columns(row, 0) = random.normal();
      rows.torque(row) = own * rows.columns(row, 0) + random.normal();
    }
    rows.piece_samples.push_back(kSamples);
    rows.piece_recordings.push_back(g);
  }
  return rows;
}

struct Coverage {
  double within = 0.0, of_both = 0.0;  // shares of +-1.96 errors that hold the truth
};

Coverage coverage(Eigen::Index count, double spread) {
  constexpr int kDraws = 400;
  Random random(11);
  int within = 0, both = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    TorqueRows rows = recordings(count, spread, random);
    const WeightedRegression fit = weighted_regression(rows);
    rows.piece_recordings.clear();
    const WeightedRegression alone = weighted_regression(rows);
    const double error = std::abs(fit.parameters(0) - kTruth);
    both += error <= 1.96 * std::sqrt(fit.covariance(0, 0)) ? 1 : 0;
    within += error <= 1.96 * std::sqrt(alone.covariance(0, 0)) ? 1 : 0;
  }
  return {static_cast<double>(within) / kDraws, static_cast<double>(both) / kDraws};
}

// 400 draws at 95 %: a standard deviation of 1.1 %.
TEST(RecordingSpread, CoversTheTruthWhereRecordingsDiffer) {
  for (const Eigen::Index count : {3, 5, 12}) {
    const Coverage covered = coverage(count, 0.3);
    EXPECT_GT(covered.of_both, 0.91) << count;
    EXPECT_LT(covered.within, 0.6) << count;  // what errors inside recordings alone would hold
  }
}

TEST(RecordingSpread, IsNeverNarrowerAndCoversWhereTheyDoNotDiffer) {
  EXPECT_GT(coverage(5, 0.0).of_both, 0.93);
  Random random(2);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(2, 2);
  covariance << 4.0, 1.0, 1.0, 1.0;
  const Eigen::MatrixXd wider = widened(covariance, Eigen::Vector2d(3.0, 0.5));
  EXPECT_NEAR(wider(0, 0), 9.0, 1e-12);
  EXPECT_NEAR(wider(1, 1), 1.0, 1e-12);
  EXPECT_NEAR(wider(0, 1) / std::sqrt(wider(0, 0) * wider(1, 1)), 0.5, 1e-12);
}

TEST(RecordingSpread, SaysNothingOfTwoRecordings) {
  EXPECT_TRUE(deviations_between(Eigen::MatrixXd::Ones(2, 3)).isZero(0.0));
  EXPECT_GT(deviations_between(Eigen::MatrixXd::Ones(3, 3)).minCoeff(), 0.0);
}

}  // namespace
}  // namespace graybox
