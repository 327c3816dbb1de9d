// column_generation and multiplicative on A, E, L and Ds: closed forms, brute force, Elfving's
// theorem, agreement within the certified bounds, singular optima, invariances.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/families/regression.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/multiplicative/multiplicative.hpp"
#include "solvers/registry.hpp"
#include "solvers/restricted_problem/damped_least_squares.hpp"
#include "tests/support/criterion_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Solves, and certifies without the dual matrix's help unless `with_dual`.
Certificate solved(const Solver& solver, const InformationSet& set, const Criterion& criterion,
                   double gap, bool with_dual = true) {
  Solution solution = solver.solve(set, {.duality_gap = gap, .criterion = criterion});
  EXPECT_EQ(solution.status, SolveStatus::kSolved)
      << solver.name() << ", " << to_string(criterion.kind()) << ": " << solution.message;
  if (!with_dual) solution.design.dual_matrix.clear();
  const Certificate proof = certify(set, solution.design, criterion);
  EXPECT_EQ(proof.status, CertificateStatus::kCertified);
  EXPECT_LE(proof.duality_gap, gap + std::min(proof.rounding_bound, 0.1 * gap))
      << solver.name() << ", " << to_string(criterion.kind());
  return proof;
}

double goodness_of(const Certificate& proof, const Criterion& criterion) {
  switch (criterion.kind()) {
    case CriterionKind::kE:
      return proof.criterion_value;
    case CriterionKind::kDs:
      return std::exp(proof.criterion_value / static_cast<double>(criterion.interest().size()));
    default:
      return 1.0 / proof.criterion_value;
  }
}

Criterion rank_one(const VectorXd& c) { return Criterion::l(packed(MatrixXd(c * c.transpose()))); }

std::vector<Criterion> criteria_for(Eigen::Index d, Random& random) {
  const MatrixXd g = gaussian(d, d, random), thin = gaussian(d, (d + 1) / 2, random);
  return {Criterion::a(),
          Criterion::e(),
          Criterion::l(packed(MatrixXd(g * g.transpose()))),
          Criterion::l(packed(MatrixXd(thin * thin.transpose()))),
          rank_one(gaussian(d, 1, random)),
          Criterion::ds({0}),
          Criterion::ds({0, static_cast<std::size_t>(d) - 1})};
}

TEST(CriterionSolver, ReachesTheKnownOptima) {
  for (const KnownOptimum& known : known_optima()) {
    SCOPED_TRACE(known.name);
    const Certificate proof = solved(ColumnGeneration(), known.set, known.criterion, 1e-9);
    EXPECT_NEAR(goodness_of(proof, known.criterion) / known.goodness, 1.0, 2e-9);
    if (known.criterion.kind() == CriterionKind::kE) {
      solved(ColumnGeneration(), known.set, known.criterion, 1e-8, false);
      continue;
    }
    const Certificate slow = solved(Multiplicative(), known.set, known.criterion, 1e-4);
    EXPECT_NEAR(goodness_of(slow, known.criterion) / known.goodness, 1.0, 2e-4);
  }
}

// What is called solved is proven by the checker, which has more digits, at gaps near to those that
// double precision knows and at every condition number. Without its rounding bound the solver
// claims gaps here that are not reached.
TEST(CriterionSolver, CallsSolvedOnlyWhatTheCheckerProves) {
  Random random(31);
  int claimed = 0, tried = 0;
  for (int round = 0; round < 24; ++round) {
    const Eigen::Index d = 3 + round % 3;
    const MatrixXd mix = gaussian(d, d, random);
    std::vector<VectorXd> vectors;
    for (int i = 0; i < 40; ++i) {
      VectorXd f = mix * gaussian(d, 1, random);
      for (Eigen::Index j = 0; j < d; ++j)
        f(j) *= std::pow(10.0, -0.1 * round * static_cast<double>(j));
      vectors.push_back(std::move(f));
    }
    const InformationSet set = regression(vectors);
    std::vector<Criterion> criteria = criteria_for(d, random);
    criteria.push_back(Criterion::phi_p(3.0));
    for (const Criterion& criterion : criteria) {
      for (const double gap : {1e-9, 1e-12, 1e-13, 1e-14}) {
        const Solution solution =
            ColumnGeneration().solve(set, {.duality_gap = gap, .criterion = criterion});
        ++tried;
        if (solution.status != SolveStatus::kSolved) continue;
        ++claimed;
        const Certificate proof = certify(set, solution.design, criterion, gap);
        EXPECT_TRUE(proves(proof, gap))
            << round << " " << to_string(criterion.kind()) << " " << gap << ": "
            << proof.duality_gap << " +- " << proof.rounding_bound;
      }
    }
  }
  EXPECT_GT(claimed, tried / 4);
}

// Elfving 1952: the least variance of c^T theta is the square of max {c^T z : |f_i^T z| <= 1},
// whose maximiser solves d of the equations f_i^T z = +-1: all of them are tried. Many of these
// optima are singular.
TEST(CriterionSolver, CombinationsHaveElfvingsVariance) {
  Random random(5);
  int singular = 0;
  for (int round = 0; round < 40; ++round) {
    const Eigen::Index d = 2 + round % 2;
    std::vector<VectorXd> vectors;
    for (int i = 0; i < 9; ++i) vectors.emplace_back(gaussian(d, 1, random));
    VectorXd c = gaussian(d, 1, random);
    if (round % 4 == 0) c = 1.7 * vectors[0];  // often one candidate alone
    double best = 0.0;
    const auto try_vertex = [&](const MatrixXd& rows, const VectorXd& right) {
      const VectorXd z = rows.fullPivLu().solve(right);
      for (const VectorXd& f : vectors) {
        if (std::abs(f.dot(z)) > 1.0 + 1e-9) return;
      }
      best = std::max(best, c.dot(z));
    };
    MatrixXd rows(d, d);
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < i; ++j) {
        for (int k = 0; k < (d == 3 ? j : 1); ++k) {
          for (int signs = 0; signs < (1 << d); ++signs) {
            VectorXd right(d);
            rows.row(0) = vectors[static_cast<std::size_t>(i)];
            rows.row(1) = vectors[static_cast<std::size_t>(j)];
            if (d == 3) rows.row(2) = vectors[static_cast<std::size_t>(k)];
            for (Eigen::Index r = 0; r < d; ++r) right(r) = (signs >> r) & 1 ? 1.0 : -1.0;
            try_vertex(rows, right);
          }
        }
      }
    }
    const InformationSet set = regression(vectors);
    const Solution solution =
        ColumnGeneration().solve(set, {.duality_gap = 1e-7, .criterion = rank_one(c)});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    const Certificate proof = certify(set, solution.design, rank_one(c));
    EXPECT_NEAR(proof.criterion_value / (best * best), 1.0, 1.1e-7);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(
        information_of(set, solution.design.weights));
    singular += eigen.eigenvalues()(0) < 1e-4 * eigen.eigenvalues()(d - 1) ? 1 : 0;
  }
  EXPECT_GE(singular, 5);  // the test covers them
}

// The slope of a quadratic at zero: half of the experiments at each end, where intercept and
// curvature can't be told apart. For each gap there is a regular design.
TEST(CriterionSolver, ApproachesASingularOptimumFromInside) {
  const InformationSet set = polynomial(2, even_grid(10));
  const VectorXd slope = VectorXd::Unit(3, 1);
  for (const Criterion& criterion : {Criterion::ds({1}), rank_one(slope)}) {
    for (const double gap : {1e-2, 1e-4, 1e-6, 1e-8}) {
      const Certificate proof = solved(ColumnGeneration(), set, criterion, gap);
      EXPECT_NEAR(goodness_of(proof, criterion), 1.0, gap + 1e-12);
    }
  }
  // A weight matrix of rank two: slope and curvature.
  MatrixXd w = MatrixXd::Zero(3, 3);
  w(1, 1) = 1.0;
  w(2, 2) = 0.25;
  solved(ColumnGeneration(), set, Criterion::l(packed(w)), 1e-9);
  solved(Multiplicative(), set, Criterion::l(packed(w)), 1e-4);
}

// All designs of two candidates on a fine grid; goodness is smooth there except E.
TEST(CriterionSolver, AgreesWithBruteForceOnTwoCandidates) {
  Random random(31);
  for (unsigned round = 0; round < 20; ++round) {
    const InformationSet set = wishart(2 + round % 2, 2, 3, 400 + round, 1.0);
    const MatrixXd a = matrix_of(set, 0), b = matrix_of(set, 1);
    for (const Criterion& criterion :
         criteria_for(static_cast<Eigen::Index>(set.dimension()), random)) {
      double best = 0.0;
      for (int k = 0; k <= 2000; ++k) {
        best = std::max(best, goodness(a + (b - a) * (k / 2000.0), criterion));
      }
      const Certificate proof = solved(ColumnGeneration(), set, criterion, 1e-9);
      const double reached = goodness_of(proof, criterion);
      EXPECT_GE(reached, best * (1.0 - 1e-8)) << to_string(criterion.kind());
      EXPECT_LE(reached, best * (1.0 + 1e-3)) << to_string(criterion.kind());
    }
  }
}

TEST(CriterionSolver, BackEndsAgreeWithinTheirBounds) {
  Random random(17);
  for (unsigned seed = 0; seed < 8; ++seed) {
    const Eigen::Index d = 2 + static_cast<Eigen::Index>(seed);
    const InformationSet set =
        wishart(d, 60 + 50 * seed, 1 + static_cast<Eigen::Index>(seed) % 3, seed, 1.0);
    for (const Criterion& criterion : criteria_for(d, random)) {
      SCOPED_TRACE(std::string(to_string(criterion.kind())) + " " + std::to_string(seed));
      const Certificate fast = solved(ColumnGeneration(), set, criterion, 1e-9);
      if (criterion.kind() == CriterionKind::kE) {
        const Certificate own = solved(ColumnGeneration(), set, criterion, 1e-8, false);
        EXPECT_NEAR(own.duality_gap, fast.duality_gap, 1e-8);
        continue;
      }
      const Solution slow = Multiplicative().solve(
          set, {.duality_gap = 1e-4, .iteration_limit = 3000, .criterion = criterion});
      const Certificate proof = certify(set, slow.design, criterion);
      ASSERT_EQ(proof.status, CertificateStatus::kCertified);
      const double ratio = goodness_of(proof, criterion) / goodness_of(fast, criterion);
      EXPECT_LE(ratio, 1.0 + fast.duality_gap + 1e-12);
      EXPECT_GE(ratio, proof.efficiency - 1e-12);
    }
  }
}

TEST(CriterionSolver, SolvesTheFamiliesOfTheStudy) {
  for (const std::string family : {"rob", "smo", "smr6", "flat", "r1l", "dup", "decades"}) {
    const InformationSet set = make_family(family, 1500, 6, 2);
    for (const Criterion& criterion :
         {Criterion::a(), Criterion::ds({0, 1}), rank_one(VectorXd::Ones(6))}) {
      SCOPED_TRACE(family + " " + std::string(to_string(criterion.kind())));
      solved(ColumnGeneration(), set, criterion, 1e-7);
    }
  }
}

// The smallest eigenvalue of most of these optima is a multiple one. Neighbours on a grid, ties and
// copies leave the optimal weights undetermined.
TEST(CriterionSolver, ReachesFineGapsForEOnEveryFamily) {
  for (const std::string family :
       {"rob", "wis", "flat", "smo", "smr6", "r1g", "r1l", "dup", "decades"}) {
    for (const std::size_t d : {std::size_t{3}, std::size_t{12}}) {
      SCOPED_TRACE(family + " " + std::to_string(d));
      solved(ColumnGeneration(), make_family(family, 400, d, 3), Criterion::e(), 1e-9);
    }
  }
  solved(ColumnGeneration(), cube_regression(3), Criterion::e(), 1e-9);
  solved(ColumnGeneration(), two_level_factorial(6, 2), Criterion::e(), 1e-9);
  for (const std::size_t degree : {1U, 3U, 5U, 8U, 12U}) {
    SCOPED_TRACE(degree);
    const std::vector<double> points = even_points(301);
    solved(ColumnGeneration(), polynomial_regression(degree, points, PolynomialBasis::kLegendre),
           Criterion::e(), 1e-9);
    if (degree < 10) {
      solved(ColumnGeneration(), polynomial_regression(degree, points, PolynomialBasis::kMonomial),
             Criterion::e(), 1e-9);
    }
  }
}

// lambda_min does not change under rotations, and is the same in the parameters' own coordinates as
// relative to R R^T in others.
TEST(CriterionSolver, RotationsDoNotMatterForE) {
  Random random(29);
  const InformationSet set = wishart(6, 150, 2, 5);
  const MatrixXd rotation = Eigen::HouseholderQR<MatrixXd>(gaussian(6, 6, random)).householderQ() *
                            MatrixXd::Identity(6, 6);
  const double here = solved(ColumnGeneration(), set, Criterion::e(), 1e-10).criterion_value;
  const double there =
      solved(ColumnGeneration(), transformed(set, rotation), Criterion::e(), 1e-10).criterion_value;
  EXPECT_NEAR(there / here, 1.0, 2.1e-10);
}

// Nearly equal rows and little damping: the normal equations are singular in double precision, the
// orthogonal method loses half of the digits. The truth comes from extended precision.
TEST(DampedLeastSquares, IsAccurateForNearlyEqualRows) {
  using Extended = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  constexpr std::size_t kStride = 8, kColumns = 6;
  Random random(7);
  const Eigen::Index n = 5, m = kColumns;
  const VectorXd right = gaussian(m, 1, random), shift = gaussian(n, 1, random);
  for (const double nearness : {1.0, 1e-7}) {
    AlignedArray rows(static_cast<std::size_t>(n) * kStride, 0.0);
    MatrixXd stacked = MatrixXd::Zero(m + n, n);
    const VectorXd common = gaussian(m, 1, random);
    const VectorXd damping = VectorXd::Constant(n, nearness);
    for (Eigen::Index i = 0; i < n; ++i) {
      stacked.col(i).head(m) = common + nearness * gaussian(m, 1, random);
      stacked(m + i, i) = damping(i);
      for (Eigen::Index k = 0; k < m; ++k) {
        rows[static_cast<std::size_t>(i) * kStride + static_cast<std::size_t>(k)] = stacked(k, i);
      }
    }
    VectorXd all(m + n), x;
    all << right, shift;
    const Extended truth =
        Eigen::HouseholderQR<Extended>(stacked.cast<long double>()).solve(all.cast<long double>());
    const auto error_of = [&](DampedLeastSquares::Method method) {
      DampedLeastSquares system;
      EXPECT_TRUE(system.factor(rows.data(), kStride, kColumns, damping, method));
      system.solve(right, shift, x);
      return (x - truth.cast<double>()).norm() / truth.cast<double>().norm();
    };
    EXPECT_LT(error_of(DampedLeastSquares::Method::kOrthogonal), nearness == 1.0 ? 1e-13 : 1e-6);
    if (nearness == 1.0) {
      EXPECT_LT(error_of(DampedLeastSquares::Method::kNormalEquations), 1e-13);
    }
  }
}

// Ds does not depend on units or on how the nuisance parameters are written; L does if W follows.
TEST(CriterionSolver, BearsBadlyScaledParameters) {
  const InformationSet set = wishart(5, 300, 3, 8);
  VectorXd units(5);
  units << 1e-5, 1e4, 1.0, 1e2, 1e-3;
  const InformationSet scaled = transformed(set, units.asDiagonal());
  const Criterion ds = Criterion::ds({1, 2});
  const double shift = 2.0 * (std::log(1e4) + std::log(1.0));
  EXPECT_NEAR(solved(ColumnGeneration(), scaled, ds, 1e-9).criterion_value - shift,
              solved(ColumnGeneration(), set, ds, 1e-9).criterion_value, 1e-8);
  const Criterion before = Criterion::l(packed(MatrixXd::Identity(5, 5)));
  const Criterion after = Criterion::l(packed(MatrixXd(units.cwiseAbs2().asDiagonal())));
  const double value = solved(ColumnGeneration(), set, before, 1e-9).criterion_value;
  EXPECT_NEAR(solved(ColumnGeneration(), scaled, after, 1e-9).criterion_value, value, 1e-8 * value);
}

// A nearly singular change of coordinates: plain double sensitivities are not good enough, the
// whitened problem is.
TEST(CriterionSolver, SolvesIllConditionedSetsThroughWhitening) {
  Random random(3);
  const InformationSet set = wishart(4, 200, 2, 11);
  MatrixXd t = MatrixXd::Ones(4, 4) + 1e-4 * gaussian(4, 4, random);
  const InformationSet mapped = transformed(set, t);
  for (const Criterion& criterion : {Criterion::a(), Criterion::e(), Criterion::ds({0, 2})}) {
    const Certificate proof = solved(ColumnGeneration(), mapped, criterion, 1e-8);
    EXPECT_LE(proof.rounding_bound, 1e-8);
  }
}

TEST(CriterionSolver, DuplicatesScaleAndOrderDoNotMatter) {
  Random random(41);
  const InformationSet set = wishart(4, 120, 2, 19);
  std::vector<MatrixXd> changed = matrices_of(concatenated(set, set));
  std::ranges::reverse(changed);
  for (MatrixXd& h : changed) h *= 1024.0;
  const InformationSet other = from_matrices(changed);
  for (const Criterion& criterion : criteria_for(4, random)) {
    const double here = goodness_of(solved(ColumnGeneration(), set, criterion, 1e-9), criterion);
    const double there = goodness_of(solved(ColumnGeneration(), other, criterion, 1e-9), criterion);
    EXPECT_NEAR(there / (1024.0 * here), 1.0, 3e-9) << to_string(criterion.kind());
  }
}

TEST(CriterionSolver, OneParameter) {
  const InformationSet set = from_matrices(
      {MatrixXd::Constant(1, 1, 2.0), MatrixXd::Constant(1, 1, 5.0), MatrixXd::Zero(1, 1)});
  for (const Criterion& criterion :
       {Criterion::a(), Criterion::e(), Criterion::l({3.0}), Criterion::ds({0})}) {
    const Solution solution =
        ColumnGeneration().solve(set, {.duality_gap = 1e-9, .criterion = criterion});
    EXPECT_EQ(solution.status, SolveStatus::kSolved);
    EXPECT_NEAR(solution.design.weights[1], 1.0, 1e-8);
  }
}

// Where the exponent of D would swap two weights for ever, 1/2 is there in one step.
TEST(CriterionSolver, MultiplicativeTakesASafeExponent) {
  VectorXd first(2), second(2);
  first << 1, 1;
  second << 1, -1;
  const InformationSet set = regression({first, second});
  const std::vector<double> start{0.3, 0.7};
  const MatrixXd m = information_of(set, start);
  const MatrixXd g = m.inverse() - MatrixXd(VectorXd::Unit(2, 1).asDiagonal()) / m(1, 1);
  EXPECT_NEAR(start[0] * (g * matrix_of(set, 0)).trace(), start[1], 1e-12);  // exponent 1 swaps

  // The information about the parameter of interest never falls.
  const InformationSet hard = wishart(4, 50, 1, 23, 2.0);
  for (const Criterion& criterion : {Criterion::a(), Criterion::ds({0, 2})}) {
    double last = 0.0;
    for (int steps = 1; steps < 40; ++steps) {
      const Solution solution = Multiplicative().solve(
          hard, {.duality_gap = 1e-12, .iteration_limit = steps, .criterion = criterion});
      const double now = goodness(information_of(hard, solution.design.weights), criterion);
      EXPECT_GE(now, last * (1.0 - 1e-12));
      last = now;
    }
  }
}

TEST(CriterionSolver, IsHonestAboutLimits) {
  const InformationSet set = make_family("rob", 3000, 8, 1);
  for (const Criterion& criterion : {Criterion::a(), Criterion::e(), Criterion::ds({0})}) {
    const Solution limited = ColumnGeneration().solve(
        set, {.duality_gap = 1e-9, .iteration_limit = 1, .criterion = criterion});
    EXPECT_EQ(limited.status, SolveStatus::kIterationLimit);
    EXPECT_EQ(certify(set, limited.design, criterion).status, CertificateStatus::kCertified);
    const Solution quick = ColumnGeneration().solve(
        set, {.duality_gap = 1e-9, .time_limit = 1e-9, .criterion = criterion});
    EXPECT_EQ(quick.status, SolveStatus::kTimeLimit);
    EXPECT_EQ(certify(set, quick.design, criterion).status, CertificateStatus::kCertified);
    const Solution impossible =
        ColumnGeneration().solve(set, {.duality_gap = 1e-18, .criterion = criterion});
    EXPECT_LE(certify(set, impossible.design, criterion).duality_gap, 1e-8);
  }
}

TEST(CriterionSolver, DoesNotDependOnTheNumberOfThreads) {
  const InformationSet set = make_family("rob", 40000, 4, 1);
  for (const Criterion& criterion : {Criterion::a(), Criterion::e(), Criterion::ds({0})}) {
    const SolveOptions one{.duality_gap = 1e-8, .threads = 1, .criterion = criterion};
    const SolveOptions two{.duality_gap = 1e-8, .threads = 2, .criterion = criterion};
    EXPECT_EQ(ColumnGeneration().solve(set, one).design.weights,
              ColumnGeneration().solve(set, two).design.weights);
  }
  const SolveOptions one{.iteration_limit = 5, .threads = 1, .criterion = Criterion::a()};
  const SolveOptions two{.iteration_limit = 5, .threads = 2, .criterion = Criterion::a()};
  EXPECT_EQ(Multiplicative().solve(set, one).design.weights,
            Multiplicative().solve(set, two).design.weights);
}

TEST(CriterionSolver, OthersAreUnsupportedThroughTheRegistry) {
  const SolverRegistry registry = make_registry();
  const InformationSet set = wishart(3, 20, 2, 1);
  int refused = 0;
  for (const auto& entry : registry.entries()) {
    if (entry.solver == nullptr) continue;
    const auto criteria = entry.solver->traits().criteria;
    EXPECT_NE(std::ranges::find(criteria, CriterionKind::kD), criteria.end());
    if (std::ranges::find(criteria, CriterionKind::kE) != criteria.end()) continue;
    const Solution solution = entry.solver->solve(set, {.criterion = Criterion::e()});
    EXPECT_EQ(solution.status, SolveStatus::kUnsupported) << entry.name;
    EXPECT_NE(solution.message.find("criterion E"), std::string::npos) << solution.message;
    ++refused;
  }
  EXPECT_GE(refused, 10);
  EXPECT_EQ(registry.at("external:true").solve(set, {.criterion = Criterion::a()}).status,
            SolveStatus::kUnsupported);
  EXPECT_THROW(static_cast<void>(
                   registry.at("column_generation").solve(set, {.criterion = Criterion::ds({7})})),
               InputError);
  EXPECT_THROW(static_cast<void>(Multiplicative().solve(set, {.criterion = Criterion::e()})),
               InputError);
}

}  // namespace
}  // namespace graybox
