// E and G beside other criteria, as floors and in compounds: cases by hand, random problems against
// NLopt, and what can't be.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/floors/efficiency_floor.hpp"
#include "solvers/floors/floored_design.hpp"
#include "tests/support/criterion_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kGap = 1e-5;

// tr(J_j M^-1 J_j^T) of all points of G.
std::vector<double> variances(const InformationSet& set, const MatrixXd& m, const Criterion& g) {
  const MatrixXd covariance = m.inverse();
  std::vector<double> out;
  if (g.region().count() == 0) {
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      out.push_back((covariance * matrix_of(set, i)).trace());
    }
    return out;
  }
  const std::span<const double> rows = g.region().rows();
  const Eigen::Map<const MatrixXd> all(rows.data(), m.rows(),
                                       static_cast<Index>(rows.size()) / m.rows());
  Index first = 0;
  for (const std::size_t count : g.region().row_counts()) {
    const MatrixXd point = all.middleCols(first, static_cast<Index>(count));
    out.push_back((point.transpose() * covariance * point).trace());
    first += static_cast<Index>(count);
  }
  return out;
}

double log_phi(const InformationSet& set, const std::vector<double>& weights,
               const Criterion& criterion) {
  const MatrixXd m = information_of(set, weights);
  if (criterion.kind() == CriterionKind::kG) {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(m, Eigen::EigenvaluesOnly);
    if (!(eigen.eigenvalues()(0) > 0.0)) return -std::numeric_limits<double>::infinity();
    return -std::log(std::ranges::max(variances(set, m, criterion)));
  }
  return std::log(goodness(m, criterion));
}

// E wants l = s (1 - l) of H_1 = e_1 e_1^T, H_2 = s e_2 e_2^T, D l = 1/2. Under D a floor r of E
// binds where r s/(1 + s) is more than 1/2.
TEST(SharpFloors, EigenvalueOfTwoOrthogonalCandidatesByHand) {
  const double s = 100.0;
  const InformationSet set = orthogonal({1.0, s});
  for (const double share : {0.3, 0.6, 0.9, 0.99}) {
    SCOPED_TRACE(share);
    std::vector<EfficiencyFloor> floors{{.share = share, .criterion = Criterion::e()}};
    const Solution solution = solve_floored(set, {.duality_gap = kGap}, floors);
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    EXPECT_NEAR(solution.design.weights[0], std::max(0.5, share * s / (1.0 + s)), 1e-4);
    const FlooredCertificate proof =
        certify_floored(set, solution.design, Criterion(), floors, kGap);
    EXPECT_TRUE(proves(proof.certificate, kGap)) << proof.certificate.message;
    EXPECT_GE(proof.efficiencies[0], share);
  }
}

// The variances of the candidates are 1/l and 1/(1 - l), the least largest of them 2. A wants
// l = 10/11, and a floor r of G keeps 1 - l at r/2.
TEST(SharpFloors, LargestVarianceOfTwoOrthogonalCandidatesByHand) {
  const InformationSet set = orthogonal({1.0, 100.0});
  for (const double share : {0.15, 0.5, 0.9}) {
    SCOPED_TRACE(share);
    std::vector<EfficiencyFloor> floors{{.share = share, .criterion = Criterion::g()}};
    const Solution solution =
        solve_floored(set, {.duality_gap = kGap, .criterion = Criterion::a()}, floors);
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    EXPECT_NEAR(solution.design.weights[1], std::max(1.0 / 11.0, share / 2.0), 1e-4);
  }
}

// D and E in equal parts on d orthogonal candidates that are alike: each the same.
TEST(SharpFloors, CompoundOfAlikeCandidatesByHand) {
  const InformationSet set = orthogonal({2.0, 2.0, 2.0, 2.0});
  for (const Criterion& sharp : {Criterion::e(), Criterion::g()}) {
    const Criterion both = Criterion::compound({{1.0, Criterion()}, {3.0, sharp}});
    const Solution solution =
        ColumnGeneration().solve(set, {.duality_gap = 1e-7, .criterion = both});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    for (const double weight : solution.design.weights) EXPECT_NEAR(weight, 0.25, 1e-4);
    const Certificate proof = certify(set, solution.design, both);
    EXPECT_TRUE(proves(proof, 1e-7)) << proof.duality_gap;
    const double of_sharp = sharp.kind() == CriterionKind::kE ? 0.5 : 0.25;
    EXPECT_NEAR(proof.criterion_value, 0.25 * std::log(0.5) + 0.75 * std::log(of_sharp), 1e-7);
  }
}

// The rival: weights and t, the logarithm of a bound of E or G, which smooth constraints keep:
// leading minors of M - e^t I (Sylvester), or e^t times the variance of each point.
class Rival {
 public:
  Rival(const InformationSet& set, Criterion smooth, Criterion sharp)
      : set_(set), smooth_(std::move(smooth)), sharp_(std::move(sharp)) {}

  // Maximises a log Phi_smooth + b t, t at least `level` or, with b = 0, there.
  [[nodiscard]] std::vector<double> weights(double a, double b, double level) {
    a_ = a;
    b_ = b;
    const std::size_t q = set_.candidate_count();
    nlopt::opt problem(nlopt::LD_SLSQP, static_cast<unsigned>(q + 1));
    std::vector<double> low(q + 1, 0.0), high(q + 1, 1.0);
    std::vector<double> x(q + 1, 1.0 / static_cast<double>(q));
    low.back() = b > 0.0 ? -50.0 : level;
    high.back() = b > 0.0 ? 50.0 : level;
    x.back() = b > 0.0 ? log_phi(set_, {x.begin(), x.end() - 1}, sharp_) - 0.1 : level;
    problem.set_lower_bounds(low);
    problem.set_upper_bounds(high);
    problem.set_max_objective(&Rival::objective, this);
    problem.add_equality_constraint(&Rival::sum, nullptr, 1e-12);
    const std::size_t rows = limits(x).size();
    problem.add_inequality_mconstraint(&Rival::constraints, this, std::vector<double>(rows, 1e-10));
    problem.set_ftol_rel(1e-13);
    problem.set_maxeval(2000);
    double value = 0.0;
    try {
      problem.optimize(x, value);
    } catch (const std::exception&) {
      return {};
    }
    x.pop_back();
    double total = 0.0;
    for (double& weight : x) total += weight = std::max(weight, 0.0);
    for (double& weight : x) weight /= total;
    return x;
  }

 private:
  // At most zero each.
  [[nodiscard]] std::vector<double> limits(const std::vector<double>& x) const {
    const MatrixXd m = information_of(set_, {x.begin(), x.end() - 1});
    const double bound = std::exp(x.back());
    std::vector<double> out;
    if (sharp_.kind() == CriterionKind::kE) {
      const MatrixXd rest = m - bound * MatrixXd::Identity(m.rows(), m.rows());
      const double size = m.trace() / static_cast<double>(m.rows());
      for (Index k = 1; k <= m.rows(); ++k) {
        out.push_back(-(rest.topLeftCorner(k, k) / size).determinant());
      }
      return out;
    }
    for (const double variance : variances(set_, m, sharp_)) {
      out.push_back(std::isfinite(variance) ? variance * bound - 1.0 : 1e3);
    }
    return out;
  }
  [[nodiscard]] double value(const std::vector<double>& x) const {
    const double phi = log_phi(set_, {x.begin(), x.end() - 1}, smooth_);
    return a_ * (std::isfinite(phi) ? phi : -1e3) + b_ * x.back();
  }
  static double objective(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    const auto& self = *static_cast<Rival*>(data);
    std::vector<double> y = x;
    for (std::size_t i = 0; i < slope.size(); ++i) {
      y[i] = x[i] + kStep;
      const double up = self.value(y);
      y[i] = x[i] - kStep;
      slope[i] = (up - self.value(y)) / (2.0 * kStep);
      y[i] = x[i];
    }
    return self.value(x);
  }
  static void constraints(unsigned rows, double* result, unsigned n, const double* at,
                          double* slope, void* data) {
    const auto& self = *static_cast<Rival*>(data);
    std::vector<double> y(at, at + n);
    std::ranges::copy(self.limits(y), result);
    for (unsigned i = 0; slope != nullptr && i < n; ++i) {
      y[i] = at[i] + kStep;
      const std::vector<double> up = self.limits(y);
      y[i] = at[i] - kStep;
      const std::vector<double> down = self.limits(y);
      for (unsigned row = 0; row < rows; ++row) {
        slope[row * n + i] = (up[row] - down[row]) / (2.0 * kStep);
      }
      y[i] = at[i];
    }
  }
  static double sum(const std::vector<double>& x, std::vector<double>& slope, void*) {
    std::ranges::fill(slope, 1.0);
    if (!slope.empty()) slope.back() = 0.0;
    return std::accumulate(x.begin(), x.end() - 1, -1.0);
  }

  static constexpr double kStep = 1e-6;
  const InformationSet& set_;
  Criterion smooth_, sharp_;
  double a_ = 1.0, b_ = 0.0;
};

Criterion sharp_of(unsigned round, Index d, Random& random) {
  switch (round % 3) {
    case 0:
      return Criterion::e();
    case 1:
      return Criterion::g();
    default: {
      const MatrixXd points = gaussian(d, 4, random);
      return Criterion::g(PredictionRegion::of_regressors(
          static_cast<std::size_t>(d), {points.data(), points.data() + points.size()}));
    }
  }
}

double best(const InformationSet& set, const Criterion& criterion) {
  if (criterion.is_solved_as_d() && criterion.kind() == CriterionKind::kG) {
    return -std::log(static_cast<double>(set.dimension()));
  }
  const Solution solution =
      ColumnGeneration().solve(set, {.duality_gap = 1e-8, .criterion = criterion});
  return log_phi(set, solution.design.weights, criterion);
}

// 210 random problems with a floor of E or G under D or A.
TEST(SharpFloors, NloptBeatsNoCertificate) {
  Random random(17);
  int close = 0, proven = 0;
  constexpr unsigned kRounds = 210;
  for (unsigned round = 0; round < kRounds; ++round) {
    SCOPED_TRACE(round);
    const Index d = 2 + round % 2;
    const InformationSet set = wishart(d, 5 + round % 4, 2, 900 + round, 1.0);
    const Criterion smooth = round % 2 == 0 ? Criterion() : Criterion::a();
    const Criterion sharp = sharp_of(round / 2, d, random);
    std::vector<EfficiencyFloor> floors{
        {.share = 0.8 + 0.18 * random.uniform(), .criterion = sharp}};
    const Solution solution =
        solve_floored(set, {.duality_gap = kGap, .criterion = smooth}, floors);
    const std::vector<double>& weights = solution.design.weights;
    const FlooredCertificate proof = certify_floored(set, solution.design, smooth, floors, kGap);
    ASSERT_EQ(proof.certificate.status, CertificateStatus::kCertified) << proof.certificate.message;
    EXPECT_EQ(solution.status == SolveStatus::kSolved, proves(proof.certificate, kGap));
    proven += solution.status == SolveStatus::kSolved ? 1 : 0;
    const double level = std::log(floors[0].share) + best(set, sharp);
    EXPECT_GE(log_phi(set, weights, sharp), level - 1e-7);
    const double reached = log_phi(set, weights, smooth);
    const std::vector<double> other = Rival(set, smooth, sharp).weights(1.0, 0.0, level);
    if (other.empty() || !(log_phi(set, other, sharp) >= level - 1e-8)) continue;
    const double rival = log_phi(set, other, smooth);
    EXPECT_LE(rival, reached + std::log1p(largest_gap(proof.certificate)) + 1e-6);
    close += rival > reached - 1e-4 ? 1 : 0;
  }
  EXPECT_GE(close, 100);
  EXPECT_GE(proven, 205);
}

// 210 random compounds.
TEST(SharpCompounds, NloptBeatsNoCertificate) {
  Random random(23);
  int close = 0, proven = 0;
  for (unsigned round = 0; round < 210; ++round) {
    SCOPED_TRACE(round);
    const Index d = 2 + round % 2;
    const InformationSet set = wishart(d, 5 + round % 4, 2, 1900 + round, 1.0);
    const Criterion smooth = round % 2 == 0 ? Criterion() : Criterion::a();
    const Criterion sharp = sharp_of(round / 2, d, random);
    const double share = 0.1 + 0.8 * random.uniform();
    const Criterion both = Criterion::compound({{1.0 - share, smooth}, {share, sharp}});
    const Solution solution =
        ColumnGeneration().solve(set, {.duality_gap = kGap, .criterion = both});
    const Certificate proof = certify(set, solution.design, both);
    ASSERT_EQ(proof.status, CertificateStatus::kCertified) << proof.message;
    EXPECT_EQ(solution.status == SolveStatus::kSolved, proves(proof, kGap));
    proven += proves(proof, kGap) ? 1 : 0;
    const auto value = [&](const std::vector<double>& weights) {
      return (1.0 - share) * log_phi(set, weights, smooth) + share * log_phi(set, weights, sharp);
    };
    const double reached = value(solution.design.weights);
    EXPECT_NEAR(proof.criterion_value, reached, 1e-9 * (1.0 + std::abs(reached)));
    // What proves it is not needed: the checker finds its own.
    const Design alone{solution.design.weights};
    EXPECT_LE(largest_gap(certify(set, alone, both)), 1e-3);
    const std::vector<double> other = Rival(set, smooth, sharp).weights(1.0 - share, share, 0.0);
    if (other.empty()) continue;
    EXPECT_LE(value(other), reached + std::log1p(largest_gap(proof)) + 1e-7);
    close += value(other) > reached - 1e-4 ? 1 : 0;
  }
  EXPECT_GE(close, 100);
  EXPECT_GE(proven, 208);
}

// Wrong proofs of E and G loosen the bound, and no more.
TEST(SharpCompounds, TheCheckerTrustsNobody) {
  const InformationSet set = wishart(3, 9, 2, 5, 1.0);
  const Criterion both =
      Criterion::compound({{1.0, Criterion()}, {1.0, Criterion::e()}, {1.0, Criterion::g()}});
  const Solution solution = ColumnGeneration().solve(set, {.duality_gap = 1e-6, .criterion = both});
  ASSERT_TRUE(proves(certify(set, solution.design, both), 1e-6));
  Design wrong = solution.design;
  std::ranges::fill(wrong.dual_weights, 1.0);
  const Certificate of_points = certify(set, wrong, both);
  EXPECT_GE(of_points.duality_gap, -1e-12);
  EXPECT_FALSE(proves(of_points, 1e-3));
  wrong = solution.design;
  wrong.dual_matrix = {1.0, 0.0, 1.0, 0.0, 0.0, 1.0};
  const Certificate of_matrix = certify(set, wrong, both);
  EXPECT_GE(of_matrix.duality_gap, -1e-12);
  EXPECT_FALSE(proves(of_matrix, 1e-3));
}

TEST(SharpFloors, RefuseWhatCantBeAndNameTheFloors) {
  const InformationSet set = wishart(3, 8, 2, 11, 1.0);
  const auto message = [&](const Criterion& objective, std::vector<EfficiencyFloor> floors) {
    try {
      static_cast<void>(solve_floored(set, {.criterion = objective}, floors));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const Criterion e = Criterion::e();
  EXPECT_NE(message(e, {{.share = 0.9, .criterion = e}}).find("E is the objective"),
            std::string::npos);
  const InformationSet apart = orthogonal({1.0, 100.0});
  std::vector<EfficiencyFloor> floors{{.share = 0.99, .criterion = Criterion::e()},
                                      {.share = 0.99, .criterion = Criterion::g()}};
  try {
    static_cast<void>(solve_floored(apart, {.duality_gap = kGap}, floors));
    FAIL() << "no design has both";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("E=0.99, G=0.99 contradict"), std::string::npos)
        << error.what();
  }
}

// More points than a dense problem would bear: G of a second set of 2000 candidates.
TEST(SharpCompounds, LargestVarianceOverManyPoints) {
  const InformationSet set = wishart(6, 400, 2, 3, 1.0);
  const InformationSet second = wishart(6, 2000, 2, 4, 1.0);
  const Criterion g = Criterion::g(PredictionRegion::of_set(second));
  const Solution solution = ColumnGeneration().solve(set, {.duality_gap = 1e-4, .criterion = g});
  const Certificate proof = certify(set, solution.design, g);
  EXPECT_TRUE(proves(proof, 1e-4)) << proof.duality_gap;
  double largest = 0.0;
  const MatrixXd covariance = information_of(set, solution.design.weights).inverse();
  for (std::size_t j = 0; j < 2000; ++j) {
    largest = std::max(largest, (covariance * matrix_of(second, j)).trace());
  }
  EXPECT_NEAR(proof.criterion_value, largest, 1e-9 * largest);
}

}  // namespace
}  // namespace graybox
