// How many experiments: against brute force, simulated experiments and grids.
#include "solvers/planning/experiment_plan.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_sets::matrix_of;
using testing_sets::wishart;

ConstraintsOf count_only(const InformationSet& set) {
  return [&set](std::int64_t n) { return number_of_experiments(set, static_cast<double>(n)); };
}

MatrixXd covariance(const InformationSet& set, std::span<const std::int64_t> counts) {
  const auto d = static_cast<Index>(set.dimension());
  MatrixXd sum = MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    sum += static_cast<double>(counts[i]) * matrix_of(set, i);
  }
  const Eigen::FullPivLU<MatrixXd> lu(sum);
  return lu.isInvertible() ? MatrixXd(lu.inverse())
                           : MatrixXd::Constant(d, d, std::numeric_limits<double>::infinity());
}

// The worst v_j, by another way than the code under test.
double worst_ratio(const MatrixXd& covariance, std::span<const PrecisionTarget> targets) {
  double worst = 0.0;
  for (const PrecisionTarget& target : targets) {
    const Eigen::Map<const VectorXd> c(target.combination.data(), covariance.rows());
    const double v = c.dot(covariance * c) / (target.standard_error * target.standard_error);
    worst = std::max(worst, std::isfinite(v) ? v : std::numeric_limits<double>::infinity());
  }
  return worst;
}

// The best worst ratio of all designs of n experiments.
double brute_force(const InformationSet& set, std::span<const PrecisionTarget> targets,
                   std::int64_t n) {
  double best = std::numeric_limits<double>::infinity();
  std::vector<std::int64_t> counts(set.candidate_count(), 0);
  const auto visit = [&](const auto& self, std::size_t i, std::int64_t left) -> void {
    if (i + 1 == counts.size()) {
      counts[i] = left;
      best = std::min(best, worst_ratio(covariance(set, counts), targets));
      return;
    }
    for (counts[i] = 0; counts[i] <= left; ++counts[i]) self(self, i + 1, left - counts[i]);
    counts[i] = 0;
  };
  visit(visit, 0, n);
  return best;
}

// Random combinations whose limits some 4 to 9 experiments reach.
std::vector<PrecisionTarget> random_targets(const InformationSet& set, std::size_t count,
                                            std::uint64_t seed) {
  Random random(seed);
  std::vector<PrecisionTarget> targets;
  const std::vector<std::int64_t> even(set.candidate_count(), 1);
  const MatrixXd c = covariance(set, even);
  for (std::size_t j = 0; j < count; ++j) {
    PrecisionTarget target{"t", std::vector<double>(set.dimension()), 1.0, 0.0};
    for (double& x : target.combination) x = random.normal();
    const Eigen::Map<const VectorXd> v(target.combination.data(), c.rows());
    target.standard_error = std::sqrt(v.dot(c * v)) * (0.8 + 0.4 * random.uniform());
    targets.push_back(std::move(target));
  }
  return targets;
}

// The trees prove every number.
TEST(ExperimentPlan, IsTheSmallestNumberOfBruteForce) {
  int proven = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const auto d = static_cast<Index>(1 + seed % 3);
    const InformationSet set = wishart(d, 5, d > 1 ? 1 : d, 100 + seed);
    const std::vector<PrecisionTarget> targets = random_targets(set, 1 + seed % 4, seed);
    const ExperimentPlan plan =
        plan_experiments(set, count_only(set), targets, {.at_most = 40, .time_limit = 60.0});
    ASSERT_TRUE(plan.status == PlanStatus::kProven ||
                (plan.status == PlanStatus::kReached && targets.size() > 1))
        << seed << ": " << plan.message;
    EXPECT_LE(worst_ratio(covariance(set, plan.counts), targets), 1.0 + 1e-9) << seed;
    std::int64_t smallest = 1;
    while (brute_force(set, targets, smallest) > 1.0) ++smallest;
    EXPECT_LE(plan.least, smallest) << seed;
    EXPECT_GE(plan.experiments, smallest) << seed;
    if (plan.status == PlanStatus::kProven) {
      ++proven;
      EXPECT_EQ(plan.experiments, smallest) << seed;
    }
    for (std::size_t j = 0; j < targets.size(); ++j) {
      EXPECT_LE(plan.standard_errors[j], targets[j].standard_error * (1.0 + 1e-9)) << seed;
    }
  }
  EXPECT_EQ(proven, 40);
}

// On two candidates the mixture is one number.
TEST(ExperimentPlan, RelaxedBoundsEncloseAGridsOptimum) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const InformationSet set = wishart(3, 2, 3, 300 + seed);
    const std::vector<PrecisionTarget> targets = random_targets(set, 5, seed);
    const MinimaxPrecision answer =
        solve_minimax_precision(set, number_of_experiments(set, 1.0), targets, {.gap = 1e-6});
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= 20000; ++k) {
      const double share = k / 20000.0;
      const MatrixXd m = share * matrix_of(set, 0) + (1.0 - share) * matrix_of(set, 1);
      best = std::min(best, worst_ratio(m.inverse(), targets));
    }
    EXPECT_LE(answer.lower, best * (1.0 + 1e-9)) << seed;
    EXPECT_GE(answer.upper, best * (1.0 - 1e-4)) << seed;
    EXPECT_LE(answer.upper, answer.lower * (1.0 + 1e-6)) << seed;
  }
}

// Least squares on 10 000 simulated campaigns have the standard errors and the power promised.
TEST(ExperimentPlan, SimulatedExperimentsHaveThePrecisionAndThePowerPromised) {
  const InformationSet set = wishart(3, 12, 2, 7);
  const double level = 0.05;
  std::vector<PrecisionTarget> targets = parse_detections(set, "0 by 0.4", 0.8, level);
  const std::vector<PrecisionTarget> more = parse_precision_targets(set, "sd(1 - 2) <= 0.25");
  targets.insert(targets.end(), more.begin(), more.end());
  const ExperimentPlan plan =
      plan_experiments(set, count_only(set), targets, {.at_most = 400, .time_limit = 60.0});
  ASSERT_EQ(plan.status, PlanStatus::kProven);
  const MatrixXd c = covariance(set, plan.counts);
  Random random(11);
  constexpr int kCampaigns = 10000;
  int rejected = 0;
  double square = 0.0;
  const Eigen::Vector3d truth(0.4, 0.0, 0.0);  // the nominal values are zero
  for (int k = 0; k < kCampaigns; ++k) {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // sum of J^T y
    for (std::size_t i = 0; i < plan.counts.size(); ++i) {
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(matrix_of(set, i));
      const MatrixXd j = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
                         eigen.eigenvectors().transpose();  // J^T J = H
      for (std::int64_t n = 0; n < plan.counts[i]; ++n) {
        const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
        normal += j.transpose() * (j * truth + noise);
      }
    }
    const Eigen::Vector3d estimate = c * normal;
    rejected += std::abs(estimate(0)) > 1.959963984540054 * plan.standard_errors[0];
    square += std::pow(estimate(1) - estimate(2), 2);
  }
  const double power = detection_power(0.4 / plan.standard_errors[0], level);
  EXPECT_GE(power, 0.8);
  EXPECT_NEAR(rejected / double{kCampaigns}, power, 4.0 * 0.4 / std::sqrt(kCampaigns));
  EXPECT_NEAR(std::sqrt(square / kCampaigns) / plan.standard_errors[1], 1.0, 0.03);
}

// Other units of the parameters change nothing, nor does another order of the candidates.
TEST(ExperimentPlan, DoesNotDependOnUnits) {
  const InformationSet set = wishart(3, 20, 1, 5);
  const std::vector<PrecisionTarget> targets = random_targets(set, 3, 5);
  const Eigen::Vector3d units(1e3, 1.0, 1e-4);
  std::vector<MatrixXd> scaled;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    scaled.emplace_back(units.asDiagonal() * matrix_of(set, i) * units.asDiagonal());
  }
  std::ranges::reverse(scaled);
  const InformationSet other = testing_sets::from_matrices(scaled);
  std::vector<PrecisionTarget> same = targets;
  for (PrecisionTarget& target : same) {
    for (std::size_t k = 0; k < 3; ++k) target.combination[k] *= units(static_cast<Index>(k));
  }
  const PlanOptions options{.at_most = 200, .time_limit = 60.0};
  const ExperimentPlan a = plan_experiments(set, count_only(set), targets, options),
                       b = plan_experiments(other, count_only(other), same, options);
  EXPECT_EQ(a.status, PlanStatus::kProven);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.experiments, b.experiments);
}

TEST(ExperimentPlan, SaysWhatIsOutOfReach) {
  const InformationSet set = wishart(2, 6, 2, 3);
  const std::vector<PrecisionTarget> targets = parse_precision_targets(set, "sd(all) <= 0.001");
  const ExperimentPlan plan = plan_experiments(set, count_only(set), targets, {.at_most = 50});
  EXPECT_EQ(plan.status, PlanStatus::kOutOfReach);
  EXPECT_EQ(plan.least, 51);
  EXPECT_GT(plan.worst_ratio, 1.0);
  EXPECT_TRUE(plan.counts.empty());
}

TEST(ExperimentPlan, CurveFallsAndStaysAboveItsBound) {
  const InformationSet set = wishart(3, 15, 1, 9);
  const std::vector<PrecisionTarget> targets = random_targets(set, 3, 2);
  const std::vector<std::int64_t> numbers{4, 8, 16, 64};
  const auto points = precision_curve(set, count_only(set), targets, numbers, {});
  ASSERT_EQ(points.size(), 4U);
  for (std::size_t k = 0; k < points.size(); ++k) {
    EXPECT_GE(points[k].ratio, points[k].least_ratio * (1.0 - 1e-9));
    if (k > 0) {
      EXPECT_LT(points[k].ratio, points[k - 1].ratio);
    }
  }
  EXPECT_NEAR(points[3].ratio / points[3].least_ratio, 1.0, 0.02);
}

TEST(PrecisionTarget, IsReadAsWritten) {
  const InformationSet set = [] {
    const InformationSet plain = wishart(3, 4, 3, 1);
    AlignedArray information(plain.candidate_count() * plain.packed_size());
    std::copy_n(plain.data(), information.size(), information.begin());
    return InformationSet(3, std::move(information), {}, {"k-1", "k2", "k3"});
  }();
  EXPECT_EQ(parse_combination(set, "2*k-1 - k2", "x"), (std::vector<double>{2.0, -1.0, 0.0}));
  EXPECT_EQ(parse_combination(set, " k3 ", "x"), (std::vector<double>{0.0, 0.0, 1.0}));
  const auto targets = parse_precision_targets(set, "sd( k2 ) <= 2 %");
  EXPECT_DOUBLE_EQ(targets.at(0).standard_error, 0.02);
  EXPECT_EQ(parse_precision_targets(set, "sd(all)<=0.1").size(), 3U);
  for (const char* bad : {"k2 <= 0.1", "sd(k2) < 0.1", "sd(k9) <= 0.1", "sd(k2) <= -1",
                          "sd(k2 - k2) <= 1", "sd(x*k2) <= 1", "sd() <= 1", "sd(k2) <= 1 m"}) {
    EXPECT_THROW((void)parse_precision_targets(set, bad), InputError) << bad;
  }
  EXPECT_THROW((void)parse_detections(set, "k2 0.1", 0.9, 0.05), InputError);
  EXPECT_THROW((void)parse_detections(set, "k2 by 0.1", 0.04, 0.05), InputError);
}

// Tables of the power of the two-sided normal test (Cohen 1988): 2.8016 for 80 % at 5 %.
TEST(PrecisionTarget, PowerIsThatOfTheTwoSidedTest) {
  EXPECT_NEAR(effect_for_power(0.8, 0.05), 2.8016, 1e-4);
  EXPECT_NEAR(effect_for_power(0.9, 0.05), 3.2415, 1e-4);
  EXPECT_NEAR(detection_power(0.0, 0.05), 0.05, 1e-12);
}

}  // namespace
}  // namespace graybox
