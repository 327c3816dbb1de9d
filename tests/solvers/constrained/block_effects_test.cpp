// Blocks with effects of their own: closed forms of block designs, the Schur complement written
// out, an independent solver, brute force over all designs, and what is refused.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/information/block_effects.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/constrained/block_sizes.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/constrained_exact/constrained_exact.hpp"
#include "solvers/core/sensitivity.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

using testing::expect_refused;

const JacobianNoise kUnitNoise = JacobianNoise::deviations(std::vector{1.0});

// v treatments, of which the last is the reference: theta_k is what k gives beyond it.
Jacobians treatments(std::size_t v) {
  Jacobians out{.candidates = v, .outputs = 1, .parameters = v - 1};
  out.values.assign(v * (v - 1), 0.0);
  for (std::size_t k = 0; k + 1 < v; ++k) out.values[k * (v - 1) + k] = 1.0;
  return out;
}

Jacobians random_jacobians(std::size_t count, std::size_t r, std::size_t d, Random& random) {
  Jacobians out{.candidates = count, .outputs = r, .parameters = d};
  out.values.resize(count * r * d);
  for (double& x : out.values) x = random.normal();
  return out;
}

// A problem, and log det S by the formula of block_effects.hpp.
struct BlockProblem {
  Jacobians jacobians;
  BlockEffects effects;
  InformationSet set;
  Criterion criterion;
  DesignConstraints constraints;

  BlockProblem(Jacobians of_model, BlockEffects of_blocks, const std::string& sizes)
      : jacobians(of_model),
        effects(of_blocks),
        set(information_set_from_jacobians(
            with_block_effects(std::move(of_model), of_blocks),
            JacobianNoise::deviations(std::vector<double>(jacobians.outputs, 1.0)))) {
    std::vector<std::size_t> interest(jacobians.parameters);
    std::iota(interest.begin(), interest.end(), std::size_t{0});
    criterion = Criterion::ds(interest);
    constraints = number_of_experiments(set, experiments_in_blocks(sizes).value());
    for (LinearConstraint& row : block_size_rows(set, sizes)) {
      constraints.rows.push_back(std::move(row));
    }
  }

  [[nodiscard]] Eigen::MatrixXd block(const std::vector<double>& values, std::size_t i,
                                      std::size_t columns) const {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto r = static_cast<Eigen::Index>(jacobians.outputs);
    const auto n = static_cast<Eigen::Index>(columns);
    return Eigen::Map<const RowMajor>(values.data() + i * jacobians.outputs * columns, r, n);
  }

  [[nodiscard]] double value(const std::vector<double>& efforts) const {
    const auto d = static_cast<Eigen::Index>(jacobians.parameters);
    const auto q = static_cast<Eigen::Index>(effects.effects);
    const std::size_t count = jacobians.candidates;
    Eigen::MatrixXd s = Eigen::MatrixXd::Zero(d, d);
    for (std::size_t b = 0; b < effects.blocks; ++b) {
      Eigen::MatrixXd jj = Eigen::MatrixXd::Zero(d, d), jk = Eigen::MatrixXd::Zero(d, q);
      Eigen::MatrixXd kk = Eigen::MatrixXd::Zero(q, q);
      for (std::size_t i = 0; i < count; ++i) {
        const Eigen::MatrixXd j = block(jacobians.values, i, jacobians.parameters);
        const Eigen::MatrixXd k = block(effects.values, i, effects.effects);
        const double x = efforts[b * count + i];
        jj += x * j.transpose() * j;
        jk += x * j.transpose() * k;
        kk += x * k.transpose() * k;
      }
      if (!(kk.determinant() > 1e-12)) return -std::numeric_limits<double>::infinity();
      s += jj - jk * kk.ldlt().solve(jk.transpose());
    }
    const double determinant = s.determinant();
    return determinant > 1e-12 ? std::log(determinant) : -std::numeric_limits<double>::infinity();
  }

  [[nodiscard]] std::vector<double> solved(double gap) const {
    SolveOptions options;
    options.duality_gap = gap;
    options.criterion = criterion;
    const ConstrainedSolution answer = solve_constrained(set, constraints, options);
    EXPECT_EQ(answer.status, SolveStatus::kSolved) << answer.message;
    const ConstrainedCertificate proof =
        certify_constrained(set, answer.efforts, constraints, criterion, gap);
    EXPECT_TRUE(proves(proof.certificate, gap)) << proof.certificate.duality_gap;
    return answer.efforts;
  }
};

// With shares p of the treatments in a block of n runs, S = n (diag p - p p^T) without the
// reference, whose determinant is n^(v-1) prod p: largest where all p are 1/v.
TEST(BlockEffects, TreatmentsInBlocksInClosedForm) {
  for (const std::size_t v : {2U, 3U, 5U}) {
    for (const char* sizes : {"4,4,4", "2,3", "1,6,2,2"}) {
      SCOPED_TRACE(std::to_string(v) + " treatments in " + sizes);
      const double total = experiments_in_blocks(sizes).value();
      const Jacobians plain = treatments(v);
      const std::string text(sizes);
      const auto blocks = 1 + static_cast<std::size_t>(std::ranges::count(text, ','));
      const BlockProblem problem(plain, common_offset(plain, blocks), sizes);
      const double n = static_cast<double>(v);
      EXPECT_NEAR(problem.value(problem.solved(1e-9)), (n - 1) * std::log(total) - n * std::log(n),
                  1e-8 * n);
    }
  }
}

// A balanced incomplete block design is D-optimal (Kiefer 1958): v treatments, each pair together
// in lambda blocks of k. Its S = (lambda v / k) (I - J / v), without the reference of determinant
// (lambda v / k)^(v-1) / v.
TEST(BlockEffects, BalancedIncompleteBlocksAreFound) {
  struct Balanced {
    std::size_t v, k, lambda;
    const char* sizes;
  };
  for (const Balanced& design : {Balanced{3, 2, 1, "2,2,2"}, Balanced{4, 3, 2, "3,3,3,3"}}) {
    SCOPED_TRACE(design.sizes);
    const Jacobians plain = treatments(design.v);
    const BlockProblem problem(plain, common_offset(plain, design.v), design.sizes);
    const double n = static_cast<double>(design.v);
    const double balanced =
        (n - 1) * std::log(static_cast<double>(design.lambda) * n / static_cast<double>(design.k)) -
        std::log(n);
    const ConstrainedExactSolution answer = solve_constrained_exact(
        problem.set, problem.constraints, {.gap = 0.2, .criterion = problem.criterion});
    ASSERT_FALSE(answer.designs.empty());
    EXPECT_EQ(answer.status, ExactStatus::kOptimal);
    const std::vector<std::int64_t>& counts = answer.designs.front().counts;
    EXPECT_NEAR(problem.value({counts.begin(), counts.end()}), balanced, 1e-9);
  }
}

// The matrix of the set has S as its Schur complement: log det M less those of the blocks'.
TEST(BlockEffects, TheSetHoldsTheModelWithItsBlocks) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Jacobians plain = random_jacobians(6, 2, 3, random);
    BlockEffects effects{.blocks = 3, .effects = 2};
    effects.values.resize(6 * 2 * 2);
    for (double& x : effects.values) x = random.normal();
    const BlockProblem problem(plain, seed % 2 == 0 ? effects : offsets_of_outputs(plain, 3),
                               "1,1,1");
    std::vector<double> efforts(18), matrix(problem.set.packed_size());
    for (double& x : efforts) x = random.uniform();
    information_matrix(problem.set, efforts, matrix);
    Eigen::MatrixXd m(9, 9);
    unpack(matrix.data(), 9, m.data());
    const Eigen::MatrixXd nuisance = m.bottomRightCorner(6, 6);
    EXPECT_NEAR(problem.value(efforts),
                std::log(m.determinant()) - std::log(nuisance.determinant()), 1e-9);
    EXPECT_EQ(m(3, 5), 0.0);  // effects of different blocks never meet
  }
}

// What is common to all runs of a block tells nothing: J may be moved by any constant.
TEST(BlockEffects, InvariantToOffsetsOfTheJacobians) {
  Random random(5);
  const Jacobians plain = random_jacobians(8, 1, 2, random);
  Jacobians moved = plain;
  for (std::size_t i = 0; i < 8; ++i) moved.values[2 * i] += 3.0;
  const BlockProblem one(plain, common_offset(plain, 2), "3,5");
  const BlockProblem other(moved, common_offset(moved, 2), "3,5");
  EXPECT_NEAR(one.value(one.solved(1e-9)), other.value(other.solved(1e-9)), 1e-8);
}

double negative_log_det(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  const auto& problem = *static_cast<const BlockProblem*>(data);
  const auto value = [&](const std::vector<double>& at) {
    const double found = problem.value(at);
    return std::isfinite(found) ? -found : 1e6;
  };
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    constexpr double kStep = 1e-6;
    std::vector<double> up = x, down = x;
    up[i] += kStep;
    down[i] = std::max(down[i] - kStep, 0.0);
    gradient[i] = (value(up) - value(down)) / (up[i] - down[i]);
  }
  return value(x);
}

double block_excess(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  const auto& row = *static_cast<const LinearConstraint*>(data);
  if (!gradient.empty()) gradient = row.coefficients;
  return row_value(row, x) - row.upper;
}

TEST(BlockEffects, AnIndependentSolverFindsNothingBetter) {
  int reached = 0;
  constexpr int kInstances = 30;
  for (std::uint64_t seed = 1; seed <= kInstances; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const std::size_t r = 1 + random.below(2);
    const Jacobians plain = random_jacobians(6, r, 2, random);
    BlockProblem problem(plain, offsets_of_outputs(plain, 2), "4,7");
    const double own = problem.value(problem.solved(1e-8));
    const auto count = static_cast<unsigned>(problem.set.candidate_count());
    nlopt::opt slsqp(nlopt::LD_SLSQP, count);
    slsqp.set_lower_bounds(0.0);
    slsqp.set_min_objective(&negative_log_det, &problem);
    for (std::size_t j = 1; j < problem.constraints.rows.size(); ++j) {
      slsqp.add_equality_constraint(&block_excess, &problem.constraints.rows[j], 1e-10);
    }
    slsqp.set_ftol_rel(1e-12);
    slsqp.set_maxeval(2000);
    std::vector<double> start(count, 11.0 / count);
    double least = 0.0;
    try {
      slsqp.optimize(start, least);
    } catch (const std::exception&) {
      continue;
    }
    if (largest_violation(problem.constraints, start) > 1e-8) continue;
    EXPECT_LE(problem.value(start), own + 1e-6);
    reached += problem.value(start) > own - 1e-3 ? 1 : 0;
  }
  EXPECT_GE(reached, kInstances * 3 / 4);
}

// All ways to run n of `count` candidates, repetition allowed.
void each_multiset(std::size_t count, std::size_t n, std::vector<double>& counts, std::size_t from,
                   const std::function<void()>& visit) {
  if (n == 0) return visit();
  for (std::size_t i = from; i < count; ++i) {
    counts[i] += 1.0;
    each_multiset(count, n - 1, counts, i, visit);
    counts[i] -= 1.0;
  }
}

TEST(BlockEffects, BruteForceFindsNothingBetter) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Jacobians plain = random_jacobians(4, 1, 2, random);
    const BlockProblem problem(plain, common_offset(plain, 2), "3,2");
    double best = -std::numeric_limits<double>::infinity();
    std::vector<double> first(4, 0.0), second(4, 0.0);
    each_multiset(4, 3, first, 0, [&] {
      each_multiset(4, 2, second, 0, [&] {
        std::vector<double> efforts = first;
        efforts.insert(efforts.end(), second.begin(), second.end());
        best = std::max(best, problem.value(efforts));
      });
    });
    const ConstrainedExactSolution answer =
        solve_constrained_exact(problem.set, problem.constraints, {.criterion = problem.criterion});
    ASSERT_EQ(answer.status, ExactStatus::kOptimal);
    const std::vector<std::int64_t>& counts = answer.designs.front().counts;
    EXPECT_NEAR(problem.value({counts.begin(), counts.end()}), best, 1e-5);
  }
}

TEST(BlockEffects, NamesPlacesAndBlocks) {
  Jacobians plain = treatments(3);
  plain.names = {"a", "b"};
  plain.table = {{"x"}, {"mm"}, {1.0, 2.0, 3.0}};
  const InformationSet set = information_set_from_jacobians(
      with_block_effects(plain, common_offset(plain, 2)), kUnitNoise);
  EXPECT_EQ(set.parameters(),
            (std::vector<std::string>{"a", "b", "block_1.offset", "block_2.offset"}));
  EXPECT_EQ(set.candidates().names, (std::vector<std::string>{"x", "block"}));
  const auto place = set.coordinates(4);  // candidate 1 in block 2
  EXPECT_EQ(std::vector<double>(place.begin(), place.end()), (std::vector<double>{2.0, 2.0}));
  plain.table = {};
  const Jacobians bare = with_block_effects(plain, common_offset(plain, 2));
  EXPECT_EQ(bare.table.names, (std::vector<std::string>{"experiment", "block"}));
  EXPECT_EQ(bare.table.values, (std::vector<double>{0, 1, 1, 1, 2, 1, 0, 2, 1, 2, 2, 2}));
  const auto rows = block_size_rows(set, "1-2, 3");
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].coefficients, (std::vector<double>{1, 1, 1, 0, 0, 0}));
  EXPECT_EQ(rows[0].lower, 1.0);
  EXPECT_EQ(rows[0].upper, 2.0);
  EXPECT_FALSE(experiments_in_blocks("1-2, 3").has_value());
  EXPECT_EQ(experiments_in_blocks("2,3"), 5.0);
}

TEST(BlockEffects, RefusesWithTheRemedy) {
  Jacobians plain = treatments(3);
  plain.names = {"a", "b"};
  expect_refused([&] { (void)with_block_effects(plain, common_offset(plain, 1)); }, "two or more");
  Jacobians constant = plain;
  for (std::size_t i = 0; i < 3; ++i) constant.values[2 * i + 1] = 7.0;
  expect_refused([&] { (void)with_block_effects(constant, common_offset(constant, 2)); },
                 "column 'b' can't be told from the effects of the blocks");
  BlockEffects twice{.blocks = 2, .effects = 2, .values = std::vector<double>(6, 1.0)};
  expect_refused([&] { (void)with_block_effects(plain, twice); }, "depend on each other");
  Jacobians taken = plain;
  taken.names[0] = "block_2.offset";
  expect_refused([&] { (void)with_block_effects(taken, common_offset(taken, 2)); },
                 "a column 'block_2.offset' already");
  const InformationSet bare = information_set_from_jacobians(plain, kUnitNoise);
  expect_refused([&] { (void)block_size_rows(bare, "2,2"); }, "no coordinate 'block'");
  const InformationSet set = information_set_from_jacobians(
      with_block_effects(plain, common_offset(plain, 2)), kUnitNoise);
  expect_refused([&] { (void)block_size_rows(set, "2,2,2"); }, "no candidate in block 3");
  expect_refused([&] { (void)block_size_rows(set, "2"); }, "1 sizes, but candidate 3");
  expect_refused([&] { (void)block_size_rows(set, "2,x"); }, "'x' is no size");
  expect_refused([&] { (void)block_size_rows(set, "2,5-3"); }, "leaves no size");
}

}  // namespace
}  // namespace graybox
