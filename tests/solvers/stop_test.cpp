// Time limits and requests to stop: what stop.hpp says, and that every back-end listens.
#include "problems/base/stop.hpp"

#include <gtest/gtest.h>
#include <time.h>

#include <limits>
#include <string>
#include <thread>
#include <utility>

#include "solvers/certificates/certificate.hpp"
#include "solvers/exact/exact_method.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/registered_solvers.hpp"

namespace graybox {
namespace {

using namespace testing_sets;
using namespace testing_solvers;

class Stop : public ::testing::Test {
 protected:
  void TearDown() override { forget_stops(); }
};

TEST_F(Stop, IsSaidByThisThreadsLimitUntilItIsGone) {
  EXPECT_FALSE(stop_requested());
  {
    const TimeLimit none(std::numeric_limits<double>::infinity());
    EXPECT_FALSE(stop_requested());
    const TimeLimit limit(0.0);
    EXPECT_TRUE(stop_requested());
    const StopClock clock;
    bool others = true, by_clock = false;
    std::thread([&] {
      others = stop_requested();
      by_clock = clock.stops();
    }).join();
    EXPECT_FALSE(others);
    EXPECT_TRUE(by_clock);
    EXPECT_FALSE(StopClock::never().stops());
    EXPECT_THROW(stop_if_requested(), Stopped);
  }
  EXPECT_FALSE(stop_requested());
}

TEST_F(Stop, TheShorterOfTwoLimitsCounts) {
  const TimeLimit shorter(0.0);
  const TimeLimit longer(1e6);
  EXPECT_TRUE(stop_requested());
}

TEST_F(Stop, AnExtendedLimitIsLater) {
  TimeLimit limit(0.0);
  limit.extend(1e6);
  EXPECT_FALSE(stop_requested());
}

TEST_F(Stop, IsSaidToAllThreadsByARequestAndByTheProcess) {
  request_stop();
  EXPECT_TRUE(stop_was_asked_for());
  EXPECT_TRUE(stop_requested());
  forget_stops();
  EXPECT_FALSE(stop_requested());
  limit_process(0.0);
  EXPECT_FALSE(stop_was_asked_for());
  bool other = false;
  std::thread([&] { other = stop_requested(); }).join();
  EXPECT_TRUE(other);
}

double cpu_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void expect_design(const InformationSet& set, const Solution& solution) {
  if (solution.status == SolveStatus::kUnsupported) return;
  const Certificate proof = certify(set, solution.design);
  EXPECT_NE(proof.status, CertificateStatus::kNotADesign) << proof.message;
}

// Finding S4: factorisations, sums over all candidates and changes of coordinates at d = 60 take
// seconds, and some back-ends looked at the clock between iterations only.
class EveryBackEnd : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryBackEnd, EndsAtItsTimeLimitWithADesign) {
  constexpr double kLimit = 0.5;
  const Solver& solver = registry().at(GetParam());
  for (const auto& [count, rank] : {std::pair<std::size_t, Eigen::Index>{400, 60}, {2500, 1}}) {
    SCOPED_TRACE(count);
    const InformationSet set = wishart(60, count, rank, 1, 3.0);
    const double before = cpu_seconds();
    const Solution solution = solver.solve(set, {.duality_gap = 1e-12, .time_limit = kLimit});
    // The work of this thread, which a busy machine does not make more; three times what is
    // allowed, for sanitizers.
    EXPECT_LT(cpu_seconds() - before, 3.0 * (kLimit + 1.0));
    EXPECT_NE(solution.status, SolveStatus::kIterationLimit);
    expect_design(set, solution);
  }
}

TEST_P(EveryBackEnd, EndsWhenAskedToBeforeItBegins) {
  const InformationSet set = wishart(12, 300, 12, 2);
  request_stop();
  const Solution solution = registry().at(GetParam()).solve(set, {.duality_gap = 1e-12});
  forget_stops();
  if (solution.status != SolveStatus::kUnsupported) {
    EXPECT_EQ(solution.status, SolveStatus::kTimeLimit);
    EXPECT_EQ(solution.design.weights.size(), set.candidate_count());
  }
}

INSTANTIATE_TEST_SUITE_P(Registered, EveryBackEnd, ::testing::ValuesIn(available_names()),
                         [](const auto& name) { return name.param; });

// Finding S5: the exchange asked neither.
TEST_F(Stop, EveryExactMethodEndsAtItsTimeLimitWithADesign) {
  constexpr double kLimit = 0.5;
  const InformationSet set = wishart(40, 1500, 1, 3);
  const Relaxation relaxation = solve_relaxation(set, {.duality_gap = 1e-6});
  for (const auto& method : exact_methods()) {
    SCOPED_TRACE(method->name());
    const double before = cpu_seconds();
    const ExactSolution answer = method->solve(
        set, relaxation, {.experiments = 60, .time_limit = relaxation.seconds + kLimit});
    EXPECT_LT(cpu_seconds() - before, 3.0 * (kLimit + 1.0));
    EXPECT_EQ(answer.design.experiments(), 60);
  }
}

}  // namespace
}  // namespace graybox
