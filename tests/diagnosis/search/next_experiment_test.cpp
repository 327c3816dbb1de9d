// The experiment that tells two explanations apart, against brute force.
#include "diagnosis/hypotheses/next_experiment.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// y = a x + b x^2 against one with s (|x| - x^2) more, at points x; n M_i of n = 8 recordings and
// what is known already.
Matrix3d information_at(double x) {
  const Vector3d row(x, x * x, std::abs(x) - x * x);
  return 8.0 * row * row.transpose();
}

constexpr std::array<double, 4> kPoints{-1.0, 0.4, 0.7, 1.5};

RivalExperiments rivals(const Matrix3d& known) {
  AlignedArray information(kPoints.size() * packed_size(3));
  RivalExperiments result{{}, InformationSet(3, AlignedArray(packed_size(3))), 0.0, 8.0};
  for (std::size_t i = 0; i < kPoints.size(); ++i) {
    const Matrix3d all = known + information_at(kPoints[i]);
    pack(all.data(), 3, information.data() + i * packed_size(3));
    result.options.push_back({"", {}, kPoints[i], 1.0, 2.0});
  }
  result.information = InformationSet(3, std::move(information));
  result.distance_now = 1.0 / known.inverse()(2, 2);
  return result;
}

TEST(NextExperiment, IsTheBestMixOfItsOptions) {
  const Matrix3d known = 0.3 * (information_at(-0.5) + information_at(0.2) + information_at(0.9));
  const auto next = next_experiment(rivals(known));
  ASSERT_TRUE(next.has_value());
  double best = 0.0;
  constexpr int kSteps = 60;
  for (int a = 0; a <= kSteps; ++a) {
    for (int b = 0; a + b <= kSteps; ++b) {
      for (int c = 0; a + b + c <= kSteps; ++c) {
        const int d = kSteps - a - b - c;
        const Matrix3d m =
            known + (a * information_at(kPoints[0]) + b * information_at(kPoints[1]) +
                     c * information_at(kPoints[2]) + d * information_at(kPoints[3])) /
                        double{kSteps};
        best = std::max(best, 1.0 / m.inverse()(2, 2));
      }
    }
  }
  EXPECT_GE(next->distance_then, best * (1.0 - 1e-6));
  EXPECT_LE(next->distance_then, best * 1.01);  // the grid's own step
  EXPECT_LE(next->duality_gap, 1e-6);
  double sum = 0.0;
  for (const NextExperiment::Share& share : next->shares) sum += share.weight;
  EXPECT_NEAR(sum, 1.0, 0.02);
  const double gain = next->distance_then - next->distance_now;
  EXPECT_EQ(next->recordings_needed,
            std::ceil(8.0 * (next->distance_needed - next->distance_now) / gain));
}

TEST(NextExperiment, NeedsNothingMoreWhereTheRecordingsTellAlready) {
  const Matrix3d known = 200.0 * (information_at(-0.5) + information_at(0.2) + information_at(0.9));
  const auto next = next_experiment(rivals(known));
  ASSERT_TRUE(next.has_value());
  EXPECT_GT(next->distance_now, next->distance_needed);
  EXPECT_EQ(next->recordings_needed, 0.0);
}

// That share of draws from the difference's distribution exceeds the margin.
TEST(NextExperiment, TheDistanceNeededExcludesInNineOfTen) {
  constexpr double kMargin = 10.0;
  constexpr int kDraws = 20000;
  const double distance = distance_that_excludes(kMargin);
  Random random(5);
  int excluded = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    excluded += distance + 2.0 * std::sqrt(distance) * random.normal() > kMargin ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(excluded) / kDraws, 0.9, 0.01);
}

}  // namespace
}  // namespace graybox
