// The criteria c, I, G, phi_p and compound: closed forms, theorems, invariances, and hundreds of
// random problems against NLopt, which knows nothing of graybox's gradients and certificates.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/registry.hpp"
#include "tests/support/criterion_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

PredictionRegion region_of(const std::vector<VectorXd>& points) {
  std::vector<double> rows;
  for (const VectorXd& f : points) rows.insert(rows.end(), f.begin(), f.end());
  return PredictionRegion::of_regressors(static_cast<std::size_t>(points.front().size()), rows);
}

std::vector<VectorXd> polynomials(int degree, const std::vector<double>& at) {
  std::vector<VectorXd> all;
  for (const double x : at) {
    const std::vector<double> f = powers(x, degree);
    all.emplace_back(Eigen::Map<const VectorXd>(f.data(), degree + 1));
  }
  return all;
}

Criterion combination(const VectorXd& c) {
  return Criterion::c(packed(MatrixXd(c * c.transpose())));
}

// log Phi from the definition of the criterion alone; minus infinity where M is singular.
double log_goodness(const MatrixXd& m, const Criterion& criterion) {
  const double nothing = -std::numeric_limits<double>::infinity();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(m);
  if (!(eigen.eigenvalues()(0) > 1e-13 * eigen.eigenvalues()(m.rows() - 1))) return nothing;
  const MatrixXd covariance = m.inverse();
  switch (criterion.kind()) {
    case CriterionKind::kPhiP:
      return -std::log(eigen.eigenvalues().array().pow(-criterion.p()).mean()) / criterion.p();
    case CriterionKind::kG: {
      double worst = 0.0;
      const auto rows = criterion.region().rows();
      const auto counts = criterion.region().row_counts();
      for (std::size_t j = 0, at = 0; j < counts.size(); ++j) {
        double variance = 0.0;
        for (std::size_t r = 0; r < counts[j]; ++r, at += criterion.region().dimension()) {
          const Eigen::Map<const VectorXd> f(rows.data() + at, m.rows());
          variance += f.dot(covariance * f);
        }
        worst = std::max(worst, variance);
      }
      return -std::log(worst);
    }
    case CriterionKind::kCompound: {
      double sum = 0.0;
      for (const CriterionPart& part : criterion.parts()) {
        sum += part.share * log_goodness(m, part.criterion);
      }
      return sum;
    }
    default:
      return std::log(goodness(m, criterion));
  }
}

Certificate solved(const InformationSet& set, const Criterion& criterion, double gap,
                   Design* out = nullptr) {
  const Solution solution =
      ColumnGeneration().solve(set, {.duality_gap = gap, .criterion = criterion});
  EXPECT_EQ(solution.status, SolveStatus::kSolved)
      << to_string(criterion.kind()) << ": " << solution.message;
  const Certificate proof = certify(set, solution.design, criterion, gap);
  EXPECT_EQ(proof.status, CertificateStatus::kCertified);
  EXPECT_TRUE(proves(proof, 1.1 * gap))
      << to_string(criterion.kind()) << " " << proof.duality_gap << " +- " << proof.rounding_bound;
  if (out != nullptr) *out = solution.design;
  return proof;
}

// Elfving 1952, on 1, x, x^2 over [-1, 1]: the curvature takes 1/4, 1/2, 1/4 and has variance 4;
// the slope 1/2 at each end, a singular design, and variance 1; the prediction at 2 has 7^2.
TEST(MoreCriteria, CombinationsOfAQuadraticAreElfvings) {
  const InformationSet set = polynomial(2, even_grid(20));
  Design design;
  const Certificate curvature = solved(set, combination(VectorXd::Unit(3, 2)), 1e-9, &design);
  EXPECT_NEAR(curvature.criterion_value, 4.0, 1e-8);
  EXPECT_NEAR(design.weights[0], 0.25, 1e-4);
  EXPECT_NEAR(design.weights[20], 0.5, 1e-4);
  const Certificate slope = solved(set, combination(VectorXd::Unit(3, 1)), 1e-7, &design);
  EXPECT_NEAR(slope.criterion_value, 1.0, 1e-6);
  EXPECT_NEAR(design.weights[0] + design.weights[40], 1.0, 1e-2);
  const Certificate outside = solved(set, combination(polynomials(2, {2.0})[0]), 1e-9);
  EXPECT_NEAR(outside.criterion_value, 49.0, 1e-6);
}

// I over [-1, 1] of a quadratic, W its moments: 1/4, 1/2, 1/4 with mean variance 32/15.
TEST(MoreCriteria, MeanVarianceOfAQuadraticIsKnown) {
  const InformationSet set = polynomial(2, even_grid(20));
  MatrixXd moments(3, 3);
  moments << 1.0, 0.0, 1.0 / 3, 0.0, 1.0 / 3, 0.0, 1.0 / 3, 0.0, 0.2;
  Design design;
  const Certificate proof = solved(set, Criterion::i(packed(moments)), 1e-9, &design);
  EXPECT_NEAR(proof.criterion_value, 32.0 / 15, 1e-8);
  EXPECT_NEAR(design.weights[20], 0.5, 1e-4);
  // A region of many points has nearly these moments, exactly those of its points.
  const PredictionRegion fine = region_of(polynomials(2, even_grid(500)));
  const Certificate same = solved(set, Criterion::i(fine.mean_information()), 1e-9);
  EXPECT_NEAR(same.criterion_value, 32.0 / 15, 0.02);
  EXPECT_EQ(mean_information(set), region_of(polynomials(2, even_grid(20))).mean_information());
}

// Kiefer and Wolfowitz 1960: over the candidates G is D, the least largest variance is d. The
// region's own method finds it too, and the weights of either design prove it optimal.
TEST(MoreCriteria, OverTheCandidatesGIsD) {
  for (const int degree : {1, 2, 3, 5}) {
    const std::vector<double> grid = even_grid(30);
    const InformationSet set = polynomial(degree, grid);
    const Criterion region = Criterion::g(region_of(polynomials(degree, grid)));
    Design by_region, by_d;
    const Certificate g = solved(set, region, 1e-6, &by_region);
    const Certificate d = solved(set, Criterion::g(), 1e-9, &by_d);
    const double rounding = 1e-14;  // of what follows
    EXPECT_NEAR(g.criterion_value, degree + 1.0, (largest_gap(g) + rounding) * (degree + 1.0));
    EXPECT_NEAR(d.criterion_value, degree + 1.0, (largest_gap(d) + rounding) * (degree + 1.0));
    EXPECT_TRUE(proves(certify(set, by_region), largest_gap(g) + rounding));
    EXPECT_EQ(certify(set, by_d).duality_gap, certify(set, by_d, Criterion::g()).duality_gap);
    // The checker looks for weights of the points itself. With those of the design, g the gap of D,
    // it compares d (1 + g) with d / (1 + g) (dual_bound.hpp).
    EXPECT_TRUE(proves(certify(set, by_d, region), 1e-5));
    by_d.dual_weights = by_d.weights;
    EXPECT_TRUE(proves(certify(set, by_d, region), 2.0 * largest_gap(d) + rounding));
  }
}

// Several responses: the trace keeps the theorem, for sum_i lambda_i tr(M^-1 H_i) = d.
TEST(MoreCriteria, OverTheCandidatesGIsDForSeveralResponses) {
  const InformationSet set = wishart(4, 60, 3, 11);
  const Criterion region = Criterion::g(PredictionRegion::of_set(set));
  EXPECT_NEAR(solved(set, region, 1e-7).criterion_value, 4.0, 1e-6);
  EXPECT_NEAR(solved(set, Criterion::g(), 1e-9).criterion_value, 4.0, 1e-7);
}

// A straight line observed on [-1, 1]. At one point the optimum is c's, (|x|)^2 for |x| > 1; at
// both of +-3 it is half and half with 1 + 9.
TEST(MoreCriteria, ExtrapolationOfALineIsKnown) {
  const InformationSet set = polynomial(1, even_grid(10));
  const Certificate one = solved(set, Criterion::g(region_of(polynomials(1, {3.0}))), 1e-7);
  EXPECT_NEAR(one.criterion_value, 9.0, 1e-5);
  const Certificate both = solved(set, Criterion::g(region_of(polynomials(1, {3.0, -3.0}))), 1e-8);
  EXPECT_NEAR(both.criterion_value, 10.0, 1e-6);
  const Certificate ends =
      solved(set, Criterion::g(region_of(polynomials(1, {-1.0, 0.3, 2.0}))), 1e-8);
  double best = std::numeric_limits<double>::infinity();
  for (int k = 1; k < 20000; ++k) {
    const double share = k / 20000.0;  // at x = 1, the rest at -1
    const double mean = 2.0 * share - 1.0, spread = 1.0 - mean * mean;
    const auto variance = [&](double x) { return 1.0 + (x - mean) * (x - mean) / spread; };
    best = std::min(best, std::max({variance(-1.0), variance(0.3), variance(2.0)}));
  }
  EXPECT_NEAR(ends.criterion_value, best, 1e-3);
  EXPECT_LE(ends.criterion_value, best * (1.0 + 1e-7));
}

// H_i = s_i e_i e_i^T: minimise sum (s_i lambda_i)^-p, so lambda_i as s_i^(-p/(p+1)).
TEST(MoreCriteria, KiefersMeansOfOrthogonalCandidatesAreKnown) {
  const std::vector<double> sizes{1.0, 4.0, 0.25, 9.0, 16.0};
  for (const double p : {1e-8, 1e-3, 0.1, 0.5, 1.0, 2.0, 3.7, 10.0, 30.0, 100.0, 300.0}) {
    SCOPED_TRACE(p);
    Design design;
    const Certificate proof = solved(orthogonal(sizes), Criterion::phi_p(p), 1e-9, &design);
    double sum = 0.0, mean = 0.0;
    for (const double s : sizes) sum += std::pow(s, -p / (p + 1.0));
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const double weight = std::pow(sizes[i], -p / (p + 1.0)) / sum;
      EXPECT_NEAR(design.weights[i], weight, 1e-4);
      mean += std::pow(sizes[i] * weight, -p) / 5.0;
    }
    const double value = std::pow(mean, 1.0 / p);
    if (p < 1e-5) continue;
    EXPECT_NEAR(proof.criterion_value, value, 1e-8 * value);
  }
}

TEST(MoreCriteria, KiefersMeansReachFromDOverAToE) {
  const InformationSet set = wishart(4, 80, 2, 3, 1.0);
  const Design uniform{std::vector<double>(80, 1.0 / 80)};
  const Certificate a = certify(set, uniform, Criterion::a());
  const Certificate one = certify(set, uniform, Criterion::phi_p(1.0));
  EXPECT_NEAR(one.duality_gap, a.duality_gap, 1e-13 * (1.0 + a.duality_gap));
  EXPECT_NEAR(4.0 * one.criterion_value, a.criterion_value, 1e-13 * a.criterion_value);
  const Certificate d = certify(set, uniform);
  const Certificate small = certify(set, uniform, Criterion::phi_p(1e-9));
  EXPECT_NEAR(small.duality_gap, d.duality_gap, 1e-6);
  EXPECT_NEAR(std::log(small.criterion_value), -d.log_det / 4.0, 1e-6);
  const double smallest = solved(set, Criterion::e(), 1e-9).criterion_value;
  double last = 0.0;
  for (const double p : {1.0, 4.0, 16.0, 64.0, 256.0}) {
    SCOPED_TRACE(p);
    const double value = 1.0 / solved(set, Criterion::phi_p(p), 1e-8).criterion_value;
    EXPECT_GE(value, smallest * (1.0 - 1e-7));
    EXPECT_LE(value, smallest * std::pow(4.0, 1.0 / p) * (1.0 + 1e-7));  // d^(1/p)
    last = value;
  }
  EXPECT_NEAR(last, smallest, 0.01 * smallest);
  EXPECT_EQ(Criterion::phi_p(0.0), Criterion());
  EXPECT_EQ(Criterion::phi_p(std::numeric_limits<double>::infinity()), Criterion::e());
}

std::vector<Criterion> criteria_for(Index d, Random& random) {
  std::vector<VectorXd> points;
  for (int j = 0; j < 7; ++j) points.emplace_back(gaussian(d, 1, random));
  const PredictionRegion region = region_of(points);
  MatrixXd two = gaussian(d, 2, random);
  const Criterion thin = Criterion::c(packed(MatrixXd(two * two.transpose())));
  return {combination(gaussian(d, 1, random)),
          thin,
          Criterion::i(region.mean_information()),
          Criterion::g(region),
          Criterion::phi_p(0.3),
          Criterion::phi_p(2.0),
          Criterion::phi_p(20.0),
          Criterion::compound({{0.5, Criterion()}, {1.5, Criterion::a()}}),
          Criterion::compound({{0.3, Criterion::ds({0})}, {0.7, Criterion::phi_p(3.0)}}),
          Criterion::compound({{0.2, Criterion::ds({static_cast<std::size_t>(d) - 1})},
                               {0.5, thin},
                               {0.3, Criterion::ds({0})}})};
}

std::vector<double> random_weights(std::size_t count, Random& random) {
  std::vector<double> weights(count);
  double sum = 0.0;
  for (double& w : weights) sum += w = -std::log(1.0 - random.uniform());
  for (double& w : weights) w /= sum;
  return weights;
}

// The best log Phi that NLopt's SLSQP finds on the simplex, from differences of the definition. G:
// the largest variance by its bound t >= log of each.
class ByNlopt {
 public:
  ByNlopt(const InformationSet& set, const Criterion& criterion)
      : set_(set), criterion_(criterion) {
    const PredictionRegion& region = criterion.region();
    for (std::size_t j = 0; j < region.count(); ++j) {
      const auto row = region.rows().subspan(j * region.dimension(), region.dimension());
      points_.push_back(Criterion::g(PredictionRegion::of_regressors(
          region.dimension(), std::vector<double>(row.begin(), row.end()))));
    }
  }

  double best() {
    const std::size_t q = set_.candidate_count(), n = q + (points_.empty() ? 0 : 1);
    nlopt::opt problem(nlopt::LD_SLSQP, static_cast<unsigned>(n));
    std::vector<double> lower(n, 0.0), x(n, 1.0 / static_cast<double>(q));
    if (!points_.empty()) {
      lower.back() = -1e3;
      x.back() = -log_phi(criterion_, x) + 0.1;
    }
    problem.set_lower_bounds(lower);
    problem.set_max_objective(&ByNlopt::objective, this);
    problem.add_equality_constraint(&ByNlopt::sum, this, 1e-12);
    std::vector<std::pair<ByNlopt*, const Criterion*>> each;
    for (const Criterion& point : points_) each.emplace_back(this, &point);
    for (auto& pair : each) problem.add_inequality_constraint(&ByNlopt::below, &pair, 1e-10);
    problem.set_ftol_rel(1e-13);
    problem.set_maxeval(2000);
    double value = 0.0;
    try {
      problem.optimize(x, value);
    } catch (const std::exception&) {
      // What it reached counts.
    }
    return log_phi(criterion_, x);
  }

 private:
  [[nodiscard]] double log_phi(const Criterion& criterion, const std::vector<double>& x) const {
    std::vector<double> weights(x.begin(),
                                x.begin() + static_cast<std::ptrdiff_t>(set_.candidate_count()));
    double total = 0.0;
    for (double& w : weights) total += w = std::max(w, 0.0);
    for (double& w : weights) w /= total;
    return log_goodness(information_of(set_, weights), criterion);
  }

  // At x, not on the simplex: of M itself.
  double value_and_slope(const Criterion& criterion, const std::vector<double>& x,
                         std::vector<double>& slope) const {
    const auto at = [&](const std::vector<double>& y) {
      const std::vector<double> weights(
          y.begin(), y.begin() + static_cast<std::ptrdiff_t>(set_.candidate_count()));
      const double value = log_goodness(information_of(set_, weights), criterion);
      return std::isfinite(value) ? value : -1e3;
    };
    if (!slope.empty()) {
      std::vector<double> y = x;
      for (std::size_t i = 0; i < set_.candidate_count(); ++i) {
        constexpr double kStep = 1e-6;
        y[i] = x[i] + kStep;
        const double up = at(y);
        y[i] = x[i] - kStep;
        slope[i] = (up - at(y)) / (2.0 * kStep);
        y[i] = x[i];
      }
    }
    return at(x);
  }

  static double objective(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    auto& self = *static_cast<ByNlopt*>(data);
    if (self.points_.empty()) return self.value_and_slope(self.criterion_, x, slope);
    std::ranges::fill(slope, 0.0);
    if (!slope.empty()) slope.back() = -1.0;
    return -x.back();
  }
  static double sum(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    const auto& self = *static_cast<ByNlopt*>(data);
    const std::size_t q = self.set_.candidate_count();
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = i < q ? 1.0 : 0.0;
    return std::accumulate(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(q), -1.0);
  }
  static double below(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    const auto& [self, point] = *static_cast<std::pair<ByNlopt*, const Criterion*>*>(data);
    const double value = self->value_and_slope(*point, x, slope);
    for (double& each : slope) each = -each;
    if (!slope.empty()) slope.back() = -1.0;
    return -value - x.back();
  }

  const InformationSet& set_;
  const Criterion& criterion_;
  std::vector<Criterion> points_;
};

// 500 problems. No design that NLopt finds may beat a certificate, and none may be better than
// graybox's by more than the gap that was certified.
TEST(MoreCriteria, NloptBeatsNoCertificate) {
  Random random(2024);
  int compared = 0, close = 0;
  for (unsigned round = 0; round < 50; ++round) {
    const Index d = 2 + round % 3;
    const InformationSet set =
        wishart(d, 5 + round % 7, 1 + static_cast<Index>(round) % 2, 900 + round, 0.5);
    for (const Criterion& criterion : criteria_for(d, random)) {
      SCOPED_TRACE(std::string(to_string(criterion.kind())) + " round " + std::to_string(round));
      Design design;
      const Certificate proof = solved(set, criterion, 1e-6, &design);
      const double reached = log_goodness(information_of(set, design.weights), criterion);
      const double rival = ByNlopt(set, criterion).best();
      EXPECT_LE(rival, reached + std::log1p(largest_gap(proof)) + 1e-9);
      const Design other{random_weights(set.candidate_count(), random)};
      const Certificate loose = certify(set, other, criterion);
      const double start = log_goodness(information_of(set, other.weights), criterion);
      EXPECT_LE(std::max(reached, rival), start + std::log1p(largest_gap(loose)) + 1e-9);
      close += rival > reached - 1e-4 ? 1 : 0;
      ++compared;
    }
  }
  EXPECT_EQ(compared, 500);
  EXPECT_GE(close, 400);  // NLopt is a rival in most
}

// The gap is max tr(G H_i) - 1 with G the gradient of log Phi: central differences.
TEST(MoreCriteria, SensitivitiesAreTheGradientOfTheLogarithm) {
  Random random(8);
  const InformationSet set = wishart(5, 20, 2, 9);
  const std::vector<double> weights = random_weights(20, random);
  const MatrixXd m = information_of(set, weights);
  for (const Criterion& criterion : criteria_for(5, random)) {
    if (criterion.kind() == CriterionKind::kG) continue;
    double largest = 0.0;
    for (std::size_t i = 0; i < 20; ++i) {
      const MatrixXd h = 1e-4 * matrix_of(set, i);
      const double rise = log_goodness(m + h, criterion) - log_goodness(m - h, criterion);
      largest = std::max(largest, rise / 2e-4);
    }
    const Certificate proof = certify(set, {weights}, criterion);
    EXPECT_NEAR(proof.duality_gap, largest - 1.0, 1e-5 * largest) << to_string(criterion.kind());
    EXPECT_LE(proof.rounding_bound, 1e-12);
    const double value = log_goodness(m, criterion);
    const bool is_log = criterion.kind() == CriterionKind::kCompound;
    EXPECT_NEAR(is_log ? proof.criterion_value : -std::log(proof.criterion_value), value, 1e-10);
  }
}

TEST(MoreCriteria, ScalingPermutationDuplicatesAndRotationsChangeNoGap) {
  Random random(12);
  const Index d = 4;
  const InformationSet set = wishart(d, 25, 2, 31);
  const std::vector<double> weights = random_weights(25, random);
  std::vector<MatrixXd> scaled = matrices_of(set);
  for (MatrixXd& h : scaled) h *= 1e5;
  std::vector<std::size_t> reversed(25);
  std::iota(reversed.rbegin(), reversed.rend(), std::size_t{0});
  std::vector<double> halves(weights);
  halves.insert(halves.end(), weights.begin(), weights.end());
  for (double& w : halves) w *= 0.5;
  const MatrixXd rotation = Eigen::HouseholderQR<MatrixXd>(gaussian(d, d, random)).householderQ() *
                            MatrixXd::Identity(d, d);
  for (const Criterion& criterion : criteria_for(d, random)) {
    SCOPED_TRACE(to_string(criterion.kind()));
    const double gap = certify(set, {weights}, criterion).duality_gap;
    const double tolerance =
        criterion.kind() == CriterionKind::kG ? 1e-5 : 1e-10;  // its mu is found
    EXPECT_NEAR(certify(from_matrices(scaled), {weights}, criterion).duality_gap, gap, tolerance);
    const std::vector<double> backwards(weights.rbegin(), weights.rend());
    EXPECT_NEAR(certify(set.subset(reversed), {backwards}, criterion).duality_gap, gap, tolerance);
    EXPECT_NEAR(certify(concatenated(set, set), {halves}, criterion).duality_gap, gap, tolerance);
    if (criterion.kind() != CriterionKind::kPhiP) continue;
    EXPECT_NEAR(certify(transformed(set, rotation), {weights}, criterion).duality_gap, gap, 1e-10);
  }
}

TEST(MoreCriteria, ACompoundOfOneIsThatOne) {
  Random random(5);
  const InformationSet set = wishart(4, 40, 2, 77);
  const Design design{random_weights(40, random)};
  for (const Criterion& one :
       {Criterion(), Criterion::a(), Criterion::ds({1, 2}), Criterion::phi_p(2.5)}) {
    const Criterion alone = Criterion::compound({{3.0, one}});
    const Certificate a = certify(set, design, one), b = certify(set, design, alone);
    EXPECT_NEAR(a.duality_gap, b.duality_gap, 1e-12 * (1.0 + a.duality_gap));
    EXPECT_NEAR(solved(set, alone, 1e-9).criterion_value,
                log_goodness(information_of(set,
                                            [&] {
                                              Design best;
                                              solved(set, one, 1e-9, &best);
                                              return best.weights;
                                            }()),
                             one),
                2e-9);
  }
}

// Whatever weights of the points come with a design of G, the efficiency certified is not above
// the true one.
TEST(MoreCriteria, WrongWeightsOfPointsCanOnlyLoosenTheBound) {
  Random random(7);
  const InformationSet set = polynomial(1, even_grid(10));
  const Criterion g = Criterion::g(region_of(polynomials(1, {3.0, -3.0, 0.0})));
  std::vector<double> weights(21, 1.0 / 21);
  const double value = 1.0 + 9.0 / (0.5 * 1.1 / 1.5);  // the mean of x^2 is 11/30
  const double efficiency = 10.0 / value;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::vector<double>> duals{{},
                                         {1.0},
                                         {nan, nan, nan},
                                         {0, 0, 0},
                                         {-1, -1, -1},
                                         {1e300, 1e300, 1e300},
                                         {1e-300, 0, 0},
                                         {0, 0, 1}};
  for (int k = 0; k < 100; ++k) {
    duals.push_back({random.normal(), random.normal(), random.normal()});
  }
  for (const auto& dual : duals) {
    Design design{weights};
    design.dual_weights = dual;
    const Certificate proof = certify(set, design, g);
    ASSERT_EQ(proof.status, CertificateStatus::kCertified);
    EXPECT_LE(proof.efficiency, efficiency + 1e-12);
    EXPECT_NEAR(proof.criterion_value, value, 1e-10);
  }
}

TEST(MoreCriteria, SolvesTheFamiliesOfTheStudy) {
  Random random(3);
  for (const std::string family : {"rob", "wis", "flat", "smo", "smr6", "r1g", "dup", "decades"}) {
    const InformationSet set = make_family(family, 800, 6, 2);
    for (const Criterion& criterion : criteria_for(6, random)) {
      SCOPED_TRACE(family + " " + std::string(to_string(criterion.kind())));
      solved(set, criterion, 1e-6);
    }
  }
}

TEST(MoreCriteria, OtherBackEndsAnswerUnsupported) {
  const InformationSet set = polynomial(1, even_grid(3));
  const SolverRegistry registry = make_registry();
  for (const Criterion& criterion :
       {Criterion::phi_p(2.0), Criterion::g(), Criterion::compound({{1.0, Criterion::a()}})}) {
    EXPECT_EQ(registry.at("multiplicative").solve(set, {.criterion = criterion}).status,
              SolveStatus::kUnsupported);
  }
}

// V is another name of I.
TEST(MoreCriteria, NamesAreTakenFromBooks) {
  EXPECT_EQ(criterion_kind("V"), CriterionKind::kI);
  EXPECT_EQ(to_string(criterion_kind("V")), "I");
}

// Shares count by their ratios alone, however large or small they are.
TEST(MoreCriteria, SharesOfAnySizeCountByTheirRatios) {
  const Criterion plain = Criterion::compound({{0.25, Criterion()}, {0.75, Criterion::a()}});
  for (const double unit : {1e-300, 1.0, 1e300, 2e307}) {
    const Criterion scaled =
        Criterion::compound({{1.0 * unit, Criterion()}, {3.0 * unit, Criterion::a()}});
    ASSERT_EQ(scaled.parts().size(), 2U);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_DOUBLE_EQ(scaled.parts()[k].share, plain.parts()[k].share) << unit;
    }
  }
  EXPECT_THROW(Criterion::compound({{1e308, Criterion()}, {1e-308, Criterion::a()}}), InputError);
}

TEST(MoreCriteria, RefusesWhatIsNoCriterion) {
  const InformationSet set = polynomial(1, even_grid(3));
  EXPECT_THROW(static_cast<void>(Criterion::phi_p(-1.0)), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::phi_p(std::nan(""))), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::g(PredictionRegion())), InputError);
  EXPECT_THROW(static_cast<void>(PredictionRegion(2, {1.0, 2.0, 3.0}, {1})), InputError);
  EXPECT_THROW(static_cast<void>(PredictionRegion(2, {1.0, 2.0}, {2})), InputError);
  EXPECT_THROW(static_cast<void>(PredictionRegion(2, {1.0, std::nan("")}, {1})), InputError);
  EXPECT_THROW(static_cast<void>(Criterion::compound({})), InputError);
  EXPECT_THROW(
      static_cast<void>(Criterion::compound({{1.0, Criterion::e()}, {1.0, Criterion::e()}})),
      InputError);
  EXPECT_THROW(static_cast<void>(Criterion::compound({{0.0, Criterion::a()}})), InputError);
  const Criterion wide = Criterion::g(region_of(polynomials(2, {0.5})));
  const Design design{std::vector<double>(7, 1.0 / 7)};
  EXPECT_THROW(static_cast<void>(certify(set, design, wide)), InputError);
  EXPECT_THROW(static_cast<void>(certify(set, design, Criterion::i({1.0}))), InputError);
}

// A region that predicts nothing, or whose squares are no numbers, once crashed the solver of G.
TEST(MoreCriteria, RegionsWithoutASizeAreRefused) {
  for (const double number : {0.0, 1e200, 1e-200}) {
    EXPECT_THROW((void)PredictionRegion::of_regressors(3, {number, number, number}), InputError)
        << number;
  }
  EXPECT_NO_THROW((void)PredictionRegion::of_regressors(2, {0.0, 0.0, 1.0, 2.0}));
}

}  // namespace
}  // namespace graybox
