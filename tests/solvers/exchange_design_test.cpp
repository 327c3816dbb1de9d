// The parts of the first-order methods: line search, moves, start, coordinates, the fused pass.
#include "solvers/exchange/exchange_design.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/exchange/log_det_line.hpp"
#include "solvers/exchange/start_design.hpp"
#include "solvers/multiplicative/reweigh_pass.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_symmetric(Index d, Index rank, Random& random) {
  const MatrixXd g = gaussian(d, rank, random), h = gaussian(d, rank, random);
  return g * g.transpose() - h * h.transpose();
}

// phi'(a) by the eigenvalues of C.
double slope(const VectorXd& eigenvalues, double a) {
  double sum = 0.0;
  for (const double c : eigenvalues) sum += c / (1.0 + a * c);
  return sum;
}

TEST(LogDetLine, AgreesWithTheDeterminant) {
  Random random(1);
  for (Index d : {1, 2, 3, 12, 40}) {
    for (Index rank : {Index{1}, d}) {
      MatrixXd direction = random_symmetric(d, rank, random);
      const VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<MatrixXd>(direction).eigenvalues();
      LogDetLine line(static_cast<std::size_t>(d));
      const double trace = direction.trace();
      line.set_direction({direction.data(), static_cast<std::size_t>(d * d)});
      EXPECT_NEAR(line.slope_at_zero(), trace, 1e-11 * eigenvalues.cwiseAbs().sum());
      const double reach = 0.9 / eigenvalues.cwiseAbs().maxCoeff();
      for (double a : {-reach, -0.1 * reach, 0.0, 0.3 * reach, reach}) {
        const double truth = (1.0 + a * eigenvalues.array()).log().sum();
        EXPECT_NEAR(line.value(a), truth, 1e-11 * static_cast<double>(d));
      }
    }
  }
}

TEST(LogDetLine, FindsTheMaximiserOrTheEnd) {
  Random random(2);
  int interior = 0, ends = 0;
  for (int repeat = 0; repeat < 300; ++repeat) {
    const Index d = 1 + static_cast<Index>(random.below(8));
    MatrixXd direction = random_symmetric(d, 1 + static_cast<Index>(random.below(3)), random);
    const VectorXd c = Eigen::SelfAdjointEigenSolver<MatrixXd>(direction).eigenvalues();
    LogDetLine line(static_cast<std::size_t>(d));
    line.set_direction({direction.data(), static_cast<std::size_t>(d * d)});
    const double lowest = -random.uniform(), highest = random.uniform();
    const double a = line.maximise(lowest, highest);
    ASSERT_GE(a, lowest);
    ASSERT_LE(a, highest);
    ASSERT_GT((1.0 + a * c.array()).minCoeff(), 0.0);
    const double size = c.cwiseAbs().sum();
    if (a == highest || a == lowest) {
      EXPECT_GE(a * slope(c, a), -1e-9 * size);
      ++ends;
    } else {
      // The slope changes sign within a relative 1e-9 of a.
      EXPECT_GE(slope(c, a - 1e-9 * std::abs(a)), -1e-9 * size);
      EXPECT_LE(slope(c, a + 1e-9 * std::abs(a)), 1e-9 * size);
      ++interior;
    }
  }
  EXPECT_GT(interior, 30);
  EXPECT_GT(ends, 30);
}

TEST(LogDetLine, StaysWhereTheSlopeIsZero) {
  LogDetLine line(2);
  std::vector<double> zero(4, 0.0);
  line.set_direction(zero);
  EXPECT_EQ(line.maximise(-1.0, 1.0), 0.0);
}

MatrixXd information_of(const InformationSet& set, const std::vector<double>& weights) {
  const auto d = static_cast<Index>(set.dimension());
  MatrixXd sum = MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * matrix_of(set, i);
  return sum;
}

double log_det(const MatrixXd& matrix) {
  return 2.0 * Eigen::LLT<MatrixXd>(matrix).matrixLLT().diagonal().array().log().sum();
}

TEST(ExchangeDesign, MovesKeepTheFactorAndRaiseLogDet) {
  const InformationSet set = wishart(5, 30, 2, 3);
  ExchangeDesign design(set);
  ASSERT_TRUE(design.assign(std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 5}));
  EXPECT_NEAR(design.weight(5), 2.0 / 7.0, 1e-15);
  Random random(4);
  for (int move = 0; move < 500; ++move) {
    const double before = design.log_det();
    const std::size_t i = random.below(30);
    switch (random.below(3)) {
      case 0:
        design.exchange(i, design.support()[random.below(design.support().size())]);
        break;
      case 1:
        design.step_to_vertex(i);
        break;
      default:
        ASSERT_TRUE(design.reweigh());
    }
    EXPECT_GE(design.log_det(), before - 1e-13);
    const MatrixXd information = information_of(set, design.weights());
    EXPECT_NEAR(design.log_det(), log_det(information), 1e-11);
    const double w = information.inverse().cwiseProduct(matrix_of(set, i)).sum();
    EXPECT_NEAR(design.sensitivity(i), w, 1e-10 * w);
    std::set<std::size_t> positive;
    for (std::size_t k = 0; k < 30; ++k) {
      if (design.weight(k) > 0.0) positive.insert(k);
    }
    EXPECT_EQ(positive, std::set<std::size_t>(design.support().begin(), design.support().end()));
    EXPECT_NEAR(std::accumulate(design.weights().begin(), design.weights().end(), 0.0), 1.0, 1e-12);
  }
}

TEST(ExchangeDesign, NoStepAlongALineGainsMoreThanTheMove) {
  const InformationSet set = wishart(4, 12, 3, 5);
  Random random(6);
  for (std::size_t to = 0; to < 12; ++to) {
    ExchangeDesign design(set);
    ASSERT_TRUE(design.assign(std::vector<std::size_t>{1, 4, 7, 10}));
    const std::size_t from = design.support()[random.below(4)];
    const std::vector<double> start = design.weights();
    design.exchange(to, from);
    for (int k = 0; k <= 100 && to != from; ++k) {
      std::vector<double> other = start;
      const double step = -start[to] + (start[from] + start[to]) * k / 100.0;
      other[to] += step;
      other[from] = std::max(0.0, other[from] - step);
      EXPECT_LE(log_det(information_of(set, other)), design.log_det() + 1e-12);
    }
  }
}

TEST(ExchangeDesign, RefusesSingularSupport) {
  const InformationSet set = wishart(4, 12, 1, 5);
  ExchangeDesign design(set);
  EXPECT_FALSE(design.assign(std::vector<std::size_t>{0, 1, 2}));
  EXPECT_TRUE(design.assign(std::vector<std::size_t>{0, 1, 2, 3}));
}

TEST(StartDesign, IsRegularWithAtMostDimensionCandidates) {
  for (Index d : {1, 3, 12, 40}) {
    for (Index rank : {Index{1}, (d + 1) / 2, d}) {
      const auto count = static_cast<std::size_t>(d) + 30;
      const InformationSet once = wishart(d, count, rank, 7);
      const InformationSet set = concatenated(once, once);  // ties
      const SolveOptions options;
      Tracer tracer(set, options, nullptr);
      const ConditionedSet conditioned(set, 1e-9, tracer);
      const std::vector<std::size_t> choices = start_design(conditioned, tracer);
      EXPECT_EQ(choices.size(), static_cast<std::size_t>(d));
      ExchangeDesign design(conditioned.set());
      EXPECT_TRUE(design.assign(choices));
    }
  }
}

TEST(ConditionedSet, WhitensOnlyWhatNeedsItAndKeepsTheProblem) {
  const InformationSet good = wishart(6, 50, 3, 8);
  const SolveOptions options;
  Tracer tracer(good, options, nullptr);
  EXPECT_FALSE(ConditionedSet(good, 1e-9, tracer).whitened());

  // A reparametrisation of condition 1e5, askew: the information matrices have 1e10.
  Random random(9);
  const MatrixXd q = gaussian(6, 6, random).householderQr().householderQ();
  VectorXd scale(6);
  for (Index k = 0; k < 6; ++k) scale(k) = std::pow(10.0, -static_cast<double>(k));
  const InformationSet bad = transformed(good, q * scale.asDiagonal() * q.transpose());
  Tracer bad_tracer(bad, options, nullptr);
  const ConditionedSet conditioned(bad, 1e-9, bad_tracer);
  ASSERT_TRUE(conditioned.whitened());
  MatrixXd uniform(6, 6);
  unpack(conditioned.uniform_information().data(), 6, uniform.data());
  EXPECT_LT((uniform - MatrixXd::Identity(6, 6)).norm(), 1e-10);
  // The same sensitivities as the checker finds, in extended precision, on the set as given.
  const std::vector<double> weights(50, 0.02);
  const Certificate proof = certify(bad, {weights});
  EXPECT_NEAR(duality_gap(conditioned.set(), weights), proof.duality_gap,
              1e-12 + proof.rounding_bound);
}

TEST(ConditionedSet, RefusesWhatIsNoProblem) {
  const SolveOptions options;
  std::vector<MatrixXd> all = matrices_of(wishart(3, 9, 3, 10));
  all[5](2, 0) = all[5](0, 2) = std::numeric_limits<double>::quiet_NaN();
  const InformationSet poisoned = from_matrices(all);
  Tracer tracer(poisoned, options, nullptr);
  EXPECT_THROW(ConditionedSet(poisoned, 1e-9, tracer), InputError);
  const InformationSet singular = wishart(5, 4, 1, 11);
  Tracer singular_tracer(singular, options, nullptr);
  EXPECT_THROW(ConditionedSet(singular, 1e-9, singular_tracer), InputError);
}

TEST(InverseCholesky, InvertsWhateverTheUnits) {
  Random random(12);
  for (Index d : {1, 2, 12, 40}) {
    const MatrixXd g = gaussian(d, 2 * d, random);
    VectorXd scale(d);
    for (double& s : scale) s = std::pow(10.0, 6.0 * random.uniform(-1.0, 1.0));
    const MatrixXd matrix = scale.asDiagonal() * (g * g.transpose()) * scale.asDiagonal();
    const InformationSet set = from_matrices({matrix});
    InverseCholesky factor(static_cast<std::size_t>(d));
    ASSERT_TRUE(factor.factor(set.information(0)));
    MatrixXd x = MatrixXd::Zero(d, d);
    for (Index i = 0, k = 0; i < d; ++i) {
      for (Index j = 0; j <= i; ++j, ++k) {
        x(i, j) = factor.inverse_factor()[static_cast<std::size_t>(k)];
      }
    }
    EXPECT_LT((x * matrix * x.transpose() - MatrixXd::Identity(d, d)).norm(), 1e-9);
    double trace = 0.0;
    for (std::size_t k = 0; k < set.packed_size(); ++k) {
      trace += factor.trace_dual()[k] * set.information(0)[k];
    }
    EXPECT_NEAR(trace, static_cast<double>(d), 1e-9);
  }
}

TEST(ReweighPass, EqualsPricingSteppingAndSumming) {
  for (std::size_t count : {1UL, 3UL, 17UL, 5000UL}) {
    const InformationSet set = wishart(4, count, 4, 13);
    const std::size_t p = set.packed_size();
    Random random(14);
    std::vector<double> weights(count);
    double total = 0.0;
    for (double& weight : weights) total += weight = random.uniform(0.1, 1.0);
    for (double& weight : weights) weight /= total;
    std::vector<double> information(p);
    information_matrix(set, weights, information);
    InverseCholesky factor(4);
    ASSERT_TRUE(factor.factor(information));

    std::vector<double> w(count), fused_w(count), fused = weights, sum(p), fused_sum(p);
    sensitivities(set, factor.trace_dual(), w);
    for (std::size_t i = 0; i < count; ++i) weights[i] *= w[i] / 4.0;
    information_matrix(set, weights, sum);
    ReweighPass(4, 1).run(set.data(), factor.trace_dual(), fused, fused_w, fused_sum);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_NEAR(fused_w[i], w[i], 1e-13 * w[i]);
      EXPECT_NEAR(fused[i], weights[i], 1e-13 * weights[i]);
    }
    const double size = sum[0] + sum[2] + sum[5] + sum[9];
    for (std::size_t k = 0; k < p; ++k) EXPECT_NEAR(fused_sum[k], sum[k], 1e-12 * size);
    EXPECT_NEAR(std::accumulate(fused.begin(), fused.end(), 0.0), 1.0, 1e-12);
  }
}

TEST(ReweighPass, DoesNotDependOnTheThreadCount) {
  const InformationSet set = wishart(3, 7000, 3, 15);
  std::vector<double> first(7000, 1.0 / 7000), second = first, w(7000), sum(6), other(6);
  InverseCholesky factor(3);
  ASSERT_TRUE(factor.factor(set.information(0)));
  ReweighPass(3, 1).run(set.data(), factor.trace_dual(), first, w, sum);
  ReweighPass(3, 3).run(set.data(), factor.trace_dual(), second, w, other);
  EXPECT_EQ(first, second);
  EXPECT_EQ(sum, other);
}

TEST(ReweighPass, WeightsStopShortOfDenormalNumbers) {
  const InformationSet set = wishart(3, 10, 3, 16);
  std::vector<double> weights(10, 0.0), w(10), sum(6);
  weights[2] = 1.0;
  InverseCholesky factor(3);
  ASSERT_TRUE(factor.factor(set.information(2)));
  ReweighPass(3, 1).run(set.data(), factor.trace_dual(), weights, w, sum);
  EXPECT_EQ(weights[0], kSmallestWeight);
  EXPECT_NEAR(weights[2], 1.0, 1e-12);
}

}  // namespace
}  // namespace graybox
