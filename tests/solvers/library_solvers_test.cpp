// The back-ends on Ipopt and NLopt: closed forms, the checker's word, and honest statuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/registry.hpp"

namespace graybox {
namespace {

// H_i = S_i G_i G_i^T S_i, G_i standard normal d x columns, S_i = diag(exp(sigma N(0, 1))).
InformationSet wishart(std::size_t count, std::size_t dimension, std::size_t columns, double sigma,
                       std::uint64_t seed) {
  Random random(seed);
  AlignedArray information(count * packed_size(dimension), 0.0);
  std::vector<double> root(dimension * columns);
  double* entry = information.data();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t a = 0; a < dimension; ++a) {
      const double scale = std::exp(sigma * random.normal());
      for (std::size_t c = 0; c < columns; ++c) root[a * columns + c] = scale * random.normal();
    }
    for (std::size_t a = 0; a < dimension; ++a) {
      for (std::size_t b = 0; b <= a; ++b, ++entry) {
        for (std::size_t c = 0; c < columns; ++c) {
          *entry += root[a * columns + c] * root[b * columns + c];
        }
      }
    }
  }
  return InformationSet(dimension, std::move(information));
}

// H_i = v_i v_i^T for the regressors v_i, the rows of a row-major table.
InformationSet regression(std::size_t dimension, const std::vector<double>& regressors) {
  const std::size_t count = regressors.size() / dimension;
  AlignedArray information(count * packed_size(dimension));
  double* entry = information.data();
  for (std::size_t i = 0; i < count; ++i) {
    const double* v = regressors.data() + i * dimension;
    for (std::size_t a = 0; a < dimension; ++a) {
      for (std::size_t b = 0; b <= a; ++b) *entry++ = v[a] * v[b];
    }
  }
  return InformationSet(dimension, std::move(information));
}

class LibrarySolverTest : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    for (const auto& entry : registry_.entries()) {
      if (entry.name == GetParam() && entry.solver == nullptr) {
        GTEST_SKIP() << entry.unavailable_because;
      }
    }
  }
  const Solver& solver() { return registry_.at(GetParam()); }

  // Asks for the gap the back-end promises and lets the checker judge.
  Solution solve_and_check(const InformationSet& set) {
    const double gap = solver().traits().reachable_gap;
    Solution solution = solver().solve(set, {.duality_gap = gap, .time_limit = 60.0});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    const Certificate certificate = certify(set, solution.design);
    EXPECT_EQ(certificate.status, CertificateStatus::kCertified) << certificate.message;
    EXPECT_LE(certificate.duality_gap, gap + certificate.rounding_bound);
    EXPECT_FALSE(solution.trace.empty());
    EXPECT_GT(solution.counters.passes, 0.0);
    return solution;
  }

  SolverRegistry registry_ = make_registry();
};

TEST_P(LibrarySolverTest, ReachesItsGapOnPlainWishart) {
  solve_and_check(wishart(60, 4, 4, 0.0, 1));
}

TEST_P(LibrarySolverTest, ReachesItsGapOnLogNormalWishart) {
  solve_and_check(wishart(80, 6, 6, 1.0, 2));
}

TEST_P(LibrarySolverTest, ReachesItsGapOnRankOneCandidates) {
  solve_and_check(wishart(100, 5, 1, 0.0, 3));
}

// Guest (1958): for polynomials of degree n on [-1, 1] the support is the roots of
// (1 - x^2) P_n'(x), with equal weights. Degree 3: +-1 and +-1/sqrt(5).
TEST_P(LibrarySolverTest, FindsTheDesignOfCubicRegression) {
  std::vector<double> points;
  for (int k = -10; k <= 10; ++k) points.push_back(0.1 * k);
  points.push_back(1.0 / std::sqrt(5.0));
  points.push_back(-1.0 / std::sqrt(5.0));
  std::vector<double> regressors;
  for (const double x : points) regressors.insert(regressors.end(), {1.0, x, x * x, x * x * x});
  const InformationSet set = regression(4, regressors);
  Design truth;
  truth.weights.assign(points.size(), 0.0);
  for (const std::size_t i : {std::size_t{0}, std::size_t{20}, std::size_t{21}, std::size_t{22}}) {
    truth.weights[i] = 0.25;
  }
  const Solution solution = solve_and_check(set);
  const Certificate found = certify(set, solution.design);
  EXPECT_LE(std::abs(certify(set, truth).log_det - found.log_det), found.log_det_gap + 1e-12);
  for (const std::size_t i : {std::size_t{0}, std::size_t{20}, std::size_t{21}, std::size_t{22}}) {
    EXPECT_NEAR(solution.design.weights[i], 0.25, 0.02);
  }
}

// Orthogonal blocks: candidate i informs about parameters 2 i and 2 i + 1 alone. Each needs one
// third of the effort whatever its scale.
TEST_P(LibrarySolverTest, SharesEffortEquallyBetweenOrthogonalBlocks) {
  AlignedArray information(3 * packed_size(6), 0.0);
  for (std::size_t i = 0; i < 3; ++i) {
    double* h = information.data() + i * packed_size(6);
    const double scale = std::pow(100.0, static_cast<double>(i));
    h[packed_index(2 * i, 2 * i)] = 2.0 * scale;
    h[packed_index(2 * i + 1, 2 * i)] = 0.5 * scale;
    h[packed_index(2 * i + 1, 2 * i + 1)] = 3.0 * scale;
  }
  const Solution solution = solve_and_check(InformationSet(6, std::move(information)));
  for (const double weight : solution.design.weights) EXPECT_NEAR(weight, 1.0 / 3.0, 1e-3);
}

TEST_P(LibrarySolverTest, PicksTheLargestOfScalarCandidates) {
  AlignedArray information(4);
  std::ranges::copy(std::vector<double>{0.5, 2.0, 1.0, 0.25}, information.begin());
  const Solution solution = solve_and_check(InformationSet(1, std::move(information)));
  EXPECT_GT(solution.design.weights[1], 0.99);
}

TEST_P(LibrarySolverTest, TakesASingleCandidate) {
  const Solution solution = solve_and_check(wishart(1, 3, 3, 0.0, 4));
  EXPECT_EQ(solution.design.weights, std::vector<double>{1.0});
}

// H_i -> T H_i T with T over eight decades leaves the optimal weights where they are.
TEST_P(LibrarySolverTest, IsNotTroubledByUnitsOfTheParameters) {
  const InformationSet plain = wishart(40, 5, 5, 0.5, 5);
  AlignedArray information(40 * packed_size(5));
  for (std::size_t i = 0; i < 40; ++i) {
    for (std::size_t a = 0; a < 5; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const double scale = std::pow(10.0, 2.0 * static_cast<double>(a + b) - 8.0);
        information[i * packed_size(5) + packed_index(a, b)] =
            scale * plain.information(i)[packed_index(a, b)];
      }
    }
  }
  const InformationSet scaled(5, std::move(information));
  const Certificate a = certify(plain, solve_and_check(plain).design);
  const Certificate b = certify(plain, solve_and_check(scaled).design);
  EXPECT_LE(b.duality_gap, 2.0 * solver().traits().reachable_gap);
  EXPECT_LE(std::abs(a.log_det - b.log_det), a.log_det_gap + b.log_det_gap + 1e-12);
}

TEST_P(LibrarySolverTest, TakesCandidatesThatInformAboutNothing) {
  const InformationSet plain = wishart(20, 3, 3, 0.0, 6);
  AlignedArray information(25 * packed_size(3), 0.0);
  std::copy_n(plain.data(), 20 * packed_size(3), information.data());
  solve_and_check(InformationSet(3, std::move(information)));
}

// Many more violated copies than enter SLSQP's working set in a round.
TEST_P(LibrarySolverTest, IsNotHeldUpByManyDuplicates) {
  const InformationSet plain = wishart(30, 3, 3, 0.5, 14);
  AlignedArray information(30 * 20 * packed_size(3));
  for (std::size_t i = 0; i < 30 * 20; ++i) {
    std::ranges::copy(plain.information(i / 20), information.data() + i * packed_size(3));
  }
  const InformationSet copies(3, std::move(information));
  const Certificate a = certify(plain, solve_and_check(plain).design);
  const Certificate b = certify(copies, solve_and_check(copies).design);
  EXPECT_LE(std::abs(a.log_det - b.log_det), a.log_det_gap + b.log_det_gap + 1e-12);
}

// Quadratic regression on the 3^4 grid: masses of candidates are tied and the optimum is not
// unique.
TEST_P(LibrarySolverTest, IsNotHeldUpByTies) {
  std::vector<double> regressors;
  for (int code = 0; code < 81; ++code) {
    const double x[4] = {code % 3 - 1.0, code / 3 % 3 - 1.0, code / 9 % 3 - 1.0, code / 27 - 1.0};
    regressors.push_back(1.0);
    for (const double value : x) regressors.insert(regressors.end(), {value, value * value});
  }
  solve_and_check(regression(9, regressors));
}

void expect_weights(const Design& design, std::size_t count) {
  ASSERT_EQ(design.weights.size(), count);
  EXPECT_GE(*std::ranges::min_element(design.weights), 0.0);
  EXPECT_NEAR(std::accumulate(design.weights.begin(), design.weights.end(), 0.0), 1.0, 1e-12);
}

TEST_P(LibrarySolverTest, SaysSoWhenTimeIsUp) {
  const InformationSet set = wishart(300, 8, 8, 0.0, 7);
  const Solution solution = solver().solve(set, {.duality_gap = 1e-12, .time_limit = 1e-6});
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit);
  expect_weights(solution.design, 300);
}

TEST_P(LibrarySolverTest, SaysSoWhenIterationsAreUp) {
  const InformationSet set = wishart(100, 8, 8, 0.0, 8);
  const Solution solution = solver().solve(set, {.duality_gap = 1e-9, .iteration_limit = 2});
  EXPECT_EQ(solution.status, SolveStatus::kIterationLimit) << solution.message;
  EXPECT_LE(solution.counters.iterations, 2);
  expect_weights(solution.design, 100);
}

class StopAfterThree final : public SolveObserver {
 public:
  bool on_progress(const TracePoint&) override { return ++points < 3; }
  int points = 0;
};

TEST_P(LibrarySolverTest, StopsWhenTheObserverAsks) {
  const InformationSet set = wishart(200, 6, 6, 0.0, 9);
  StopAfterThree observer;
  const Solution solution = solver().solve(set, {.duality_gap = 1e-13}, &observer);
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit) << solution.message;
  EXPECT_LE(observer.points, 5);
  expect_weights(solution.design, 200);
}

// A gap below rounding can't be met; the status must not claim it, and the run must end.
TEST_P(LibrarySolverTest, DoesNotClaimWhatItCantReach) {
  const InformationSet set = wishart(50, 4, 4, 0.0, 10);
  const Solution solution = solver().solve(set, {.duality_gap = 1e-300, .time_limit = 20.0});
  EXPECT_NE(solution.status, SolveStatus::kUnsupported);
  const Certificate certificate = certify(set, solution.design);
  ASSERT_EQ(certificate.status, CertificateStatus::kCertified);
  if (solution.status == SolveStatus::kSolved) {
    EXPECT_LE(certificate.duality_gap, 1e-13);  // the solver's own figure was rounded to zero
  } else {
    EXPECT_LE(certificate.duality_gap, solver().traits().reachable_gap);
  }
}

TEST_P(LibrarySolverTest, RefusesASingularSet) {
  const InformationSet set = regression(3, {1.0, 2.0, 0.0, 1.0, -1.0, 0.0, 0.5, 1.5, 0.0});
  const Solution solution = solver().solve(set, {});
  EXPECT_EQ(solution.status, SolveStatus::kUnsupported);
  EXPECT_FALSE(solution.message.empty());
}

TEST_P(LibrarySolverTest, RefusesOptionsOutOfRange) {
  const InformationSet set = wishart(5, 2, 2, 0.0, 11);
  EXPECT_THROW(static_cast<void>(solver().solve(set, {.duality_gap = 0.0})), InputError);
  EXPECT_THROW(static_cast<void>(solver().solve(set, {.time_limit = -1.0})), InputError);
}

// The libraries beneath keep global state; solves from several threads must not disturb each other.
TEST_P(LibrarySolverTest, AnswersAlikeFromSeveralThreads) {
  const InformationSet set = wishart(60, 4, 4, 0.0, 12);
  const SolveOptions options{.duality_gap = solver().traits().reachable_gap, .time_limit = 60.0};
  const Solution alone = solver().solve(set, options);
  std::vector<Solution> together(3);
  {
    std::vector<std::jthread> threads;
    for (Solution& solution : together) {
      threads.emplace_back([&] { solution = solver().solve(set, options); });
    }
  }
  for (const Solution& solution : together) {
    EXPECT_EQ(solution.design.weights, alone.design.weights);
  }
}

TEST(NloptSlsqp, RefusesMoreVariablesThanDenseSqpCanTake) {
  const SolverRegistry registry = make_registry();
  for (const auto& entry : registry.entries()) {
    if (entry.name == "nlopt_slsqp" && entry.solver == nullptr) {
      GTEST_SKIP() << entry.unavailable_because;
    }
  }
  const Solution solution = registry.at("nlopt_slsqp").solve(wishart(2, 40, 40, 0.0, 13), {});
  EXPECT_EQ(solution.status, SolveStatus::kUnsupported);
  EXPECT_NE(solution.message.find("820 variables"), std::string::npos) << solution.message;
}

INSTANTIATE_TEST_SUITE_P(Libraries, LibrarySolverTest,
                         ::testing::Values("ipopt_primal", "ipopt_lifted", "ipopt_dual",
                                           "nlopt_slsqp", "nlopt_mma", "nlopt_ccsa", "nlopt_lbfgs"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace graybox
