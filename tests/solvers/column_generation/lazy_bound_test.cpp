// The bound by which column generation certifies without reading all candidates again.
#include "solvers/column_generation/lazy_bound.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/column_generation/priced_set.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_definite(Eigen::Index d, Random& random) {
  const MatrixXd g = gaussian(d, d + 1, random);
  return g * g.transpose();
}

std::vector<double> packed(const MatrixXd& matrix) {
  std::vector<double> result(packed_size(static_cast<std::size_t>(matrix.rows())));
  pack(matrix.data(), static_cast<std::size_t>(matrix.rows()), result.data());
  return result;
}

double ratio(const MatrixXd& first, const MatrixXd& second) {
  const auto d = static_cast<std::size_t>(first.rows());
  InverseCholesky inverse(d);
  EXPECT_TRUE(inverse.factor(packed(second)));
  return largest_ratio(packed(first), inverse.inverse_factor(), d);
}

TEST(LazyBound, TheLemmaHoldsAndIsSharp) {
  Random random(3);
  for (Eigen::Index d = 1; d <= 7; ++d) {
    const MatrixXd first = random_definite(d, random), second = random_definite(d, random);
    const double kappa = ratio(first, second);
    double largest = 0.0;
    for (int k = 0; k < 300; ++k) {
      const MatrixXd g = gaussian(d, 1 + k % d, random);
      const MatrixXd h = g * g.transpose();
      const double before = first.llt().solve(h).trace(), after = second.llt().solve(h).trace();
      EXPECT_LE(after, kappa * before * (1.0 + 1e-10));
      largest = std::max(largest, after / before);
    }
    // Sharp: H = x x^T for x = L_2 v.
    const Eigen::LLT<MatrixXd> l(second);
    const MatrixXd whitened = l.matrixL().solve(l.matrixL().solve(first).transpose().eval());
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(whitened);
    const VectorXd x = l.matrixL() * eigen.eigenvectors().col(d - 1);
    const MatrixXd h = x * x.transpose();
    EXPECT_NEAR(second.llt().solve(h).trace() / first.llt().solve(h).trace(), kappa, 1e-9 * kappa);
    EXPECT_LE(largest, kappa * (1.0 + 1e-10));
  }
}

// A working set with random weights on some candidates.
WorkingSet random_design(const InformationSet& set, Random& random) {
  WorkingSet design(set.dimension());
  for (int k = 0; k < 30; ++k) {
    const std::size_t i = random.below(set.candidate_count());
    design.add(i, set.information(i).data(), 0.1 + random.uniform());
  }
  EXPECT_TRUE(design.refresh());
  return design;
}

std::vector<double> sensitivities_of(const InformationSet& set, const WorkingSet& design) {
  Random random(1);
  PricedSet priced(set, 1, random);
  priced.price(design);
  const auto all = priced.all().sensitivities();
  return {all.begin(), all.end()};
}

// Brute force: no candidate above the level is left out, whichever pass it was.
TEST(PricedSet, LeavesOutNoCandidateAboveTheLevel) {
  Random random(5);
  std::size_t left_out = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const InformationSet set = wishart(4, 5000, 1, seed);
    PricedSet priced(set, 1, random);
    const WorkingSet base = random_design(set, random), later = random_design(set, random);
    priced.price(base);
    const std::vector<double> truth = sensitivities_of(set, later);
    std::vector<double> sorted = truth;
    std::ranges::sort(sorted);
    for (const double level : {sorted[4999], sorted[4990], sorted[4500]}) {
      const auto open = priced.open(later, level);
      if (!open) continue;
      left_out += set.candidate_count() - open->count;
      std::vector<char> is_open(set.candidate_count(), 0);
      for (const std::size_t i : open->indices) is_open[i] = 1;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        EXPECT_TRUE(is_open[i] != 0 || truth[i] <= level) << i;
      }
    }
  }
  EXPECT_GT(left_out, 10000U);
}

TEST(PricedSet, EachStageHasItsOwnBound) {
  Random random(7);
  const InformationSet set = wishart(2, 300000, 1, 3);
  PricedSet priced(set, 2, random);
  ASSERT_GE(priced.stages(), 4U);
  const WorkingSet later = random_design(set, random);
  std::size_t read = 0;
  for (std::size_t stage = 0; stage < priced.stages(); ++stage) {
    EXPECT_FALSE(priced.open(later, 2.0).has_value());  // the pass has not come to its end
    read += priced.price_stage(stage, random_design(set, random));
  }
  EXPECT_EQ(read, set.candidate_count());
  const std::vector<double> truth = sensitivities_of(set, later);
  const double level = 0.8 * *std::ranges::max_element(truth);
  const auto open = priced.open(later, level);
  ASSERT_TRUE(open.has_value());
  EXPECT_LT(open->count, set.candidate_count() / 2);
  std::vector<char> is_open(set.candidate_count(), 0);
  for (const std::size_t i : open->indices) is_open[i] = 1;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_TRUE(is_open[i] != 0 || truth[i] <= level) << i;
  }
}

TEST(StagedOrder, ReadsEachCandidateOnceAndDoubles) {
  Random random(9);
  for (const std::size_t count : {std::size_t{1}, std::size_t{7}, std::size_t{65536},
                                  std::size_t{300001}, std::size_t{3000000}}) {
    const StagedOrder order(count, random);
    std::vector<char> seen(count, 0);
    std::size_t before = 0;
    for (std::size_t stage = 0; stage < order.stages(); ++stage) {
      std::size_t size = 0;
      for (std::size_t k = 0; k < order.runs(stage); ++k) {
        const CandidateRun run = order.run(stage, k);
        for (std::size_t i = run.from; i < run.to; ++i) seen[i] = static_cast<char>(seen[i] + 1);
        size += run.to - run.from;
      }
      const double expected = stage == 0 ? 35000.0 : static_cast<double>(before);
      EXPECT_NEAR(static_cast<double>(size), expected, stage == 0 ? 35000.0 : 1000.0);
      before += size;
    }
    EXPECT_TRUE(std::ranges::all_of(seen, [](char c) { return c == 1; })) << count;
    std::vector<std::size_t> runs(order.stages(), 0);
    for (std::size_t r = 0; r < order.run_count(); ++r) ++runs[order.stage_of_run(r)];
    for (std::size_t stage = 0; stage < order.stages(); ++stage) {
      EXPECT_EQ(runs[stage], order.runs(stage)) << count;
    }
  }
}

TEST(LazyCertification, LargeSetsAreSolvedInLessThanTwoPasses) {
  const InformationSet set = wishart(3, 300000, 1, 4);
  const SolveOptions options{.duality_gap = 1e-9};
  const Solution one = ColumnGeneration().solve(set, options);
  ASSERT_EQ(one.status, SolveStatus::kSolved) << one.message;
  EXPECT_TRUE(proves(certify(set, one.design, {}, 1e-9), 1e-9));
  EXPECT_LT(one.counters.passes, 1.5);
  const Solution two = ColumnGeneration().solve(set, {.duality_gap = 1e-9, .threads = 2});
  EXPECT_EQ(one.design.weights, two.design.weights);
  EXPECT_EQ(one.counters.passes, two.counters.passes);
}

}  // namespace
}  // namespace graybox
