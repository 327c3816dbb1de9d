// Robust designs over samples: closed forms, simplex grids, reductions to D-optimal design, and
// what the certificate promises for whatever multipliers it is given.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/robot_information/stiffness_samples.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/robust/robust_column_generation.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_sets::from_matrices;
using testing_sets::log_det;
using testing_sets::matrices_of;
using testing_sets::wishart;

const SolveOptions kPrecise{.duality_gap = 1e-9};

RobustProblem problem_of(const std::vector<InformationSet>& sets, RobustObjective objective,
                         bool relative = false) {
  RobustProblem problem;
  problem.objective = objective;
  for (const InformationSet& set : sets) problem.samples.push_back(&set);
  if (relative) problem.references = sample_optima(problem.samples, kPrecise).log_det;
  return problem;
}

double objective(const RobustProblem& problem, const std::vector<double>& weights) {
  double mean = 0.0, smallest = 1e300;
  for (std::size_t s = 0; s < problem.samples.size(); ++s) {
    const double value = log_det(*problem.samples[s], weights) - problem.reference(s);
    mean += value / static_cast<double>(problem.samples.size());
    smallest = std::min(smallest, value);
  }
  return problem.objective == RobustObjective::kAverage ? mean : smallest;
}

std::vector<double> solved(const RobustProblem& problem) {
  const RobustSolution answer = solve_robust(problem, kPrecise);
  EXPECT_EQ(answer.solution.status, SolveStatus::kSolved) << answer.solution.message;
  const RobustCertificate proof = certify_robust(problem, answer.solution.design, answer.prices);
  EXPECT_LE(proof.certificate.duality_gap, 1.01e-9) << to_string(problem.objective);
  EXPECT_NEAR(proof.certificate.log_det, objective(problem, answer.solution.design.weights), 1e-9);
  return answer.solution.design.weights;
}

std::vector<InformationSet> scalar_samples(const std::vector<std::vector<double>>& values) {
  std::vector<InformationSet> sets;
  for (const auto& row : values) {
    std::vector<MatrixXd> matrices;
    for (const double value : row) matrices.push_back(MatrixXd::Constant(1, 1, value));
    sets.push_back(from_matrices(matrices));
  }
  return sets;
}

const auto kObjectives = {RobustObjective::kAverage, RobustObjective::kWorstCase};

// One parameter, information (3, 1) and (1, 2): with l on the first candidate 1 + 2 l and 2 - l.
TEST(RobustDesign, ClosedFormsOfOneParameter) {
  const auto sets = scalar_samples({{3.0, 1.0}, {1.0, 2.0}});
  EXPECT_NEAR(solved(problem_of(sets, RobustObjective::kAverage))[0], 0.75, 1e-4);
  EXPECT_NEAR(solved(problem_of(sets, RobustObjective::kWorstCase))[0], 1.0 / 3.0, 1e-8);
  EXPECT_NEAR(solved(problem_of(sets, RobustObjective::kWorstCase, true))[0], 4.0 / 7.0, 1e-8);
}

// Two parameters, diagonal: three candidates diag(1, 0), diag(0, 1), and diag(b, c), where (b, c)
// is (2, 0) in one sample and (0, 2) in the other. With weights (x, x, 1 - 2 x), by symmetry, det =
// x (x + 2 (1 - 2 x)) = 2 x - 3 x^2 under both: x = 1/3.
TEST(RobustDesign, ClosedFormOfDiagonalSamples) {
  const auto diagonal = [](double a, double b) { return MatrixXd(VectorXd{{a, b}}.asDiagonal()); };
  const std::vector<InformationSet> sets{
      from_matrices({diagonal(1, 0), diagonal(0, 1), diagonal(2, 0)}),
      from_matrices({diagonal(1, 0), diagonal(0, 1), diagonal(0, 2)})};
  for (const auto kind : kObjectives) {
    const auto weights = solved(problem_of(sets, kind));
    for (const double weight : weights) EXPECT_NEAR(weight, 1.0 / 3.0, 1e-4);
    EXPECT_NEAR(objective(problem_of(sets, kind), weights), std::log(1.0 / 3.0), 1e-9);
  }
}

TEST(RobustDesign, MatchesARefinedGridOfThreeWeights) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    std::vector<InformationSet> sets;
    for (std::uint64_t s = 0; s < 3; ++s) sets.push_back(wishart(2, 3, 2, 10 * seed + s, 1.0));
    for (const auto kind : kObjectives) {
      for (const bool relative : {false, true}) {
        const RobustProblem problem = problem_of(sets, kind, relative);
        double best = -1e300;
        constexpr int kSteps = 200;
        for (int a = 0; a <= kSteps; ++a) {
          for (int b = 0; a + b <= kSteps; ++b) {
            const double step = 1.0 / kSteps;
            best =
                std::max(best, objective(problem, {a * step, b * step, (kSteps - a - b) * step}));
          }
        }
        const double ours = objective(problem, solved(problem));
        EXPECT_GE(ours, best - 1e-8);
        EXPECT_LE(ours, best + 0.02);
      }
    }
  }
}

TEST(RobustDesign, OneSampleOrEqualSamplesAreDOptimal) {
  const InformationSet set = wishart(4, 60, 2, 5, 1.0);
  const double optimum = log_det(set, ColumnGeneration().solve(set, kPrecise).design.weights);
  for (const std::size_t count : {1U, 4U}) {
    const std::vector<InformationSet> sets(count, set);
    for (const auto kind : kObjectives) {
      EXPECT_NEAR(log_det(set, solved(problem_of(sets, kind))), optimum, 1e-8);
      EXPECT_NEAR(objective(problem_of(sets, kind, true), solved(problem_of(sets, kind, true))),
                  0.0, 1e-8);
    }
  }
}

TEST(RobustDesign, AverageIsDOptimalForBlockDiagonalMatrices) {
  std::vector<InformationSet> sets{wishart(2, 30, 1, 6, 1.0), wishart(2, 30, 2, 7, 1.0)};
  std::vector<MatrixXd> blocks;
  for (std::size_t i = 0; i < 30; ++i) {
    MatrixXd block = MatrixXd::Zero(4, 4);
    block.topLeftCorner(2, 2) = testing_sets::matrix_of(sets[0], i);
    block.bottomRightCorner(2, 2) = testing_sets::matrix_of(sets[1], i);
    blocks.push_back(block);
  }
  const InformationSet joint = from_matrices(blocks);
  const double optimum = log_det(joint, ColumnGeneration().solve(joint, kPrecise).design.weights);
  const auto problem = problem_of(sets, RobustObjective::kAverage);
  EXPECT_NEAR(2.0 * objective(problem, solved(problem)), optimum, 1e-7);
}

TEST(RobustDesign, RandomSamplesOfAllRanksAreSolved) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const auto rank = static_cast<Index>(1 + seed % 4);
    const std::size_t samples = 1 + seed % 7;
    std::vector<InformationSet> sets;
    for (std::size_t s = 0; s < samples; ++s) {
      sets.push_back(wishart(4, 80, rank, 1000 * seed + s, static_cast<double>(seed % 3)));
    }
    for (const auto kind : kObjectives) {
      for (const bool relative : {false, true}) solved(problem_of(sets, kind, relative));
    }
  }
}

// Finding S7: few different matrices in many copies, the same or others in each sample.
TEST(RobustDesign, WorstCasesOnCopiesAreSolved) {
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    Random random(seed);
    const auto d = static_cast<Index>(2 + random.below(4));
    const std::size_t count = 6 + random.below(40), samples = 2 + random.below(3);
    const bool common = random.below(2) == 0;
    std::vector<std::size_t> which(count);
    std::vector<InformationSet> sets;
    for (std::size_t s = 0; s < samples; ++s) {
      const auto few = matrices_of(wishart(d, 3, d, random.next()));
      for (std::size_t i = 0; i < count && (s == 0 || !common); ++i) which[i] = random.below(3);
      std::vector<MatrixXd> all;
      for (const std::size_t k : which) all.push_back(few[k]);
      sets.push_back(from_matrices(all));
    }
    for (const bool relative : {false, true}) {
      solved(problem_of(sets, RobustObjective::kWorstCase, relative));
    }
  }
}

TEST(RobustDesign, CertificateIsSafeWhateverTheMultipliers) {
  Random random(8);
  std::vector<InformationSet> sets;
  for (std::uint64_t s = 0; s < 4; ++s) sets.push_back(wishart(3, 12, 2, 50 + s, 1.0));
  const auto random_simplex = [&](std::size_t count) {
    std::vector<double> x(count);
    double sum = 0.0;
    for (double& v : x) sum += v = std::pow(random.uniform(), 3.0);
    for (double& v : x) v /= sum;
    return x;
  };
  for (const auto kind : kObjectives) {
    for (const bool relative : {false, true}) {
      const RobustProblem problem = problem_of(sets, kind, relative);
      const double optimum = objective(problem, solved(problem));
      for (int k = 0; k < 100; ++k) {
        const auto proof =
            certify_robust(problem, {random_simplex(12)}, random_simplex(sets.size()));
        const Certificate& certificate = proof.certificate;
        ASSERT_EQ(certificate.status, CertificateStatus::kCertified);
        EXPECT_GE(certificate.log_det + certificate.log_det_gap, optimum - 1e-9);
        EXPECT_LE(certificate.efficiency, std::exp((certificate.log_det - optimum) / 3.0) + 1e-9);
      }
    }
  }
  // Useless multipliers are replaced, not believed.
  const RobustProblem problem = problem_of(sets, RobustObjective::kWorstCase);
  const double optimum = objective(problem, solved(problem));
  const Design equal{std::vector<double>(12, 1.0 / 12.0)};
  for (const std::vector<double>& prices :
       {std::vector<double>{}, {0, 0, 0, 0}, {-1, 2, std::nan(""), 0}, {1, 1}}) {
    const auto proof = certify_robust(problem, equal, prices);
    EXPECT_GE(proof.certificate.log_det + proof.certificate.log_det_gap, optimum - 1e-9);
    for (const double price : proof.prices) EXPECT_GE(price, 0.0);
  }
}

TEST(RobustDesign, ComplementarityOfTheWorstCase) {
  std::vector<InformationSet> sets;
  for (std::uint64_t s = 0; s < 12; ++s) sets.push_back(wishart(3, 50, 2, 70 + s, 1.0));
  const RobustProblem problem = problem_of(sets, RobustObjective::kWorstCase, true);
  const RobustSolution answer = solve_robust(problem, kPrecise);
  const auto proof = certify_robust(problem, answer.solution.design, answer.prices);
  double sum = 0.0;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    const double slack = proof.log_det[s] - problem.reference(s) - proof.certificate.log_det;
    EXPECT_GE(slack, 0.0);
    EXPECT_GE(answer.prices[s], 0.0);
    EXPECT_LE(slack * answer.prices[s], 1e-7);
    sum += answer.prices[s];
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

TEST(RobustDesign, ScalingOneSample) {
  std::vector<InformationSet> sets{wishart(3, 30, 2, 80, 1.0), wishart(3, 30, 2, 81, 1.0)};
  std::vector<InformationSet> scaled{
      sets[0], testing_sets::transformed(sets[1], 0.1 * MatrixXd::Identity(3, 3))};
  const auto value = [&](RobustObjective kind, bool relative, const auto& solve_on,
                         const auto& judge_on) {
    return objective(problem_of(judge_on, kind, relative),
                     solved(problem_of(solve_on, kind, relative)));
  };
  // The average and the relative worst case have the same optima.
  EXPECT_NEAR(value(RobustObjective::kAverage, false, scaled, sets),
              value(RobustObjective::kAverage, false, sets, sets), 1e-8);
  EXPECT_NEAR(value(RobustObjective::kWorstCase, true, scaled, sets),
              value(RobustObjective::kWorstCase, true, sets, sets), 1e-7);
  // The absolute worst case is now decided by the weak sample alone.
  EXPECT_NEAR(value(RobustObjective::kWorstCase, false, scaled, scaled),
              log_det(scaled[1], ColumnGeneration().solve(scaled[1], kPrecise).design.weights),
              1e-8);
}

TEST(RobustDesign, OrderDuplicatesAndCoordinatesDoNotMatter) {
  std::vector<InformationSet> sets{wishart(3, 25, 2, 90, 1.0), wishart(3, 25, 2, 91, 1.0),
                                   wishart(3, 25, 2, 92, 1.0)};
  Random random(93);
  const MatrixXd t = testing_sets::gaussian(3, 3, random);
  const std::vector<std::function<InformationSet(const InformationSet&)>> changes{
      [](const InformationSet& set) {
        auto all = matrices_of(set);
        std::ranges::reverse(all);
        return from_matrices(all);
      },
      [](const InformationSet& set) { return testing_sets::concatenated(set, set); }};
  for (const auto kind : kObjectives) {
    const auto problem = problem_of(sets, kind, true);
    const double value = objective(problem, solved(problem));
    for (const auto& change : changes) {
      std::vector<InformationSet> changed;
      for (const InformationSet& set : sets) changed.push_back(change(set));
      const auto other = problem_of(changed, kind, true);
      EXPECT_NEAR(objective(other, solved(other)), value, 1e-7);
    }
    std::vector<InformationSet> moved;
    for (const InformationSet& set : sets) moved.push_back(testing_sets::transformed(set, t));
    EXPECT_NEAR(objective(problem, solved(problem_of(moved, kind, true))), value, 1e-7);
  }
}

TEST(RobustDesign, StatusesThreadsAndBadInput) {
  std::vector<InformationSet> sets{wishart(3, 3000, 2, 94, 1.0), wishart(3, 3000, 2, 95, 1.0)};
  const RobustProblem problem = problem_of(sets, RobustObjective::kWorstCase);
  const auto one = solve_robust(problem, {.duality_gap = 1e-8, .threads = 1});
  const auto two = solve_robust(problem, {.duality_gap = 1e-8, .threads = 2});
  EXPECT_EQ(one.solution.design.weights, two.solution.design.weights);
  EXPECT_EQ(one.prices, two.prices);
  const auto stopped = solve_robust(problem, {.duality_gap = 1e-9, .iteration_limit = 1});
  EXPECT_EQ(stopped.solution.status, SolveStatus::kIterationLimit);
  EXPECT_EQ(certify_robust(problem, stopped.solution.design, stopped.prices).certificate.status,
            CertificateStatus::kCertified);

  const auto refused = [](const std::vector<InformationSet>& bad) {
    EXPECT_THROW(static_cast<void>(solve_robust(problem_of(bad, RobustObjective::kAverage), {})),
                 InputError);
  };
  refused({});
  refused({wishart(3, 10, 2, 1), wishart(3, 11, 2, 1)});
  refused({wishart(3, 10, 2, 1), wishart(2, 10, 2, 1)});
  EXPECT_THROW(static_cast<void>(robust_objective("mean")), InputError);
  RobustProblem wrong = problem;
  wrong.references = {1.0};
  EXPECT_THROW(static_cast<void>(solve_robust(wrong, {})), InputError);

  // A sample whose candidates see two of three parameters only.
  std::vector<MatrixXd> blind(3000, VectorXd{{1, 1, 0}}.asDiagonal());
  refused({sets[0], from_matrices(blind)});
}

// Samples that are informative in different candidates: no optimum of one is regular for the other.
TEST(RobustDesign, StartsWhereSamplesNeedDifferentCandidates) {
  const auto unit = [](Index k) {
    return MatrixXd(VectorXd::Unit(2, k) * VectorXd::Unit(2, k).transpose());
  };
  const MatrixXd none = MatrixXd::Zero(2, 2);
  std::vector<InformationSet> sets{from_matrices({unit(0), unit(1), none, none}),
                                   from_matrices({none, none, unit(0), unit(1)})};
  for (const auto kind : kObjectives) {
    for (const double weight : solved(problem_of(sets, kind))) EXPECT_NEAR(weight, 0.25, 1e-4);
  }
}

TEST(StiffnessSamples, FillTheRange) {
  const auto cube = latin_hypercube_stiffness({.uncertainty = 0.5, .seed = 3}, 20, 4);
  for (Index p = 0; p < 4; ++p) {
    std::set<int> intervals;
    for (const VectorXd& theta : cube) {
      EXPECT_GE(theta(p), 0.5);
      EXPECT_LE(theta(p), 1.5);
      intervals.insert(static_cast<int>((theta(p) - 0.5) * 20.0));
    }
    EXPECT_EQ(intervals.size(), 20U);
  }
  const auto few = random_stiffness({.uncertainty = 0.3, .seed = 4}, 5, 3);
  const auto many = random_stiffness({.uncertainty = 0.3, .seed = 4}, 500, 3);
  VectorXd mean = VectorXd::Zero(3);
  for (const VectorXd& theta : many) {
    mean += theta / 500.0;
    EXPECT_TRUE((theta.array() >= 0.7).all() && (theta.array() <= 1.3).all());
  }
  for (std::size_t k = 0; k < few.size(); ++k) EXPECT_EQ(few[k], many[k]);
  EXPECT_NEAR(mean.mean(), 1.0, 0.03);  // 6 standard errors
  EXPECT_NE(many[0], random_stiffness({.uncertainty = 0.3, .seed = 5}, 1, 3)[0]);
  for (const double bad : {-0.1, 1.0, 2.0, std::nan("")}) {
    EXPECT_THROW(static_cast<void>(random_stiffness({.uncertainty = bad}, 3, 3)), InputError);
    EXPECT_THROW(static_cast<void>(latin_hypercube_stiffness({.uncertainty = bad}, 3, 3)),
                 InputError);
  }
  EXPECT_THROW(static_cast<void>(random_stiffness({}, 0, 3)), InputError);
}

}  // namespace
}  // namespace graybox
