// external:CMD: the example that users copy, and every way a program can fail.
#include "solvers/external/external_solver.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/registry.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

const std::string kExample = GRAYBOX_SOURCE_DIR "/scripts/examples/external_solver.py";

InformationSet scalars(const std::vector<double>& values) {
  AlignedArray information(values.size());
  std::ranges::copy(values, information.begin());
  return InformationSet(1, std::move(information));
}

InformationSet random_set(std::size_t count, std::size_t dimension) {
  Random random(1);
  AlignedArray information(count * packed_size(dimension), 0.0);
  double* entry = information.data();
  std::vector<double> root(dimension * dimension);
  for (std::size_t i = 0; i < count; ++i) {
    for (double& x : root) x = random.normal();
    for (std::size_t a = 0; a < dimension; ++a) {
      for (std::size_t b = 0; b <= a; ++b, ++entry) {
        for (std::size_t c = 0; c < dimension; ++c) {
          *entry += root[a * dimension + c] * root[b * dimension + c];
        }
      }
    }
  }
  return InformationSet(dimension, std::move(information));
}

// Runs a line of shell as the back-end; $1 to $4 are the arguments.
Solution run(const std::string& command, const InformationSet& set, SolveOptions options = {},
             SolveObserver* observer = nullptr) {
  return ExternalSolver("external:" + command).solve(set, options, observer);
}

std::string writing(const std::string& json) { return "f() { echo '" + json + "' > \"$2\"; }; f"; }

const std::string kBest =
    R"({"format": "graybox-design/1", "support": [{"index": 1, "weight": 1}]})";

void expect_uniform(const Solution& solution, std::size_t count) {
  EXPECT_EQ(solution.design.weights, std::vector<double>(count, 1.0 / static_cast<double>(count)));
}

TEST(ExternalSolver, RunsTheExample) {
  if (std::system("/usr/bin/python3 -c 'import h5py, numpy' 2> /dev/null") != 0) {
    GTEST_SKIP() << "/usr/bin/python3 lacks h5py or numpy (python3-h5py, python3-numpy)";
  }
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at("external:/usr/bin/python3 '" + kExample + "'");
  const InformationSet set = random_set(60, 4);
  const Solution solution = solver.solve(set, {.duality_gap = 1e-3, .time_limit = 60.0});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  EXPECT_LE(certify(set, solution.design).duality_gap, 1e-3 * (1.0 + 1e-9));
  EXPECT_GT(solution.counters.seconds, 0.0);

  // Time for one step at most, however fast the machine: a limit that a fast one could meet would
  // make the answer depend on it.
  const Solution short_of_it = solver.solve(set, {.duality_gap = 1e-6, .time_limit = 1e-6});
  EXPECT_EQ(short_of_it.status, SolveStatus::kTimeLimit) << short_of_it.message;
}

TEST(ExternalSolver, ComesFromTheRegistryByName) {
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at("external:true");
  EXPECT_EQ(solver.name(), "external:true");
  EXPECT_EQ(&solver, &registry.at("external:true"));
  EXPECT_THROW(static_cast<void>(registry.at("external: ")), InputError);
}

TEST(ExternalSolver, PassesFilesGapAndSeconds) {
  const InformationSet set = scalars({1.0, 2.0});
  const std::string check = "f() { test -s \"$1\" && test \"$3\" = 0.001 && test \"$4\" = 7.5 && " +
                            ("echo '" + kBest + "' > \"$2\"; }; f");
  const Solution solution = run(check, set, {.duality_gap = 1e-3, .time_limit = 7.5});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  EXPECT_EQ(solution.design.weights, (std::vector<double>{0.0, 1.0}));
}

TEST(ExternalSolver, JudgesADesignWithoutStatusByItsGap) {
  const Solution solution = run(writing(kBest), scalars({2.0, 1.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_NE(solution.message.find("gap of 1"), std::string::npos) << solution.message;
  EXPECT_EQ(solution.design.weights, (std::vector<double>{0.0, 1.0}));
}

TEST(ExternalSolver, LeavesAFalseClaimToTheChecker) {
  const InformationSet set = scalars({2.0, 1.0});
  const Solution solution = run(writing(R"({"format": "graybox-design/1", "status": "solved",
                      "support": [{"index": 1, "weight": 1}]})"),
                                set);
  EXPECT_EQ(solution.status, SolveStatus::kSolved);
  EXPECT_NEAR(certify(set, solution.design).duality_gap, 1.0, 1e-12);
}

TEST(ExternalSolver, ReportsAProgramThatIsNotThere) {
  const Solution solution = run("/no/such/program", scalars({1.0, 2.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_EQ(solution.message, "no such program: /no/such/program");
  expect_uniform(solution, 2);
}

TEST(ExternalSolver, ReportsExitCodeAndLastWords) {
  const Solution solution =
      run("f() { echo first; echo 'matrix is singular' >&2; exit 3; }; f", scalars({1.0, 2.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_EQ(solution.message, "ended with exit code 3: matrix is singular");
  expect_uniform(solution, 2);
}

TEST(ExternalSolver, ReportsACrash) {
  const Solution solution = run("f() { kill -SEGV $$; sleep 9; }; f", scalars({1.0, 2.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_NE(solution.message.find("signal 11"), std::string::npos) << solution.message;
}

TEST(ExternalSolver, ReportsAMissingDesign) {
  const Solution solution = run("true", scalars({1.0, 2.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_NE(solution.message.find("no design.json"), std::string::npos) << solution.message;
  expect_uniform(solution, 2);
}

TEST(ExternalSolver, RefusesWhatIsNoDesign) {
  const InformationSet set = scalars({1.0, 2.0});
  for (const std::string& json : {
           std::string("{ this is not JSON"),
           std::string(R"({"format": "something-else/1"})"),
           std::string(R"({"format": "graybox-design/1"})"),
           std::string(R"({"format": "graybox-design/1", "support": [{"index": 7, "weight": 1}]})"),
           std::string(
               R"({"format": "graybox-design/1", "support": [{"index": 0, "weight": 0.5}]})"),
           std::string(R"({"format": "graybox-design/1", "support":
               [{"index": 0, "weight": 1.5}, {"index": 1, "weight": -0.5}]})"),
       }) {
    const Solution solution = run(writing(json), set);
    EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure) << json;
    EXPECT_NE(solution.message.find("design.json"), std::string::npos) << solution.message;
    expect_uniform(solution, 2);
  }
}

TEST(ExternalSolver, ReportsADesignOfASingularMatrix) {
  AlignedArray information(6);
  std::ranges::copy(std::vector<double>{1.0, 0.0, 0.0, 0.0, 0.0, 1.0}, information.begin());
  const Solution solution = run(writing(kBest), InformationSet(2, std::move(information)));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_NE(solution.message.find("inf"), std::string::npos) << solution.message;
}

// The program and its child inherit the writing end of a pipe: it ends when both are gone.
TEST(ExternalSolver, KillsTheProgramAndAllItStarted) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const Solution solution =
      run("f() { sleep 60 & wait; }; f", scalars({1.0, 2.0}), {.time_limit = 0.05});
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit) << solution.message;
  expect_uniform(solution, 2);
  close(ends[1]);
  pollfd reading{.fd = ends[0], .events = POLLIN, .revents = 0};
  EXPECT_EQ(poll(&reading, 1, 20000), 1);
  EXPECT_TRUE(reading.revents & POLLHUP);
  close(ends[0]);
}

TEST(ExternalSolver, KeepsWhatAKilledProgramHasWritten) {
  const Solution solution = run("f() { echo '" + kBest + "' > \"$2\"; sleep 60; }; f",
                                scalars({1.0, 2.0}), {.time_limit = 0.1});
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit);
  EXPECT_EQ(solution.design.weights, (std::vector<double>{0.0, 1.0}));
}

class StopAtOnce final : public SolveObserver {
 public:
  bool on_progress(const TracePoint&) override { return false; }
};

TEST(ExternalSolver, StopsWhenTheObserverAsks) {
  StopAtOnce observer;
  const Solution solution = run("f() { sleep 60; }; f", scalars({1.0, 2.0}), {}, &observer);
  EXPECT_EQ(solution.status, SolveStatus::kTimeLimit);
  EXPECT_LT(solution.counters.seconds, 30.0);
}

TEST(ExternalSolver, LeavesNoFilesBehind) {
  const fs::path folder = fs::path(::testing::TempDir()) / "graybox_external_folder";
  fs::remove_all(folder);
  fs::create_directories(folder);
  setenv("TMPDIR", folder.c_str(), 1);
  static_cast<void>(run(writing(kBest), scalars({1.0, 2.0})));
  static_cast<void>(run("false", scalars({1.0, 2.0})));
  unsetenv("TMPDIR");
  EXPECT_TRUE(fs::is_empty(folder));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace graybox
