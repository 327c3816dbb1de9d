// Properties that every back-end must have, run over all that this build registers. A new solver is
// tested by its line in the registry.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/certificates/certificate.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/registered_solvers.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using namespace testing_solvers;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// For runs that end by something else; where time ran out the answer would depend on the machine.
constexpr double kAmpleTime = 60.0;

void expect_on_simplex(const InformationSet& set, const Design& design) {
  ASSERT_EQ(design.weights.size(), set.candidate_count());
  double total = 0.0;
  for (const double weight : design.weights) {
    ASSERT_TRUE(std::isfinite(weight));
    EXPECT_GE(weight, -1e-12);
    total += weight;
  }
  EXPECT_NEAR(total, 1.0, 1e-9);
}

// A claim of "solved" must survive the checker, whoever makes it.
void expect_honest(const InformationSet& set, const Solution& solution, double gap) {
  if (solution.status == SolveStatus::kUnsupported) {
    EXPECT_FALSE(solution.message.empty());
    return;
  }
  expect_on_simplex(set, solution.design);
  if (solution.status != SolveStatus::kSolved) return;
  const Certificate proof = certify(set, solution.design);
  EXPECT_EQ(proof.status, CertificateStatus::kCertified);
  EXPECT_LE(proof.duality_gap, 1.001 * gap + proof.rounding_bound);
}

// Solves and returns the certificate; expects the solver's promise to be kept.
Certificate solve_checked(const Solver& solver, const InformationSet& set, bool& solved) {
  const double gap = target_gap(solver);
  const Solution solution =
      solver.solve(set, {.duality_gap = gap, .time_limit = time_limit(solver)});
  expect_honest(set, solution, gap);
  solved = solution.status == SolveStatus::kSolved;
  if (promises_the_gap(solver) && solution.status != SolveStatus::kUnsupported) {
    EXPECT_EQ(solution.status, SolveStatus::kSolved)
        << to_string(solution.status) << ": " << solution.message;
  }
  return solved ? certify(set, solution.design) : Certificate{};
}

struct NamedSet {
  std::string name;
  InformationSet set;
};

std::vector<NamedSet> small_sets() {
  std::vector<NamedSet> sets;
  sets.push_back({"full rank", wishart(3, 20, 3, 1)});
  sets.push_back({"rank one", wishart(4, 40, 1, 2)});
  sets.push_back({"rank two", wishart(5, 60, 2, 3)});
  sets.push_back({"one parameter", wishart(1, 7, 1, 4)});
  return sets;
}

class SolverProperty : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] const Solver& solver() const { return registry().at(GetParam()); }

  // log det of the transformed problem's answer less the original's must be `shift`, to within the
  // two bounds d log(1 + gap).
  void expect_same_optimum(const InformationSet& set, const InformationSet& other, double shift) {
    bool solved = false, other_solved = false;
    const Certificate a = solve_checked(solver(), set, solved);
    const Certificate b = solve_checked(solver(), other, other_solved);
    ++posed_;
    if (!solved || !other_solved) return;
    ++compared_;
    const double rounding = 1e-9 * (1.0 + std::abs(shift));
    EXPECT_LE(b.log_det - shift - a.log_det, a.log_det_gap + rounding);
    EXPECT_LE(a.log_det + shift - b.log_det, b.log_det_gap + rounding);
  }

  // A property that was compared nowhere has not been tested: back-ends that promise the gap solve
  // every pair, the others one at least.
  void TearDown() override {
    if (posed_ == 0) return;
    EXPECT_GE(compared_, promises_the_gap(solver()) ? posed_ : 1U);
  }

 private:
  std::size_t posed_ = 0, compared_ = 0;  // pairs
};

TEST_P(SolverProperty, ReachesItsGapOnSmallSets) {
  for (const auto& [name, set] : small_sets()) {
    SCOPED_TRACE(name);
    bool solved = false;
    solve_checked(solver(), set, solved);
  }
}

TEST_P(SolverProperty, InvariantUnderReparametrisation) {
  Random random(21);
  for (const auto& [name, set] : small_sets()) {
    SCOPED_TRACE(name);
    const auto d = static_cast<Eigen::Index>(set.dimension());
    const MatrixXd t = gaussian(d, d, random) + 2.0 * MatrixXd::Identity(d, d);
    expect_same_optimum(set, transformed(set, t), 2.0 * std::log(std::abs(t.determinant())));
  }
}

TEST_P(SolverProperty, InvariantUnderScalingAndPermutation) {
  for (const auto& [name, set] : small_sets()) {
    SCOPED_TRACE(name);
    const auto d = static_cast<double>(set.dimension());
    std::vector<MatrixXd> all = matrices_of(set);
    for (MatrixXd& h : all) h *= 1e5;
    expect_same_optimum(set, from_matrices(all), d * std::log(1e5));
    const auto order = nested_subset(set.candidate_count(), set.candidate_count(), 5);
    expect_same_optimum(set, set.subset(order), 0.0);
  }
}

TEST_P(SolverProperty, DuplicatesChangeNothing) {
  for (const auto& [name, set] : small_sets()) {
    SCOPED_TRACE(name);
    expect_same_optimum(set, concatenated(set, set), 0.0);
  }
}

TEST_P(SolverProperty, CandidatesSpreadOverTwelveDecades) {
  bool solved = false;
  solve_checked(solver(), wishart(4, 40, 4, 6, 12.0), solved);
  solve_checked(solver(), wishart(4, 40, 1, 7, 12.0), solved);
}

TEST_P(SolverProperty, ParametersSpreadOverTwelveDecades) {
  const InformationSet set = wishart(5, 40, 2, 8);
  // Powers of two, so that the two problems are the same to the last bit.
  VectorXd scale(5);
  for (Eigen::Index k = 0; k < 5; ++k) scale(k) = std::exp2(10.0 * static_cast<double>(k - 2));
  expect_same_optimum(set, transformed(set, scale.asDiagonal()), 2.0 * scale.array().log().sum());
}

TEST_P(SolverProperty, AsManyRankOneCandidatesAsParameters) {
  // The optimum is known: equal weights.
  for (Eigen::Index d : {1, 2, 9}) {
    const InformationSet set = wishart(d, static_cast<std::size_t>(d), 1, 9);
    const double share = 1.0 / static_cast<double>(d);
    const Certificate best =
        certify(set, {std::vector<double>(static_cast<std::size_t>(d), share)});
    bool solved = false;
    const Certificate found = solve_checked(solver(), set, solved);
    if (!solved) continue;
    EXPECT_NEAR(found.log_det, best.log_det, found.log_det_gap + 1e-9);
  }
}

TEST_P(SolverProperty, OneCandidateAloneIsOptimal) {
  Random random(10);
  std::vector<MatrixXd> all = matrices_of(wishart(4, 25, 4, 11));
  MatrixXd best = MatrixXd::Identity(4, 4);
  for (const MatrixXd& h : all) best += h;
  all.insert(all.begin() + 13, best);
  const InformationSet set = from_matrices(all);
  const double gap = target_gap(solver());
  const Solution solution =
      solver().solve(set, {.duality_gap = gap, .time_limit = time_limit(solver())});
  expect_honest(set, solution, gap);
  if (solution.status != SolveStatus::kSolved) {
    EXPECT_FALSE(promises_the_gap(solver())) << to_string(solution.status);
    return;
  }
  EXPECT_GT(solution.design.weights[13], 0.99);
}

TEST_P(SolverProperty, ExactDuplicatesAndTies) {
  // A two-level factorial, each point three times: every uniform subdesign of full symmetry is
  // optimal, and every candidate is tied with every other.
  std::vector<VectorXd> points;
  for (int copy = 0; copy < 3; ++copy) {
    for (unsigned code = 0; code < 16; ++code) {
      VectorXd f(5);
      f(0) = 1.0;
      for (unsigned k = 0; k < 4; ++k) f(1 + k) = (code >> k & 1U) != 0 ? 1.0 : -1.0;
      points.push_back(f);
    }
  }
  const InformationSet set = regression(points);
  bool solved = false;
  const Certificate found = solve_checked(solver(), set, solved);
  if (solved) {
    EXPECT_NEAR(found.log_det, 0.0, found.log_det_gap + 1e-9);  // M = I
  }
}

TEST_P(SolverProperty, DimensionsFromOneToForty) {
  for (Eigen::Index d : {1, 2, 7, 16, 40}) {
    SCOPED_TRACE(d);
    bool solved = false;
    solve_checked(solver(), wishart(d, static_cast<std::size_t>(d) + 15, d / 2 + 1, 12), solved);
  }
}

TEST_P(SolverProperty, EqualSeedsGiveEqualAnswersOnAnyNumberOfThreads) {
  const InformationSet set = wishart(4, 80, 2, 13);
  const double gap = target_gap(solver());
  const SolveOptions options{.duality_gap = gap, .time_limit = kAmpleTime, .seed = 5};
  SolveOptions threaded = options;
  threaded.threads = 2;
  const Solution first = solver().solve(set, options);
  EXPECT_EQ(first.design.weights, solver().solve(set, options).design.weights);
  EXPECT_EQ(first.design.weights, solver().solve(set, threaded).design.weights);
}

TEST_P(SolverProperty, TracesAndCountersAreConsistent) {
  const InformationSet set = wishart(4, 60, 2, 14);
  const double gap = target_gap(solver());
  const Solution solution =
      solver().solve(set, {.duality_gap = gap, .time_limit = time_limit(solver())});
  if (solution.status == SolveStatus::kUnsupported) GTEST_SKIP() << solution.message;
  ASSERT_FALSE(solution.trace.empty());
  for (std::size_t k = 1; k < solution.trace.size(); ++k) {
    EXPECT_GE(solution.trace[k].seconds, solution.trace[k - 1].seconds);
    EXPECT_GE(solution.trace[k].passes, solution.trace[k - 1].passes);
    EXPECT_GE(solution.trace[k].iteration, solution.trace[k - 1].iteration);
  }
  EXPECT_GE(solution.counters.seconds, solution.trace.back().seconds);
  EXPECT_GE(solution.counters.passes, solution.trace.back().passes);
  EXPECT_GT(solution.counters.passes, 0.0);
  if (solution.status == SolveStatus::kSolved) {
    double best = std::numeric_limits<double>::infinity();
    for (const TracePoint& point : solution.trace) best = std::min(best, point.duality_gap);
    EXPECT_LE(best, 1.001 * gap);
  }
}

TEST_P(SolverProperty, IterationLimitIsHonoured) {
  const InformationSet set = wishart(6, 80, 2, 15);
  const Solution solution =
      solver().solve(set, {.duality_gap = 1e-9, .time_limit = kAmpleTime, .iteration_limit = 1});
  expect_honest(set, solution, 1e-9);
  EXPECT_LE(solution.counters.iterations, 1);
  EXPECT_TRUE(solution.status == SolveStatus::kIterationLimit ||
              solution.status == SolveStatus::kUnsupported)
      << to_string(solution.status);
}

TEST_P(SolverProperty, TimeLimitIsHonoured) {
  const InformationSet set = wishart(6, 80, 2, 16);
  const Solution solution = solver().solve(set, {.duality_gap = 1e-9, .time_limit = 1e-9});
  expect_honest(set, solution, 1e-9);
  EXPECT_TRUE(solution.status == SolveStatus::kTimeLimit ||
              solution.status == SolveStatus::kUnsupported)
      << to_string(solution.status);
}

class StopAtOnce final : public SolveObserver {
 public:
  bool on_progress(const TracePoint& point) override {
    ++calls;
    last = point;
    return false;
  }
  int calls = 0;
  TracePoint last;
};

TEST_P(SolverProperty, TheObserverCanStopIt) {
  const InformationSet set = wishart(6, 80, 2, 17);
  StopAtOnce observer;
  const Solution solution =
      solver().solve(set, {.duality_gap = 1e-9, .time_limit = kAmpleTime}, &observer);
  expect_honest(set, solution, 1e-9);
  if (solution.status == SolveStatus::kUnsupported) return;
  EXPECT_GE(observer.calls, 1);
  // It may have been done by its first report.
  EXPECT_TRUE(solution.status == SolveStatus::kTimeLimit ||
              (solution.status == SolveStatus::kSolved && observer.last.duality_gap <= 1e-9))
      << to_string(solution.status);
}

TEST_P(SolverProperty, RefusesOptionsOutOfRange) {
  const InformationSet set = wishart(2, 5, 2, 18);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const SolveOptions& bad :
       {SolveOptions{.duality_gap = 0.0}, SolveOptions{.duality_gap = -1e-6},
        SolveOptions{.duality_gap = nan}, SolveOptions{.time_limit = 0.0},
        SolveOptions{.time_limit = nan}, SolveOptions{.iteration_limit = -1},
        SolveOptions{.threads = 0}}) {
    EXPECT_THROW(static_cast<void>(solver().solve(set, bad)), InputError);
  }
}

// Sets that are no problem at all: an InputError or an honest status, never a crash and never
// "solved".
void expect_refusal(const Solver& solver, const InformationSet& set) {
  try {
    const Solution solution = solver.solve(set, {.duality_gap = 1e-6, .time_limit = 5.0});
    EXPECT_NE(solution.status, SolveStatus::kSolved);
    EXPECT_FALSE(solution.message.empty() && solution.status == SolveStatus::kNumericalFailure);
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST_P(SolverProperty, RefusesSetsThatAreNotFinite) {
  for (const double poison :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    std::vector<MatrixXd> all = matrices_of(wishart(3, 12, 3, 19));
    all[7](1, 1) = poison;
    expect_refusal(solver(), from_matrices(all));
    std::ranges::fill(all[7].reshaped(), poison);
    expect_refusal(solver(), from_matrices(all));
  }
}

TEST_P(SolverProperty, RefusesSetsWhoseSumIsSingular) {
  expect_refusal(solver(), wishart(5, 3, 1, 20));
  // A direction that no candidate sees, along the axes and askew.
  Random random(21);
  const MatrixXd q = gaussian(4, 4, random).householderQr().householderQ();
  MatrixXd blind = MatrixXd::Identity(4, 4);
  blind(3, 3) = 0.0;
  expect_refusal(solver(), transformed(wishart(4, 30, 4, 22), blind));
  expect_refusal(solver(), transformed(wishart(4, 30, 4, 22), q * blind));
  expect_refusal(solver(), from_matrices({MatrixXd::Zero(3, 3), MatrixXd::Zero(3, 3)}));
}

TEST_P(SolverProperty, NoFalseClaimOnIndefiniteMatrices) {
  std::vector<MatrixXd> all = matrices_of(wishart(3, 12, 3, 23));
  all[4] = VectorXd::LinSpaced(3, -2.0, 2.0).asDiagonal();
  all[9] *= -1.0;
  const InformationSet set = from_matrices(all);
  try {
    expect_honest(set, solver().solve(set, {.duality_gap = 1e-6, .time_limit = 5.0}), 1e-6);
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

INSTANTIATE_TEST_SUITE_P(Registry, SolverProperty, ::testing::ValuesIn(available_names()),
                         [](const auto& parameter) {
                           std::string name = parameter.param;
                           std::ranges::replace_if(
                               name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
                           return name;
                         });

// All certified answers lie within their bounds d log(1 + gap) of the optimum, so the best of them
// exceeds none by more than that.
TEST(SolverAgreement, CertifiedAnswersLieWithinTheirBounds) {
  std::vector<NamedSet> sets = small_sets();
  sets.push_back({"twelve decades", wishart(4, 40, 4, 6, 12.0)});
  sets.push_back({"twelve parameters", wishart(12, 120, 6, 24)});
  for (const auto& [name, set] : sets) {
    SCOPED_TRACE(name);
    std::vector<Certificate> certified;
    std::vector<std::string> by;
    for (const std::string& solver_name : available_names()) {
      const Solver& solver = registry().at(solver_name);
      const Solution solution =
          solver.solve(set, {.duality_gap = target_gap(solver), .time_limit = time_limit(solver)});
      if (solution.status == SolveStatus::kUnsupported) continue;
      const Certificate proof = certify(set, solution.design);
      if (proof.status != CertificateStatus::kCertified) continue;
      certified.push_back(proof);
      by.push_back(solver_name);
    }
    ASSERT_GE(certified.size(), 2U);
    double highest = -std::numeric_limits<double>::infinity();
    for (const Certificate& proof : certified) highest = std::max(highest, proof.log_det);
    for (std::size_t k = 0; k < certified.size(); ++k) {
      EXPECT_LE(highest - certified[k].log_det, certified[k].log_det_gap + 1e-9) << by[k];
    }
  }
}

}  // namespace
}  // namespace graybox
