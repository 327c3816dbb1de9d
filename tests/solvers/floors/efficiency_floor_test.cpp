// Designs with floors: a case by hand, random problems against NLopt, floors that hold, and floors
// that contradict each other.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <nlopt.hpp>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
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

double log_phi(const InformationSet& set, const std::vector<double>& weights,
               const Criterion& criterion) {
  return std::log(goodness(information_of(set, weights), criterion));
}

double best(const InformationSet& set, const Criterion& criterion) {
  const Solution solution =
      ColumnGeneration().solve(set, {.duality_gap = 1e-9, .criterion = criterion});
  return log_phi(set, solution.design.weights, criterion);
}

FlooredCertificate solved(const InformationSet& set, const Criterion& objective,
                          std::vector<EfficiencyFloor>& floors, double gap, Design& design) {
  const Solution solution =
      solve_floored(set, {.duality_gap = gap, .criterion = objective}, floors);
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  design = solution.design;
  const FlooredCertificate proof = certify_floored(set, design, objective, floors, gap);
  EXPECT_TRUE(proves(proof.certificate, gap))
      << proof.certificate.message << " " << proof.certificate.duality_gap;
  return proof;
}

// H_1 = e_1 e_1^T, H_2 = s e_2 e_2^T, lambda on the first: D wants 1/2. A's efficiency there is
// (1 + sqrt(1/s))^2 / (2 + 2/s), and the floor is met where 1/lambda + 1/(s (1 - lambda)) is the
// best over it.
TEST(EfficiencyFloors, TwoOrthogonalCandidatesByHand) {
  const double s = 100.0;
  const InformationSet set = orthogonal({1.0, s});
  const double least = std::pow(1.0 + 0.1, 2);
  for (const double share : {0.5, 0.7, 0.9, 0.99, 0.9999}) {
    SCOPED_TRACE(share);
    std::vector<EfficiencyFloor> floors{{.share = share, .criterion = Criterion::a()}};
    Design design;
    const FlooredCertificate proof = solved(set, Criterion(), floors, 1e-6, design);
    double low = 0.5, high = 1.0 / 1.1;  // D's and A's
    for (int k = 0; k < 200; ++k) {
      const double middle = 0.5 * (low + high);
      (1.0 / middle + 1.0 / (s * (1.0 - middle)) > least / share ? low : high) = middle;
    }
    EXPECT_NEAR(design.weights[0], high, 1e-4);
    EXPECT_GE(proof.efficiencies[0], share);
    EXPECT_EQ(floors[0].multiplier > 0.0, share > 0.6);
  }
}

struct NloptProblem {
  const InformationSet& set;
  const Criterion& criterion;
  double level = 0.0;
  static double value(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    const auto& self = *static_cast<NloptProblem*>(data);
    const auto at = [&](const std::vector<double>& y) {
      const double phi = log_phi(self.set, y, self.criterion);
      return std::isfinite(phi) ? phi : -1e3;
    };
    std::vector<double> y = x;
    for (std::size_t i = 0; i < slope.size(); ++i) {
      y[i] = x[i] + 1e-6;
      const double up = at(y);
      y[i] = x[i] - 1e-6;
      slope[i] = (up - at(y)) / 2e-6;
      y[i] = x[i];
    }
    return at(x);
  }
  static double below(const std::vector<double>& x, std::vector<double>& slope, void* data) {
    const double phi = value(x, slope, data);
    for (double& each : slope) each = -each;
    return static_cast<NloptProblem*>(data)->level - phi;
  }
  static double sum(const std::vector<double>& x, std::vector<double>& slope, void*) {
    std::ranges::fill(slope, 1.0);
    return std::accumulate(x.begin(), x.end(), -1.0);
  }
};

// 200 random problems with one floor and two. Where the search stalls it says so.
TEST(EfficiencyFloors, NloptBeatsNoCertificate) {
  Random random(99);
  int close = 0, proven = 0;
  for (unsigned round = 0; round < 200; ++round) {
    SCOPED_TRACE(round);
    const Index d = 2 + round % 2;
    const InformationSet set = wishart(d, 5 + round % 4, 2, 300 + round, 1.0);
    const VectorXd c = gaussian(d, 1, random);
    const Criterion objective = round % 3 == 0 ? Criterion::a() : Criterion();
    std::vector<EfficiencyFloor> floors{
        {.share = 0.8 + 0.15 * random.uniform(),
         .criterion = round % 3 == 0 ? Criterion() : Criterion::a()}};
    if (round % 2 == 1) {
      const MatrixXd w = c * c.transpose() + MatrixXd::Identity(d, d);
      floors.push_back({.share = 0.6, .criterion = Criterion::i(packed(w))});
    }
    const Solution solution =
        solve_floored(set, {.duality_gap = 1e-5, .criterion = objective}, floors);
    const Design& design = solution.design;
    const FlooredCertificate proof = certify_floored(set, design, objective, floors, 1e-5);
    EXPECT_EQ(proof.certificate.status, CertificateStatus::kCertified);
    EXPECT_LE(largest_gap(proof.certificate), 1e-3);
    EXPECT_EQ(solution.status == SolveStatus::kSolved, proves(proof.certificate, 1e-5));
    proven += solution.status == SolveStatus::kSolved ? 1 : 0;
    const double reached = log_phi(set, design.weights, objective);
    std::vector<NloptProblem> constraints;
    for (const EfficiencyFloor& floor : floors) {
      const double level = std::log(floor.share) + best(set, floor.criterion);
      EXPECT_GE(log_phi(set, design.weights, floor.criterion), level - 1e-9);
      constraints.push_back({set, floor.criterion, level});
    }
    NloptProblem main{set, objective};
    nlopt::opt problem(nlopt::LD_SLSQP, static_cast<unsigned>(set.candidate_count()));
    problem.set_lower_bounds(0.0);
    problem.set_max_objective(&NloptProblem::value, &main);
    problem.add_equality_constraint(&NloptProblem::sum, nullptr, 1e-12);
    for (NloptProblem& each : constraints) {
      problem.add_inequality_constraint(&NloptProblem::below, &each, 1e-10);
    }
    problem.set_ftol_rel(1e-12);
    problem.set_maxeval(1000);
    std::vector<double> x(set.candidate_count(), 1.0 / static_cast<double>(set.candidate_count()));
    double value = 0.0;
    try {
      problem.optimize(x, value);
    } catch (const std::exception&) {
      continue;
    }
    double total = 0.0;
    for (double& weight : x) total += weight = std::max(weight, 0.0);
    for (double& weight : x) weight /= total;
    bool feasible = true;
    for (const NloptProblem& each : constraints) {
      feasible = feasible && log_phi(set, x, each.criterion) >= each.level - 1e-9;
    }
    if (!feasible) continue;
    const double rival = log_phi(set, x, objective);
    EXPECT_LE(rival, reached + std::log1p(largest_gap(proof.certificate)) + 1e-7);
    close += rival > reached - 1e-4 ? 1 : 0;
  }
  EXPECT_GE(close, 100);
  EXPECT_GE(proven, 198);
}

// Wrong multipliers loosen the bound, and a design below its floor is none.
TEST(EfficiencyFloors, TheCheckerTrustsNobody) {
  const InformationSet set = orthogonal({1.0, 100.0});
  std::vector<EfficiencyFloor> floors{{.share = 0.9, .criterion = Criterion::a()}};
  Design design;
  solved(set, Criterion(), floors, 1e-6, design);
  const double right = floors[0].multiplier;
  const double reached = log_phi(set, design.weights, Criterion());
  for (const double factor : {0.0, 0.5, 0.9, 1.1, 3.0, 100.0}) {
    floors[0].multiplier = factor * right;
    const Certificate proof = certify_floored(set, design, Criterion(), floors).certificate;
    EXPECT_GE(std::log1p(largest_gap(proof)), -1e-9);
    EXPECT_FALSE(proves(proof, 1e-4)) << factor;
  }
  const FlooredCertificate d_optimal = certify_floored(set, {{0.5, 0.5}}, Criterion(), floors);
  EXPECT_EQ(d_optimal.certificate.status, CertificateStatus::kNotADesign);
  EXPECT_NE(d_optimal.certificate.message.find("less than the floor"), std::string::npos);
  EXPECT_GT(log_phi(set, {0.5, 0.5}, Criterion()), reached);
}

TEST(EfficiencyFloors, RefusesWhatCantBe) {
  const InformationSet set = orthogonal({1.0, 100.0, 4.0});
  const auto refuse = [&](std::vector<EfficiencyFloor> floors) {
    EXPECT_THROW(static_cast<void>(solve_floored(set, {}, floors)), InputError);
  };
  refuse({{.share = 1.0, .criterion = Criterion::a()}});
  refuse({{.share = 0.0, .criterion = Criterion::a()}});
  refuse({{.share = std::nan(""), .criterion = Criterion::a()}});
  refuse(
      {{.share = 0.9, .criterion = Criterion::e()}, {.share = 0.8, .criterion = Criterion::e()}});
  refuse({{.share = 0.9, .criterion = Criterion::compound({{1.0, Criterion::a()}})}});
  const auto only = [&](std::size_t k) { return Criterion::ds({k}); };
  refuse({{.share = 0.9, .criterion = only(0)}, {.share = 0.9, .criterion = only(1)}});
}

}  // namespace
}  // namespace graybox
