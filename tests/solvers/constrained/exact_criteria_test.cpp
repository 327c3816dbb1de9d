// Exact designs under E, G, phi_p and several criteria at once: closed forms, and the enumeration
// of all designs by values that are computed here.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained_exact/constrained_exact.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox {
namespace {

using testing_sets::from_matrices;
using testing_sets::gaussian;
using testing_sets::matrix_of;
using testing_sets::wishart;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double largest_variance(const InformationSet& set, const Criterion& criterion,
                        const Eigen::MatrixXd& covariance) {
  double largest = 0.0;
  if (criterion.region().count() == 0) {
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      largest = std::max(largest, (covariance * matrix_of(set, i)).trace());
    }
    return largest;
  }
  const std::span<const double> rows = criterion.region().rows();
  const auto d = static_cast<Eigen::Index>(set.dimension());
  const Eigen::Map<const Eigen::MatrixXd> points(rows.data(), d,
                                                 static_cast<Eigen::Index>(rows.size()) / d);
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    largest = std::max(largest, points.col(j).dot(covariance * points.col(j)));
  }
  return largest;
}

// log Phi from eigenvalues; minus infinity where M is singular.
double value_of(const InformationSet& set, const Criterion& criterion, const Eigen::MatrixXd& m) {
  if (criterion.kind() == CriterionKind::kCompound) {
    double sum = 0.0;
    for (const CriterionPart& part : criterion.parts()) {
      sum += part.share * value_of(set, part.criterion, m);
    }
    return sum;
  }
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m).eigenvalues();
  if (values(0) <= 1e-12 * values(values.size() - 1)) return -kInfinity;
  switch (criterion.kind()) {
    case CriterionKind::kE:
      return std::log(values(0));
    case CriterionKind::kA:
      return -std::log(values.cwiseInverse().sum());
    case CriterionKind::kPhiP:
      return -std::log(values.array().pow(-criterion.p()).mean()) / criterion.p();
    case CriterionKind::kG:
      return -std::log(largest_variance(set, criterion, m.inverse()));
    default:
      return values.array().log().mean();
  }
}

struct EnumeratedCase {
  InformationSet set;
  DesignConstraints constraints;
  Criterion criterion;

  [[nodiscard]] double value(const std::vector<std::int64_t>& counts) const {
    const auto d = static_cast<Eigen::Index>(set.dimension());
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(d, d);
    if (!constraints.prior.empty()) {
      unpack(constraints.prior.data(), set.dimension(), m.data());
    }
    for (std::size_t i = 0; i < counts.size(); ++i) {
      m += static_cast<double>(counts[i]) * matrix_of(set, i);
    }
    return value_of(set, criterion, m);
  }

  // The best of all designs.
  [[nodiscard]] double best() const {
    double largest = -kInfinity;
    std::vector<std::int64_t> counts(set.candidate_count(), 0);
    const auto visit = [&](const auto& self, std::size_t i) -> void {
      if (i == counts.size()) {
        if (obeys(constraints, counts)) largest = std::max(largest, value(counts));
        return;
      }
      const auto most = static_cast<std::int64_t>(constraints.largest_effort(i) + 1e-9);
      for (counts[i] = 0; counts[i] <= most; ++counts[i]) self(self, i + 1);
      counts[i] = 0;
    };
    visit(visit, 0);
    return largest;
  }
};

Criterion criterion_number(std::size_t kind, Eigen::Index d, Random& random) {
  const auto region = [&] {
    const Eigen::MatrixXd rows = gaussian(d, 4, random);
    return Criterion::g(PredictionRegion::of_regressors(static_cast<std::size_t>(d),
                                                        {rows.data(), rows.data() + rows.size()}));
  };
  switch (kind) {
    case 0:
      return Criterion::e();
    case 1:
      return region();
    case 2:
      return Criterion::g();
    case 3:
      return Criterion::phi_p(0.5);
    case 4:
      return Criterion::phi_p(20.0);
    case 5:
      return Criterion::compound(
          {{.share = 0.6, .criterion = Criterion()}, {.share = 0.4, .criterion = Criterion::e()}});
    default:
      return Criterion::compound(
          {{.share = 0.5, .criterion = Criterion::a()}, {.share = 0.5, .criterion = region()}});
  }
}

EnumeratedCase random_case(std::uint64_t seed) {
  Random random(seed);
  const auto d = static_cast<Eigen::Index>(2 + random.below(2));
  const std::size_t count = 5 + random.below(2);
  EnumeratedCase out{
      wishart(d, count, static_cast<Eigen::Index>(1 + random.below(3)), 7 * seed + 3),
      {},
      criterion_number(seed % 7, d, random)};
  out.constraints = number_of_experiments(out.set, 4.0 + static_cast<double>(random.below(2)));
  if (random.below(2) == 0) out.constraints.upper.assign(count, 2.0);
  if (random.below(3) == 0) {
    const InformationSet prior = wishart(d, 1, d, seed + 11);
    out.constraints.prior.assign(prior.information(0).begin(), prior.information(0).end());
  }
  if (random.below(2) == 0) {
    std::vector<double> first_three(count, 0.0);
    std::fill_n(first_three.begin(), 3, 1.0);
    out.constraints.rows.push_back({"group", std::move(first_three), -kInfinity, 3.0});
  }
  return out;
}

TEST(ExactCriteria, NoEnumeratedDesignIsBetter) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 210; ++seed) {
    SCOPED_TRACE(seed);
    const EnumeratedCase instance = random_case(seed);
    const double best = instance.best();
    const ConstrainedExactSolution answer = solve_constrained_exact(
        instance.set, instance.constraints, {.criterion = instance.criterion});
    if (!std::isfinite(best)) {
      EXPECT_TRUE(answer.designs.empty());
      continue;
    }
    ++found;
    ASSERT_EQ(answer.status, ExactStatus::kOptimal) << answer.message;
    const RankedDesign& design = answer.designs.front();
    EXPECT_TRUE(obeys(instance.constraints, design.counts));
    EXPECT_NEAR(instance.value(design.counts), design.value, 1e-9);
    EXPECT_NEAR(design.value, best, 1.1e-6);
    EXPECT_GE(answer.value_bound + 1e-9, best);
  }
  EXPECT_GE(found, 180);
}

// M = diag(m): E and G over the axes want the smallest count as large as it can be.
TEST(ExactCriteria, SeparateParametersHaveAClosedForm) {
  std::vector<Eigen::MatrixXd> axes;
  for (Eigen::Index k = 0; k < 4; ++k) {
    axes.push_back(Eigen::MatrixXd::Zero(4, 4));
    axes.back()(k, k) = 1.0;
  }
  const InformationSet set = from_matrices(axes);
  for (const Criterion& criterion : {Criterion::e(), Criterion::g()}) {
    for (const double runs : {4.0, 7.0, 11.0, 12.0}) {
      const ConstrainedExactSolution answer =
          solve_constrained_exact(set, number_of_experiments(set, runs), {.criterion = criterion});
      ASSERT_EQ(answer.status, ExactStatus::kOptimal);
      EXPECT_NEAR(answer.designs.front().value, std::log(std::floor(runs / 4.0)), 1e-9);
    }
  }
}

// What the report states is what the checker finds in extended precision.
TEST(ExactCriteria, TheReportHasTheCheckersValue) {
  for (std::size_t kind = 0; kind < 7; ++kind) {
    SCOPED_TRACE(kind);
    Random random(kind + 1);
    const InformationSet set = wishart(3, 12, 2, kind + 40);
    const Criterion criterion = criterion_number(kind, 3, random);
    const DesignConstraints constraints = number_of_experiments(set, 6.0);
    const ConstrainedExactOptions options{.gap = 1e-5, .criterion = criterion};
    DesignRequest request;
    request.experiments = 6.0;
    const ConstrainedExactReport report = report_constrained_exact(
        set, options, solve_constrained_exact(set, constraints, options), request, constraints);
    ASSERT_EQ(report.solution.status, ExactStatus::kOptimal);
    EXPECT_GE(report.proven_efficiency, 1.0 - 1.1e-5);
    EXPECT_NEAR(report.value, report.solution.designs.front().value, 1e-10);
  }
}

// E and G beside other criteria under constraints: no random design passes the certificate's bound.
TEST(ExactCriteria, RelaxedDesignsOfSeveralCriteriaAreCertified) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    EnumeratedCase instance = random_case(seed);
    Random random(seed + 900);
    const auto d = static_cast<Eigen::Index>(instance.set.dimension());
    instance.criterion = criterion_number(5 + seed % 2, d, random);
    SolveOptions options;
    options.duality_gap = 1e-5;
    options.criterion = instance.criterion;
    const ConstrainedSolution answer =
        solve_constrained(instance.set, instance.constraints, options);
    if (answer.status == SolveStatus::kUnsupported) continue;
    EXPECT_EQ(answer.status, SolveStatus::kSolved) << answer.message;
    const Certificate proof = certify_constrained(instance.set, answer.efforts,
                                                  instance.constraints, instance.criterion, 1e-5)
                                  .certificate;
    EXPECT_TRUE(proves(proof, 1e-5)) << proof.duality_gap;
    const double bound = proof.criterion_value + std::log1p(largest_gap(proof));
    EXPECT_GE(bound + 1e-12, instance.best());
  }
}

}  // namespace
}  // namespace graybox
