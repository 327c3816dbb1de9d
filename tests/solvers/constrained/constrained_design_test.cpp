// Designs under constraints: closed forms, invariances, an independent solver, and what is refused.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/constrained/linear_programme.hpp"
#include "solvers/constrained/multiplier_bound.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

using testing::expect_refused;
using testing_sets::from_matrices;
using testing_sets::matrix_of;
using testing_sets::regression;
using testing_sets::transformed;
using testing_sets::wishart;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Solved {
  std::vector<double> efforts;
  ConstrainedCertificate proof;
};

Solved solved(const InformationSet& set, const DesignConstraints& constraints,
              const Criterion& criterion = {}, double gap = 1e-9) {
  SolveOptions options;
  options.duality_gap = gap;
  options.criterion = criterion;
  const ConstrainedSolution answer = solve_constrained(set, constraints, options);
  EXPECT_EQ(answer.status, SolveStatus::kSolved) << answer.message;
  Solved out{answer.efforts, certify_constrained(set, answer.efforts, constraints, criterion, gap)};
  EXPECT_TRUE(proves(out.proof.certificate, gap))
      << out.proof.certificate.duality_gap << " " << out.proof.certificate.message;
  return out;
}

// e_k e_k^T scaled.
InformationSet axes(const std::vector<double>& sizes) {
  std::vector<Eigen::MatrixXd> all;
  const auto d = static_cast<Eigen::Index>(sizes.size());
  for (Eigen::Index k = 0; k < d; ++k) {
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(d, d);
    h(k, k) = sizes[static_cast<std::size_t>(k)];
    all.push_back(h);
  }
  return from_matrices(all);
}

LinearConstraint row(const std::string& name, std::vector<double> coefficients, double lower,
                     double upper) {
  return {name, std::move(coefficients), lower, upper};
}

TEST(ConstrainedDesign, WithoutConstraintsItIsThePlainProblem) {
  const InformationSet set = wishart(5, 200, 2, 7);
  const Solved answer = solved(set, number_of_experiments(set, 1.0));
  const Solution plain = ColumnGeneration().solve(set, {.duality_gap = 1e-9});
  const Certificate proof = certify(set, plain.design);
  EXPECT_NEAR(answer.proof.certificate.log_det, proof.log_det, 1e-8);
  EXPECT_NEAR(answer.proof.multipliers[0], 1.0, 1e-8);
  const ConstrainedCertificate same =
      certify_constrained(set, plain.design.weights, number_of_experiments(set, 1.0));
  EXPECT_NEAR(same.certificate.duality_gap, proof.duality_gap, 1e-12);
}

// M = diag(x): sum of logarithms.
TEST(ConstrainedDesign, ALimitBindsInClosedForm) {
  const InformationSet set = axes({1.0, 2.0, 5.0});
  DesignConstraints constraints = number_of_experiments(set, 12.0);
  constraints.upper = {2.0, kInfinity, kInfinity};
  const Solved answer = solved(set, constraints);
  EXPECT_NEAR(answer.efforts[0], 2.0, 1e-9);
  EXPECT_NEAR(answer.efforts[1], 5.0, 1e-7);
  EXPECT_NEAR(answer.efforts[2], 5.0, 1e-7);
}

TEST(ConstrainedDesign, ABudgetIsSharedByCost) {
  const InformationSet set = axes({1.0, 2.0, 5.0});
  const Solved answer = solved(set, cost_budget({1.0, 3.0, 10.0}, 90.0));
  EXPECT_NEAR(answer.efforts[0], 30.0, 1e-6);
  EXPECT_NEAR(answer.efforts[1], 10.0, 1e-6);
  EXPECT_NEAR(answer.efforts[2], 3.0, 1e-6);
  EXPECT_NEAR(answer.proof.multipliers[0], 1.0 / 90.0, 1e-9);  // d log Phi / d B
}

// Water filling: p_k + x_k is equal where x_k > 0.
TEST(ConstrainedDesign, EarlierTrialsAreFilledUp) {
  const InformationSet set = axes({1.0, 1.0, 1.0});
  DesignConstraints constraints = number_of_experiments(set, 6.0);
  constraints.prior.assign(packed_size(3), 0.0);
  constraints.prior[packed_index(0, 0)] = 10.0;
  constraints.prior[packed_index(1, 1)] = 2.0;
  const Solved answer = solved(set, constraints);
  EXPECT_NEAR(answer.efforts[0], 0.0, 1e-8);
  EXPECT_NEAR(answer.efforts[1], 2.0, 1e-6);
  EXPECT_NEAR(answer.efforts[2], 4.0, 1e-6);
  EXPECT_NEAR(answer.proof.certificate.log_det, std::log(10.0 * 4.0 * 4.0), 1e-9);
}

TEST(ConstrainedDesign, APriorMakesASingularSetAProblem) {
  const InformationSet set = regression({Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0)});
  DesignConstraints constraints = number_of_experiments(set, 2.0);
  const ConstrainedSolution without = solve_constrained(
      regression({Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(1, 0, 1)}),
      number_of_experiments(regression({Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(0, 1, 0),
                                        Eigen::Vector3d(1, 0, 1)}),
                            3.0),
      {});
  EXPECT_EQ(without.status, SolveStatus::kSolved);
  constraints.prior.assign(packed_size(3), 0.0);
  constraints.prior[packed_index(2, 2)] = 4.0;
  const Solved answer = solved(set, constraints);
  EXPECT_NEAR(answer.efforts[0], 1.0, 1e-7);
  EXPECT_NEAR(answer.efforts[1], 1.0, 1e-7);
}

TEST(ConstrainedDesign, ARequiredCandidateIsRun) {
  const InformationSet set = wishart(4, 50, 4, 3);
  DesignConstraints constraints = number_of_experiments(set, 10.0);
  constraints.lower.assign(50, 0.0);
  constraints.lower[17] = 3.0;
  constraints.lower[18] = 1.0;
  const Solved answer = solved(set, constraints);
  EXPECT_GE(answer.efforts[17], 3.0);
  EXPECT_GE(answer.efforts[18], 1.0);
}

TEST(ConstrainedDesign, InvariantToCoordinatesAndScaleOfRows) {
  const InformationSet set = wishart(4, 60, 2, 11);
  DesignConstraints constraints = number_of_experiments(set, 8.0);
  constraints.upper.assign(60, 1.5);
  std::vector<double> half(60, 0.0);
  std::fill_n(half.begin(), 30, 1.0);
  constraints.rows.push_back(row("half", half, -kInfinity, 3.0));
  const Solved answer = solved(set, constraints);
  Random random(5);
  const Eigen::MatrixXd t = testing_sets::gaussian(4, 4, random);
  DesignConstraints scaled = constraints;
  for (double& a : scaled.rows[1].coefficients) a *= 1000.0;
  scaled.rows[1].upper *= 1000.0;
  const Solved other = solved(transformed(set, t), scaled);
  const double shift = 2.0 * std::log(std::abs(t.determinant()));
  EXPECT_NEAR(other.proof.certificate.log_det, answer.proof.certificate.log_det + shift, 1e-7);
  EXPECT_NEAR(other.proof.multipliers[1] * 1000.0, answer.proof.multipliers[1], 1e-6);
}

// Choosing half of the candidates: nearly all efforts are at a limit.
TEST(ConstrainedDesign, HalfOfAllCandidates) {
  const InformationSet set = wishart(4, 400, 1, 13);
  DesignConstraints constraints = number_of_experiments(set, 200.0);
  constraints.upper.assign(400, 1.0);
  const Solved answer = solved(set, constraints);
  const auto whole =
      std::ranges::count_if(answer.efforts, [](double x) { return x == 0.0 || x == 1.0; });
  EXPECT_GE(whole, 390 - static_cast<std::ptrdiff_t>(packed_size(4)));
}

TEST(ConstrainedDesign, MultipliersAreTheSlopeOfTheOptimum) {
  const InformationSet set = wishart(4, 80, 2, 17);
  std::vector<double> group(80, 0.0);
  std::fill_n(group.begin(), 40, 1.0);
  const auto optimum = [&](double limit) {
    DesignConstraints constraints = number_of_experiments(set, 10.0);
    constraints.rows.push_back(row("group", group, -kInfinity, limit));
    return solved(set, constraints, {}, 1e-11);
  };
  const Solved middle = optimum(2.0);
  const double slope =
      (optimum(2.01).proof.certificate.log_det - optimum(1.99).proof.certificate.log_det) / 0.02 /
      4.0;
  EXPECT_NEAR(middle.proof.multipliers[1], slope, 1e-5);
}

TEST(ConstrainedDesign, ContradictionsAreNamed) {
  const InformationSet set = wishart(3, 20, 3, 19);
  DesignConstraints constraints = number_of_experiments(set, 5.0);
  std::vector<double> few(20, 0.0), many(20, 1.0);
  few[0] = few[1] = 1.0;
  constraints.rows.push_back(row("few", few, 4.0, kInfinity));
  constraints.rows.push_back(row("others", many, -kInfinity, 100.0));
  constraints.upper.assign(20, kInfinity);
  constraints.upper[0] = constraints.upper[1] = 1.0;
  expect_refused([&] { (void)solve_constrained(set, constraints, {}); }, "'few' can't be met");
  constraints.upper.clear();
  std::vector<double> same = few;
  constraints.rows.push_back(row("at most three", same, -kInfinity, 3.0));
  expect_refused([&] { (void)solve_constrained(set, constraints, {}); },
                 "'few', 'at most three' can't be met together");
  constraints = number_of_experiments(set, 5.0);
  constraints.lower.assign(20, 1.0);
  expect_refused([&] { (void)solve_constrained(set, constraints, {}); }, "can't be met");
  constraints.lower.assign(20, 0.0);
  constraints.lower[4] = 2.0;
  constraints.upper.assign(20, 1.0);
  expect_refused([&] { (void)solve_constrained(set, constraints, {}); }, "candidate 4");
  expect_refused([&] { (void)number_of_experiments(set, -1.0); }, "positive");
  expect_refused([&] { (void)cost_budget({1.0, 0.0}, 5.0); }, "cost of candidate 1");
}

// Three groups share all of the experiments, whatever their number.
TEST(ConstrainedDesign, NoNumberOfExperimentsIsTooLargeOrTooSmall) {
  const InformationSet set = wishart(3, 30, 2, 31);
  for (const double number : {1e-6, 1.0, 1e4, 1e7, 1e9, 1e12}) {
    SCOPED_TRACE(number);
    DesignConstraints constraints = number_of_experiments(set, number);
    for (std::size_t group = 0; group < 3; ++group) {
      std::vector<double> members(30, 0.0);
      std::fill_n(members.begin() + static_cast<std::ptrdiff_t>(10 * group), 10, 1.0);
      const double share = (group < 2 ? 0.333 : 0.334) * number;
      constraints.rows.push_back(row("group", std::move(members), share, share));
    }
    (void)solved(set, constraints);
  }
}

TEST(ConstrainedDesign, TheCheckerRefusesWhatBreaksARow) {
  const InformationSet set = wishart(3, 20, 3, 23);
  DesignConstraints constraints = number_of_experiments(set, 4.0);
  std::vector<double> efforts(20, 0.2);
  EXPECT_EQ(certify_constrained(set, efforts, constraints).certificate.status,
            CertificateStatus::kCertified);
  efforts[0] += 1e-6;
  const ConstrainedCertificate broken = certify_constrained(set, efforts, constraints);
  EXPECT_EQ(broken.certificate.status, CertificateStatus::kNotADesign);
  EXPECT_NE(broken.certificate.message.find("number of experiments"), std::string::npos);
  efforts.assign(20, 0.2);
  constraints.upper.assign(20, 0.1);
  EXPECT_EQ(certify_constrained(set, efforts, constraints).certificate.status,
            CertificateStatus::kNotADesign);
}

// Any multipliers bound any design.
TEST(ConstrainedDesign, WeakDualityHoldsForAnyMultipliers) {
  Random random(29);
  for (int round = 0; round < 200; ++round) {
    constexpr std::size_t kCount = 12;
    DesignConstraints constraints;
    std::vector<double> costs(kCount), gains(kCount), x(kCount);
    for (double& c : costs) c = 0.1 + random.uniform();
    for (double& g : gains) g = random.normal();
    constraints = cost_budget(costs, 3.0);
    constraints.upper.assign(kCount, 2.0);
    std::vector<double> a(kCount);
    for (double& entry : a) entry = random.normal();
    constraints.rows.push_back(row("row", a, -1.0, 1.0));
    for (double& entry : x) entry = random.uniform();
    const double used = row_value(constraints.rows[0], x),
                 value = row_value(constraints.rows[1], x);
    const double shrink = std::min({1.0, 3.0 / used, 1.0 / std::max(std::abs(value), 1e-9)});
    double sum = 0.0;
    for (std::size_t i = 0; i < kCount; ++i) sum += gains[i] * shrink * x[i];
    const std::vector<double> y{3.0 * random.normal(), 3.0 * random.normal()};
    const auto bound = multiplier_bound<double>(constraints, {}, gains, y);
    EXPECT_GE(bound.value + 1e-12, sum);
    const LinearOptimum best = maximise_linear(constraints, {}, gains);
    EXPECT_GE(bound.value + 1e-9,
              std::inner_product(gains.begin(), gains.end(), best.efforts.begin(), 0.0));
    const auto tight = multiplier_bound<double>(constraints, {}, gains, best.multipliers);
    EXPECT_NEAR(tight.value,
                std::inner_product(gains.begin(), gains.end(), best.efforts.begin(), 0.0), 1e-8);
  }
}

// A random problem, with the value -log det (M) or tr M^-1 that NLopt's SLSQP minimises.
struct Instance {
  InformationSet set;
  DesignConstraints constraints;
  bool trace = false;

  [[nodiscard]] Eigen::MatrixXd matrix(const std::vector<double>& x) const {
    const auto d = static_cast<Eigen::Index>(set.dimension());
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(d, d);
    if (!constraints.prior.empty()) unpack(constraints.prior.data(), set.dimension(), m.data());
    for (std::size_t i = 0; i < x.size(); ++i) m += x[i] * matrix_of(set, i);
    return m;
  }
  // log Phi
  [[nodiscard]] double value(const std::vector<double>& x) const {
    const Eigen::LLT<Eigen::MatrixXd> factor(matrix(x));
    if (factor.info() != Eigen::Success) return -kInfinity;
    const auto d = static_cast<Eigen::Index>(set.dimension());
    if (trace) return -std::log(factor.solve(Eigen::MatrixXd::Identity(d, d)).trace());
    return 2.0 * factor.matrixLLT().diagonal().array().log().sum() / static_cast<double>(d);
  }
};

Instance random_instance(std::uint64_t seed) {
  Random random(seed);
  const auto d = static_cast<Eigen::Index>(1 + random.below(4));
  const std::size_t count = static_cast<std::size_t>(d) + 2 + random.below(20);
  Instance out{
      wishart(d, count, 1 + static_cast<Eigen::Index>(random.below(static_cast<std::uint64_t>(d))),
              seed * 7 + 1, 1.0),
      {},
      random.below(3) == 0};
  const double total = 1.0 + 9.0 * random.uniform();
  if (random.below(3) == 0) {
    std::vector<double> costs(count);
    for (double& c : costs) c = 0.3 + random.uniform();
    out.constraints = cost_budget(std::move(costs), total);
  } else {
    out.constraints = number_of_experiments(out.set, total);
  }
  if (random.below(2) == 0) out.constraints.upper.assign(count, 3.0 * total / double(count));
  if (random.below(3) == 0) {
    const InformationSet prior = wishart(d, 1, d, seed + 5);
    out.constraints.prior.assign(prior.information(0).begin(), prior.information(0).end());
  }
  for (std::uint64_t rows = random.below(4); rows > 0; --rows) {
    std::vector<double> a(count);
    for (double& entry : a) entry = random.below(2) == 0 ? 1.0 : 0.2 * random.normal();
    const double middle =
        total * std::accumulate(a.begin(), a.end(), 0.0) / static_cast<double>(count);
    const bool equal = random.below(4) == 0;
    out.constraints.rows.push_back(row("row", a, equal ? middle : -kInfinity, middle));
  }
  return out;
}

double negative_value(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  const auto& instance = *static_cast<const Instance*>(data);
  const double value = instance.value(x);
  if (!gradient.empty()) {
    const Eigen::MatrixXd inverse = instance.matrix(x).inverse();
    const double d = static_cast<double>(instance.set.dimension());
    const Eigen::MatrixXd g = instance.trace ? Eigen::MatrixXd(inverse * inverse / inverse.trace())
                                             : Eigen::MatrixXd(inverse / d);
    for (std::size_t i = 0; i < x.size(); ++i) {
      gradient[i] = -(g.cwiseProduct(matrix_of(instance.set, i))).sum();
    }
  }
  return std::isfinite(value) ? -value : 1e6;
}

struct RowOf {
  const LinearConstraint* row;
  double sign, bound;
};

double row_excess(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  const auto& of = *static_cast<const RowOf*>(data);
  if (!gradient.empty()) {
    for (std::size_t i = 0; i < x.size(); ++i) gradient[i] = of.sign * of.row->coefficients[i];
  }
  return of.sign * (row_value(*of.row, x) - of.bound);
}

// The best that SLSQP finds within the constraints; minus infinity where it fails.
double slsqp(Instance& instance) {
  const std::size_t count = instance.set.candidate_count();
  const DesignConstraints& constraints = instance.constraints;
  nlopt::opt optimiser(nlopt::LD_SLSQP, static_cast<unsigned>(count));
  std::vector<double> lower(count, 0.0), upper(count), start(count);
  for (std::size_t i = 0; i < count; ++i) {
    upper[i] = constraints.largest_effort(i);
    start[i] = upper[i] / static_cast<double>(3 * count) + 1e-3;
  }
  optimiser.set_lower_bounds(lower);
  optimiser.set_upper_bounds(upper);
  optimiser.set_min_objective(&negative_value, &instance);
  std::vector<RowOf> rows;
  rows.reserve(2 * constraints.rows.size());
  for (const LinearConstraint& of : constraints.rows) {
    if (of.lower == of.upper) {
      rows.push_back({&of, 1.0, of.upper});
      optimiser.add_equality_constraint(&row_excess, &rows.back(), 1e-10);
      continue;
    }
    rows.push_back({&of, 1.0, of.upper});
    optimiser.add_inequality_constraint(&row_excess, &rows.back(), 1e-10);
  }
  optimiser.set_ftol_rel(1e-12);
  optimiser.set_maxeval(2000);
  double least = 0.0;
  try {
    optimiser.optimize(start, least);
  } catch (const std::exception&) {
    return -kInfinity;
  }
  return largest_violation(constraints, start) < 1e-8 ? instance.value(start) : -kInfinity;
}

// 500 instances: the certificate is never contradicted by another solver's design.
TEST(ConstrainedDesign, AnIndependentSolverFindsNothingBetter) {
  int compared = 0, reached = 0, refused = 0;
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    SCOPED_TRACE(seed);
    Instance instance = random_instance(seed);
    const Criterion criterion = instance.trace ? Criterion::a() : Criterion();
    SolveOptions options;
    options.duality_gap = 1e-8;
    options.criterion = criterion;
    const ConstrainedSolution answer = try_constrained(instance.set, instance.constraints, options);
    if (answer.infeasible || answer.status == SolveStatus::kUnsupported) {
      ++refused;
      continue;
    }
    ASSERT_EQ(answer.status, SolveStatus::kSolved) << answer.message;
    const Certificate proof =
        certify_constrained(instance.set, answer.efforts, instance.constraints, criterion, 1e-8)
            .certificate;
    ASSERT_TRUE(proves(proof, 1e-8)) << proof.duality_gap;
    const double other = slsqp(instance);
    if (!std::isfinite(other)) continue;
    ++compared;
    const double own = instance.value(answer.efforts);
    EXPECT_LE(other, own + std::log1p(largest_gap(proof)) + 1e-8);  // rows broken by 1e-8
    reached += other > own - 1e-4 ? 1 : 0;
  }
  EXPECT_LE(refused, 60);
  EXPECT_GE(compared, 350);
  EXPECT_GE(reached, compared * 3 / 4);
}

}  // namespace
}  // namespace graybox
