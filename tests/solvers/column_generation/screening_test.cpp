// The deletion rules against brute force: random sets solved to tight optimality by an independent
// reference (pair exchanges with a line search by generalised eigenvalues), random designs at many
// gaps, and no candidate that an optimum may use is ever deleted.
#include "solvers/column_generation/screening.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Index = Eigen::Index;

std::vector<Matrix> random_matrices(Index d, std::size_t count, Index rank, double spread,
                                    Random& random) {
  std::vector<Matrix> all;
  for (std::size_t i = 0; i < count; ++i) {
    Matrix g(d, rank);
    for (double& x : g.reshaped()) x = random.normal();
    const double scale = std::exp(spread * random.normal());
    all.push_back(scale * g * g.transpose());
  }
  return all;
}

Matrix weighted_sum(const std::vector<Matrix>& all, const Vector& weights) {
  Matrix sum = Matrix::Zero(all[0].rows(), all[0].cols());
  for (std::size_t i = 0; i < all.size(); ++i) sum += weights(static_cast<Index>(i)) * all[i];
  return sum;
}

Vector sensitivities(const std::vector<Matrix>& all, const Matrix& information) {
  const Eigen::LLT<Matrix> factor(information);
  Vector w(static_cast<Index>(all.size()));
  for (std::size_t i = 0; i < all.size(); ++i) {
    w(static_cast<Index>(i)) = factor.solve(all[i]).trace();
  }
  return w;
}

// The step t in [0, longest] that maximises sum_k log(1 + t e_k), by bisection on the slope.
double exact_step(const Vector& eigenvalues, double longest) {
  const auto slope = [&](double t) {
    double sum = 0.0;
    for (const double e : eigenvalues) {
      if (1.0 + t * e <= 0.0) return -1.0;
      sum += e / (1.0 + t * e);
    }
    return sum;
  };
  if (slope(longest) >= 0.0) return longest;
  double low = 0.0, high = longest;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (slope(middle) > 0.0 ? low : high) = middle;
  }
  return low;
}

// Optimal weights to a duality gap of 1e-12 or as near as double precision allows.
Vector reference_optimum(const std::vector<Matrix>& all) {
  const auto count = static_cast<Index>(all.size());
  const auto d = static_cast<double>(all[0].rows());
  Vector weights = Vector::Constant(count, 1.0 / static_cast<double>(count));
  for (int iteration = 0; iteration < 4000; ++iteration) {
    const Matrix information = weighted_sum(all, weights);
    const Vector w = sensitivities(all, information);
    Index best = 0, worst = -1;
    if (w.maxCoeff(&best) / d - 1.0 < 1e-12) break;
    for (Index i = 0; i < count; ++i) {
      if (weights(i) > 0.0 && (worst < 0 || w(i) < w(worst))) worst = i;
    }
    const Matrix direction =
        all[static_cast<std::size_t>(best)] - all[static_cast<std::size_t>(worst)];
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix> eigen(direction, information,
                                                                 Eigen::EigenvaluesOnly);
    const double step = exact_step(eigen.eigenvalues(), weights(worst));
    weights(best) += step;
    weights(worst) -= step;
    if (iteration % 4 == 3) {  // a multiplicative step moves all weights together
      weights = weights.cwiseProduct(sensitivities(all, weighted_sum(all, weights))) / d;
      weights /= weights.sum();
    }
  }
  return weights;
}

// L^-1, packed lower triangle.
std::vector<double> inverse_factor(const Matrix& information) {
  const Index d = information.rows();
  const Eigen::LLT<Matrix> factor(information);
  const Matrix inverse = factor.matrixL().solve(Matrix::Identity(d, d));
  std::vector<double> rows;
  for (Index i = 0; i < d; ++i) {
    for (Index j = 0; j <= i; ++j) rows.push_back(inverse(i, j));
  }
  return rows;
}

double squared_norm(const Matrix& h, const std::vector<double>& inverse) {
  const auto d = static_cast<std::size_t>(h.rows());
  std::vector<double> packed(packed_size(d)), scratch(2 * d * d);
  pack(h.data(), d, packed.data());
  return squared_whitened_norm(packed.data(), inverse, d, scratch);
}

struct Tally {
  std::size_t candidates = 0;
  std::size_t trace_rule = 0;  // deleted by Harman-Pronzato
  std::size_t both_rules = 0;  // deleted by either
};

// Applies both rules at `weights` and checks every deletion against the optimum's sensitivities.
void check_deletions(const std::vector<Matrix>& all, const Vector& weights, const Vector& optimal,
                     Tally& tally) {
  const auto d = static_cast<std::size_t>(all[0].rows());
  const Matrix information = weighted_sum(all, weights);
  const Vector w = sensitivities(all, information);
  const std::vector<double> inverse = inverse_factor(information);
  const double threshold = harman_pronzato_threshold(w.maxCoeff(), d);
  const FrobeniusRule rule(w.maxCoeff(), d);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto k = static_cast<Index>(i);
    const double norm = squared_norm(all[i], inverse);
    const bool by_trace = w(k) < threshold;
    const bool by_norm = rule.deletable(w(k), norm);
    // The bound of the Frobenius rule holds for every candidate, not only where it deletes.
    EXPECT_GE(rule.bound(w(k), norm), optimal(k) * (1.0 - 1e-6));
    if (by_trace || by_norm) {
      EXPECT_LT(optimal(k), static_cast<double>(d) * (1.0 - 1e-7)) << "candidate " << i;
    }
    ++tally.candidates;
    tally.trace_rule += by_trace ? 1U : 0U;
    tally.both_rules += by_trace || by_norm ? 1U : 0U;
  }
}

TEST(Screening, NoSupportPointIsEverDeleted) {
  Random random(11);
  Tally near;
  int sets = 0;
  for (Index d = 1; d <= 6; ++d) {
    for (Index rank = 1; rank <= d; ++rank) {
      for (int repeat = 0; repeat < 24; ++repeat, ++sets) {
        const std::size_t count = 10 + random.below(30);
        const double spread = random.below(2) == 0 ? 0.0 : 0.5;
        std::vector<Matrix> all = random_matrices(d, count, rank, spread, random);
        all.push_back(all[random.below(count)]);  // a duplicate
        const Vector best = reference_optimum(all);
        const Vector optimal = sensitivities(all, weighted_sum(all, best));
        ASSERT_LT(optimal.maxCoeff() / static_cast<double>(d) - 1.0, 1e-10);
        for (double blend : {1.0, 0.3, 0.1, 1e-2, 1e-3, 1e-5, 0.0}) {
          Vector other(best.size());
          for (double& x : other) x = -std::log(1.0 - random.uniform());
          const Vector mixed = (1.0 - blend) * best + blend * other / other.sum();
          Tally tally;
          check_deletions(all, mixed, optimal, tally);
          if (blend == 1e-5) {
            near.candidates += tally.candidates;
            near.trace_rule += tally.trace_rule;
            near.both_rules += tally.both_rules;
          }
        }
      }
    }
  }
  EXPECT_GE(sets, 200);
  // At small gaps most candidates go, and more with both rules than with one.
  EXPECT_GT(near.trace_rule, near.candidates / 2);
  EXPECT_GT(near.both_rules, near.trace_rule);
}

TEST(Screening, TheFrobeniusRuleDeletesMoreOfMatricesOfFullRank) {
  Random random(3);
  const std::vector<Matrix> all = random_matrices(10, 200, 10, 0.0, random);
  const Vector best = reference_optimum(all);
  const Vector optimal = sensitivities(all, weighted_sum(all, best));
  const Vector uniform = Vector::Constant(best.size(), 1.0 / static_cast<double>(best.size()));
  Tally tally;
  check_deletions(all, 0.95 * best + 0.05 * uniform, optimal, tally);
  EXPECT_GT(tally.both_rules, 2 * tally.trace_rule);
  EXPECT_GT(tally.both_rules, tally.candidates / 2);
}

// The bound (4) is attained: eigenvalues mu, and d - 1 equal ones, meet (1) and (2) with equality.
TEST(Screening, TheThresholdIsTheSharpBoundOnEigenvalues) {
  for (std::size_t dimension : {2UL, 3UL, 12UL, 40UL}) {
    const double d = static_cast<double>(dimension);
    for (double excess : {1e-6, 1e-2, 1.0, 30.0}) {
      const double mu = d / harman_pronzato_threshold(d + excess, dimension, 0.0);
      const double others = (d - mu) / (d - 1.0);
      EXPECT_GT(others, 0.0);
      EXPECT_NEAR(1.0 / mu + (d - 1.0) / others, d + excess, 1e-8 * (d + excess));
    }
  }
}

TEST(Screening, ThresholdAtTheEndsOfItsRange) {
  EXPECT_NEAR(harman_pronzato_threshold(1.0, 1), 1.0, 1e-8);
  EXPECT_LT(harman_pronzato_threshold(5.0, 1), 1.0);
  EXPECT_GT(harman_pronzato_threshold(5.0, 1), 1.0 - 1e-8);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(harman_pronzato_threshold(infinity, 3), 0.0);
  EXPECT_FALSE(FrobeniusRule(infinity, 3).deletable(0.0, 0.0));
  // Rounding may bring max w below d; all candidates with w = d must stay.
  EXPECT_LT(harman_pronzato_threshold(12.0 - 1e-12, 12), 12.0 - 1e-9);
  EXPECT_FALSE(FrobeniusRule(12.0 - 1e-12, 12).deletable(12.0 - 1e-12, 12.0));
}

TEST(Screening, TheNormIsThatOfTheWhitenedMatrix) {
  Random random(8);
  for (Index d : {1, 2, 7, 12}) {
    const std::vector<Matrix> all = random_matrices(d, 5, d, 1.0, random);
    const Matrix information = all[0] + all[1];
    const Matrix inverse = information.inverse();
    for (const Matrix& h : all) {
      const double truth = (inverse * h * inverse * h).trace();
      EXPECT_NEAR(squared_norm(h, inverse_factor(information)), truth, 1e-8 * truth);
    }
  }
}

}  // namespace
}  // namespace graybox
