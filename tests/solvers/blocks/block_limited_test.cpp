#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/blocks/block_limited_column_generation.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using testing_sets::matrix_of;

// Labels that are not consecutive; every block has a candidate.
CandidateBlocks random_blocks(std::size_t candidates, std::size_t count, Random& random) {
  CandidateBlocks blocks{count, std::vector<std::uint32_t>(candidates)};
  for (std::size_t i = 0; i < candidates; ++i) {
    blocks.label[i] = static_cast<std::uint32_t>(i < count ? i : random.below(count));
  }
  return blocks;
}

double log_det(const InformationSet& set, const std::vector<double>& weights) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  MatrixXd sum = MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * matrix_of(set, i);
  return std::log(sum.determinant());
}

// A vertex of the feasible set that maximises sum w_i lambda_i, found one block at a time, without
// sorting: the independent form of the greedy rule.
std::vector<double> best_vertex(const CandidateBlocks& blocks, double limit,
                                const std::vector<double>& w) {
  std::vector<double> lambda(w.size(), 0.0);
  std::vector<bool> used(blocks.count, false);
  double left = 1.0;
  while (left > 1e-15) {
    std::size_t best = w.size();
    for (std::size_t i = 0; i < w.size(); ++i) {
      if (!used[blocks.label[i]] && (best == w.size() || w[i] > w[best])) best = i;
    }
    if (best == w.size()) break;
    used[blocks.label[best]] = true;
    lambda[best] = std::min(limit, left);
    left -= lambda[best];
  }
  return lambda;
}

std::vector<double> random_feasible(const CandidateBlocks& blocks, double limit, Random& random) {
  std::vector<double> mean(blocks.label.size(), 0.0);
  for (int k = 0; k < 4; ++k) {
    std::vector<double> w(mean.size());
    for (double& x : w) x = random.uniform();
    const std::vector<double> vertex = best_vertex(blocks, limit, w);
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += 0.25 * vertex[i];
  }
  return mean;
}

struct Bounded {
  double log_det = 0.0;
  double excess = 0.0;  // the optimum is at most log_det + excess
};

// Frank and Wolfe with a fine line search.
Bounded frank_wolfe(const InformationSet& set, const CandidateBlocks& blocks, double limit,
                    int steps) {
  const std::size_t count = set.candidate_count();
  Random random(5);
  std::vector<double> lambda(count, 0.0);
  for (int k = 0; k < 50; ++k) {
    const std::vector<double> start = random_feasible(blocks, limit, random);
    for (std::size_t i = 0; i < count; ++i) lambda[i] += start[i] / 50.0;
  }
  Bounded result;
  for (int step = 0; step < steps; ++step) {
    MatrixXd sum = MatrixXd::Zero(static_cast<Eigen::Index>(set.dimension()),
                                  static_cast<Eigen::Index>(set.dimension()));
    for (std::size_t i = 0; i < count; ++i) sum += lambda[i] * matrix_of(set, i);
    const MatrixXd inverse = sum.inverse();
    std::vector<double> w(count);
    for (std::size_t i = 0; i < count; ++i) w[i] = (inverse * matrix_of(set, i)).trace();
    const std::vector<double> vertex = best_vertex(blocks, limit, w);
    double slope = -static_cast<double>(set.dimension());
    for (std::size_t i = 0; i < count; ++i) slope += w[i] * vertex[i];
    result = {std::log(sum.determinant()), slope};
    if (slope < 1e-5) break;
    double best = 0.0, best_value = result.log_det;
    for (double t = 0.5; t > 1e-6; t *= 0.7) {
      std::vector<double> trial(count);
      for (std::size_t i = 0; i < count; ++i) trial[i] = lambda[i] + t * (vertex[i] - lambda[i]);
      const double value = log_det(set, trial);
      if (value > best_value) {
        best = t;
        best_value = value;
      }
    }
    if (best == 0.0) break;
    for (std::size_t i = 0; i < count; ++i) lambda[i] += best * (vertex[i] - lambda[i]);
  }
  return result;
}

Certificate solve_and_certify(const InformationSet& set, const CandidateBlocks& blocks,
                              double limit, double gap) {
  const Solution solution = solve_block_limited(set, blocks, limit, {.duality_gap = gap});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message << ", limit " << limit;
  const Certificate certificate = certify_block_limited(set, solution.design, blocks, limit);
  EXPECT_EQ(certificate.status, CertificateStatus::kCertified) << certificate.message;
  EXPECT_LE(certificate.duality_gap, gap + certificate.rounding_bound) << "limit " << limit;
  for (const double share : block_shares(blocks, solution.design.weights)) {
    EXPECT_LE(share, limit + 1e-12);
  }
  return certificate;
}

TEST(BlockLimitedMean, IsAttainedAndNeverExceeded) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const std::size_t count = 3 + random.below(8);
    const CandidateBlocks blocks = random_blocks(count + random.below(20), count, random);
    const double limit = random.uniform(1.05 / static_cast<double>(count), 1.2);
    std::vector<double> w(blocks.label.size());
    for (double& x : w) x = random.uniform();
    std::vector<double> maxima(count, 0.0);
    for (std::size_t i = 0; i < w.size(); ++i) {
      maxima[blocks.label[i]] = std::max(maxima[blocks.label[i]], w[i]);
    }
    const double mean = largest_limited_mean(std::span(maxima), limit);
    const std::vector<double> vertex = best_vertex(blocks, limit, w);
    EXPECT_NEAR(std::inner_product(w.begin(), w.end(), vertex.begin(), 0.0), mean, 1e-14);
    for (int k = 0; k < 10; ++k) {
      const std::vector<double> other = random_feasible(blocks, limit, random);
      EXPECT_LE(std::inner_product(w.begin(), w.end(), other.begin(), 0.0), mean + 1e-14);
    }
  }
}

// The bound holds for designs that are far from optimal, not only at the optimum.
TEST(BlockLimitedCertificate, BoundsTheDistanceToTheOptimum) {
  Random random(2);
  for (int trial = 0; trial < 30; ++trial) {
    const InformationSet set =
        testing_sets::wishart(3, 30, 3, static_cast<std::uint64_t>(trial) + 1, 1.0);
    const CandidateBlocks blocks = random_blocks(30, 8, random);
    const double limit = random.uniform(0.15, 0.5);
    const double optimum = solve_and_certify(set, blocks, limit, 1e-8).log_det;
    const Certificate certificate =
        certify_block_limited(set, {random_feasible(blocks, limit, random)}, blocks, limit);
    ASSERT_EQ(certificate.status, CertificateStatus::kCertified) << certificate.message;
    EXPECT_LE(certificate.log_det, optimum + 3e-8);
    EXPECT_GE(certificate.log_det + certificate.log_det_gap, optimum);
    EXPECT_GE(certificate.duality_gap, -1e-12);
  }
}

TEST(BlockLimitedCertificate, RefusesDesignsBeyondTheLimit) {
  const InformationSet set = testing_sets::wishart(2, 6, 2, 1);
  const CandidateBlocks blocks = equal_blocks(6, 2);
  const Design even{std::vector<double>(6, 1.0 / 6.0)};
  EXPECT_EQ(certify_block_limited(set, even, blocks, 0.4).status, CertificateStatus::kCertified);
  const Design heavy{{0.3, 0.2, 0.2, 0.1, 0.1, 0.1}};
  const Certificate certificate = certify_block_limited(set, heavy, blocks, 0.4);
  EXPECT_EQ(certificate.status, CertificateStatus::kNotADesign);
  EXPECT_NE(certificate.message.find("block 0"), std::string::npos);
}

TEST(BlockLimitedCertificate, WithALimitOfOneIsTheOrdinaryOne) {
  const InformationSet set = testing_sets::wishart(4, 40, 2, 3);
  const Design even{std::vector<double>(40, 1.0 / 40.0)};
  const Certificate limited = certify_block_limited(set, even, equal_blocks(40, 5), 1.0);
  const Certificate ordinary = certify(set, even);
  EXPECT_DOUBLE_EQ(limited.duality_gap, ordinary.duality_gap);
  EXPECT_EQ(limited.log_det, ordinary.log_det);
  EXPECT_EQ(limited.worst_candidate, ordinary.worst_candidate);
}

// diag(1, 0), diag(0, 1) and a poor third experiment, which the limit 0.4 forces in: M = 0.45 I.
TEST(BlockLimited, ClosedForm) {
  MatrixXd first = MatrixXd::Zero(2, 2), second = first;
  first(0, 0) = second(1, 1) = 1.0;
  const MatrixXd poor = 0.25 * MatrixXd::Identity(2, 2);
  const InformationSet set = testing_sets::from_matrices({first, second, poor});
  EXPECT_NEAR(solve_and_certify(set, equal_blocks(3, 1), 0.4, 1e-9).log_det, 2 * std::log(0.45),
              1e-8);
  EXPECT_NEAR(solve_and_certify(set, equal_blocks(3, 1), 0.6, 1e-9).log_det, 2 * std::log(0.5),
              1e-8);
}

// All designs on a grid of weights, three blocks of two candidates.
TEST(BlockLimited, AgreesWithBruteForce) {
  constexpr int kGrid = 20;
  const CandidateBlocks blocks = equal_blocks(6, 2);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const InformationSet set = testing_sets::wishart(2, 6, 1, seed);
    for (const double limit : {0.35, 0.5, 0.8}) {
      double best = -1e300;
      std::vector<int> n(6);
      const auto visit = [&](const auto& self, std::size_t k, int left) -> void {
        if (k == 5) {
          n[5] = left;
          std::vector<double> weights(6);
          for (std::size_t i = 0; i < 6; ++i) weights[i] = n[i] / static_cast<double>(kGrid);
          const auto shares = block_shares(blocks, weights);
          if (*std::ranges::max_element(shares) > limit + 1e-12) return;
          const double value = log_det(set, weights);
          if (std::isfinite(value)) best = std::max(best, value);
          return;
        }
        for (n[k] = 0; n[k] <= left; ++n[k]) self(self, k + 1, left - n[k]);
      };
      visit(visit, 0, kGrid);
      const Certificate certificate = solve_and_certify(set, blocks, limit, 1e-8);
      EXPECT_GE(certificate.log_det + certificate.log_det_gap, best);
      EXPECT_LE(certificate.log_det, best + 0.05);  // the grid's own coarseness
    }
  }
}

TEST(BlockLimited, AgreesWithFrankAndWolfeWithinBothBounds) {
  Random random(9);
  for (const Eigen::Index rank : {1, 2, 3}) {
    const InformationSet set =
        testing_sets::wishart(3, 24, rank, static_cast<std::uint64_t>(rank), 1.0);
    const CandidateBlocks blocks = random_blocks(24, 7, random);
    for (const double limit : {0.16, 0.25, 0.5}) {
      const Certificate certificate = solve_and_certify(set, blocks, limit, 1e-8);
      const Bounded other = frank_wolfe(set, blocks, limit, 400);
      EXPECT_GE(certificate.log_det + certificate.log_det_gap, other.log_det - 1e-12);
      EXPECT_LE(certificate.log_det, other.log_det + other.excess + 1e-12);
      EXPECT_LT(other.excess, 0.05);
    }
  }
}

TEST(BlockLimited, ReachesTheGapOnManySets) {
  Random random(11);
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const Eigen::Index d = 2 + static_cast<Eigen::Index>(random.below(5));
    const Eigen::Index rank =
        1 + static_cast<Eigen::Index>(random.below(static_cast<std::uint64_t>(d)));
    const std::size_t count = 50 + random.below(500);
    const InformationSet set = testing_sets::wishart(d, count, rank, seed, 2.0);
    const std::size_t block_count = 5 + random.below(40);
    const CandidateBlocks blocks = random_blocks(count, block_count, random);
    const double least = 1.0 / static_cast<double>(block_count);
    const double limit = least * std::pow(1.0 / least, random.uniform(0.02, 1.0));
    (void)solve_and_certify(set, blocks, limit, 1e-8);
  }
}

TEST(BlockLimited, LimitsThatDivideOneAreFilledExactly) {
  // Four blocks that carry nearly all information and a limit of 1/4: all four are full.
  std::vector<MatrixXd> all;
  for (const MatrixXd& h : testing_sets::matrices_of(testing_sets::wishart(3, 40, 3, 21))) {
    all.push_back(all.size() < 4 ? 1e4 * h : h);
  }
  CandidateBlocks blocks{10, std::vector<std::uint32_t>(40)};
  for (std::size_t i = 0; i < 40; ++i) blocks.label[i] = static_cast<std::uint32_t>(i % 10);
  const InformationSet set = testing_sets::from_matrices(all);
  const Solution solution = solve_block_limited(set, blocks, 0.25, {.duality_gap = 1e-8});
  (void)solve_and_certify(set, blocks, 0.25, 1e-8);
  const std::vector<double> shares = block_shares(blocks, solution.design.weights);
  for (std::size_t b = 0; b < 4; ++b) EXPECT_NEAR(shares[b], 0.25, 1e-6);
}

TEST(BlockLimited, WithoutALimitEqualsColumnGeneration) {
  for (const double limit : {1.0, 3.0}) {
    const InformationSet set = testing_sets::wishart(5, 3000, 2, 4, 1.0);
    const double limited = solve_and_certify(set, equal_blocks(3000, 10), limit, 1e-8).log_det;
    const Solution free = ColumnGeneration().solve(set, {.duality_gap = 1e-9});
    EXPECT_NEAR(limited, certify(set, free.design).log_det, 5 * 1.1e-8);
  }
}

// A limit above the largest share of the free optimum changes nothing; below, log det falls.
TEST(BlockLimited, TheOptimumFallsAsTheLimitDoes) {
  const InformationSet set = testing_sets::wishart(4, 400, 2, 8, 1.0);
  const CandidateBlocks blocks = equal_blocks(400, 10);
  const Solution free = ColumnGeneration().solve(set, {.duality_gap = 1e-10});
  const std::vector<double> shares = block_shares(blocks, free.design.weights);
  const double largest = *std::ranges::max_element(shares);
  double last = certify(set, free.design).log_det;
  EXPECT_NEAR(solve_and_certify(set, blocks, 1.01 * largest, 1e-8).log_det, last, 5e-8);
  for (const double factor : {0.8, 0.5, 0.3}) {
    if (factor * largest < 0.03) break;
    const double now = solve_and_certify(set, blocks, factor * largest, 1e-8).log_det;
    EXPECT_LT(now, last - 1e-6);
    last = now;
  }
}

class BlockLimitedInvariance : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(BlockLimitedInvariance, DoesNotDependOnUnitsOrderOrNamesOfBlocks) {
  Random random(GetParam());
  const InformationSet set = testing_sets::wishart(4, 200, 2, GetParam(), 1.0);
  const CandidateBlocks blocks = random_blocks(200, 20, random);
  const double limit = 0.09;
  const double expected = solve_and_certify(set, blocks, limit, 1e-9).log_det;

  MatrixXd t = testing_sets::gaussian(4, 4, random);
  const double shift = 2.0 * std::log(std::abs(t.determinant()));
  EXPECT_NEAR(solve_and_certify(testing_sets::transformed(set, t), blocks, limit, 1e-9).log_det,
              expected + shift, 1e-7);

  std::vector<std::size_t> order(200);
  std::iota(order.rbegin(), order.rend(), std::size_t{0});
  CandidateBlocks renamed = blocks;
  for (std::size_t i = 0; i < 200; ++i) renamed.label[i] = 19 - blocks.label[order[i]];
  EXPECT_NEAR(solve_and_certify(set.subset(order), renamed, limit, 1e-9).log_det, expected, 1e-7);

  const InformationSet twice = testing_sets::concatenated(set, set);  // copies in the same block
  CandidateBlocks doubled = blocks;
  doubled.label.insert(doubled.label.end(), blocks.label.begin(), blocks.label.end());
  EXPECT_NEAR(solve_and_certify(twice, doubled, limit, 1e-9).log_det, expected, 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Seeds, BlockLimitedInvariance, ::testing::Range<std::uint64_t>(6, 16));

TEST(BlockLimited, SameAnswerForEveryThreadCount) {
  const InformationSet set = testing_sets::wishart(3, 40000, 1, 2, 1.0);
  const CandidateBlocks blocks = equal_blocks(40000, 100);
  const Solution one = solve_block_limited(set, blocks, 0.05, {.duality_gap = 1e-7});
  const Solution two = solve_block_limited(set, blocks, 0.05, {.duality_gap = 1e-7, .threads = 3});
  EXPECT_EQ(one.design.weights, two.design.weights);
  EXPECT_EQ(one.status, SolveStatus::kSolved);
}

TEST(BlockLimited, AStoppedRunKeepsAFeasibleDesign) {
  class StopAtOnce : public SolveObserver {
    bool on_progress(const TracePoint&) override { return false; }
  } stop;
  const InformationSet set = testing_sets::wishart(4, 20000, 2, 2, 1.0);
  const CandidateBlocks blocks = equal_blocks(20000, 100);
  const Solution solution = solve_block_limited(set, blocks, 0.05, {.duality_gap = 1e-12}, &stop);
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit);
  EXPECT_EQ(certify_block_limited(set, solution.design, blocks, 0.05).status,
            CertificateStatus::kCertified);
}

TEST(BlockLimited, SaysWhatCannotBeSolved) {
  const InformationSet set = testing_sets::wishart(3, 12, 3, 1);
  const CandidateBlocks blocks = equal_blocks(12, 3);
  for (const double limit : {0.0, -1.0, 0.2, 0.25, std::nan("")}) {
    EXPECT_THROW((void)solve_block_limited(set, blocks, limit, {}), InputError) << limit;
  }
  EXPECT_THROW((void)equal_blocks(12, 5), InputError);
  EXPECT_THROW((void)solve_block_limited(set, equal_blocks(8, 2), 0.5, {}), InputError);
  CandidateBlocks bad = blocks;
  bad.label[4] = 9;
  EXPECT_THROW((void)solve_block_limited(set, bad, 0.5, {}), InputError);
  bad = blocks;
  bad.count = 5;  // the last has no candidate
  EXPECT_THROW((void)solve_block_limited(set, bad, 0.5, {}), InputError);
  EXPECT_THROW((void)solve_block_limited(set, blocks, 0.5, {.duality_gap = 0.0}), InputError);

  const MatrixXd one_direction = MatrixXd::Ones(2, 2);
  const InformationSet singular =
      testing_sets::from_matrices(std::vector<MatrixXd>(6, one_direction));
  EXPECT_THROW((void)solve_block_limited(singular, equal_blocks(6, 2), 0.5, {}), InputError);
}

}  // namespace
}  // namespace graybox
