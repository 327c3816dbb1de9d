// external:CMD: the example that users copy, and every way a program can fail.
#include "solvers/external/external_solver.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/registry.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

const std::string kExamples = GRAYBOX_SOURCE_DIR "/scripts/examples/";
const std::string kRivals = GRAYBOX_SOURCE_DIR "/scripts/rivals/";

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

// An example in one language: whether it can run here, and its command.
struct Example {
  const char* language;
  const char* check;
  std::string command;
};

class ExternalExample : public ::testing::TestWithParam<Example> {};

TEST_P(ExternalExample, SolvesWithinItsTime) {
  const Example& example = GetParam();
  if (std::system((std::string("(") + example.check + ") > /dev/null 2>&1").c_str()) != 0) {
    GTEST_SKIP() << "not here: " << example.check;
  }
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at("external:" + example.command);
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

INSTANTIATE_TEST_SUITE_P(
    Of, ExternalExample,
    ::testing::Values(
        Example{"Python", "/usr/bin/python3 -c 'import numpy'",
                "/usr/bin/python3 '" + kExamples + "external_solver.py' {npy}"},
        Example{"R", "Rscript --version", "Rscript '" + kExamples + "external_solver.R' {csv}"},
        Example{"Julia", "julia --version", "julia '" + kExamples + "external_solver.jl' {csv}"},
        Example{"Octave", "octave-cli --version",
                "octave-cli --path '" + kExamples +
                    "' --eval \"external_solver('{csv}', '{design}', {gap}, {seconds})\""},
        Example{"CVXOPT", "/usr/bin/python3 -c 'import cvxopt, numpy'",
                "/usr/bin/python3 '" + kRivals + "cvxopt_solver.py' {npy}"}),
    [](const auto& each) { return std::string(each.param.language); });

// To a gap that first-order methods don't reach, on candidates that differ by orders of magnitude.
TEST(ExternalSolver, CvxoptIsARivalWorthTheName) {
  if (std::system("/usr/bin/python3 -c 'import cvxopt, numpy' > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "not here: python3-cvxopt";
  }
  const std::string command = "/usr/bin/python3 '" + kRivals + "cvxopt_solver.py' {npy}";
  for (const char* family : {"rob", "r1g"}) {
    const InformationSet set = make_family(family, 400, 6);
    const Solution solution = run(command, set, {.duality_gap = 1e-8});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    EXPECT_LE(certify(set, solution.design).duality_gap, 1e-8) << family;
    EXPECT_GT(solution.account.seconds, 0.0);
    EXPECT_FALSE(solution.account.trace.empty());
  }
}

// The problem as conic solvers read it, solved as what it says: weights and value are right.
TEST(ExternalSolver, TheConicProblemHasTheSameSolution) {
  if (std::system("/usr/bin/python3 -c 'import cvxopt, numpy' > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "not here: python3-cvxopt";
  }
  const std::string command = "/usr/bin/python3 '" + kExamples + "conic_solver.py' {cbf}";
  for (const char* family : {"wis", "r1g"}) {
    const InformationSet set = make_family(family, 40, 4);
    const Solution solution = run(command, set, {.duality_gap = 1e-5});
    EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
    const Certificate certificate = certify(set, solution.design);
    EXPECT_LE(certificate.duality_gap, 1e-5) << family;
    const std::string label = "the optimal value is ";
    ASSERT_EQ(solution.message.find(label), 0U) << solution.message;
    EXPECT_NEAR(std::stod(solution.message.substr(label.size())), certificate.log_det, 1e-5);
  }
}

TEST(ExternalSolver, ARivalThatIsNotThereSaysSoInOneLine) {
  if (std::system("/usr/bin/python3 -c 'import numpy' > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "not here: python3-numpy";
  }
  const fs::path folder =
      fs::path(::testing::TempDir()) / ("graybox_absent_" + std::to_string(getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "cvxopt.py") << "raise ImportError\n";
  const Solution solution = run("PYTHONPATH='" + folder.string() + "' /usr/bin/python3 '" +
                                    kRivals + "cvxopt_solver.py' {npy}",
                                scalars({1.0, 2.0}));
  EXPECT_EQ(solution.status, SolveStatus::kNumericalFailure);
  EXPECT_EQ(solution.message,
            "ended with exit code 1: CVXOPT is not here: apt-get install python3-cvxopt");
  fs::remove_all(folder);
}

// The example in C is compiled as its first lines say, with every warning an error.
TEST(ExternalSolver, RunsTheExampleInC) {
  if (std::system("cc --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "there is no cc";
  const std::string program =
      (fs::path(::testing::TempDir()) / ("graybox_external_c_" + std::to_string(getpid())))
          .string();
  ASSERT_EQ(std::system(("cc -std=c11 -O2 -Wall -Wextra -Wconversion -pedantic -Werror '" +
                         kExamples + "external_solver.c' -lm -o '" + program + "'")
                            .c_str()),
            0);
  const InformationSet set = random_set(300, 5);
  const Solution solution = run("'" + program + "' {npy}", set, {.duality_gap = 1e-5});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  EXPECT_LE(certify(set, solution.design).duality_gap, 1e-5 * (1.0 + 1e-9));
  const Solution wrong = run("'" + program + "' {csv}", set);
  EXPECT_EQ(wrong.message, "ended with exit code 1: the set is no .npy of version 1");
  fs::remove(program);
}

// The program copies the set it is handed; it is the same whatever its format.
TEST(ExternalSolver, HandsTheSetOverInTheFormatAskedFor) {
  const InformationSet set = random_set(7, 3);
  const std::string copy =
      (fs::path(::testing::TempDir()) / ("graybox_handed_" + std::to_string(getpid()))).string();
  for (const std::string format : {"h5", "npy", "csv", "mat"}) {
    const std::string file = copy + "." + format;
    static_cast<void>(run("cp {" + format + "} '" + file + "' && : ", set));
    EXPECT_EQ(read_information_set(file).content_hash(), set.content_hash()) << format;
    fs::remove(file);
  }
}

std::string last_words(const std::string& command, SolveOptions options = {}) {
  return run("f() { echo \"$@\"; exit 1; }; f " + command, scalars({1.0, 2.0}), options).message;
}

TEST(ExternalSolver, PutsArgumentsWhereTheCommandNamesThem) {
  const SolveOptions options{.duality_gap = 1e-3, .time_limit = 7.5, .seed = 9, .threads = 2};
  EXPECT_TRUE(last_words("a", options).ends_with("/design.json 0.001 7.5"));
  EXPECT_NE(last_words("a", options).find(": a /"), std::string::npos);
  EXPECT_TRUE(last_words("{csv} --fast", options).ends_with("/design.json 0.001 7.5"));
  EXPECT_NE(last_words("{csv} --fast", options).find("/problem.csv --fast /"), std::string::npos);
  EXPECT_TRUE(last_words("{seconds} x{gap}x '{seconds} {seed} {threads}' {h5} {design}", options)
                  .ends_with("/design.json"));
  EXPECT_NE(last_words("{seconds} x{gap}x '{seconds} {seed} {threads}' {h5} {design}", options)
                .find(": 7.5 x0.001x 7.5 9 2 /"),
            std::string::npos);
  EXPECT_NE(last_words("${npy} {seconds}").find(": inf /"), std::string::npos);
}

TEST(ExternalSolver, RefusesTwoFormatsAndPathsThatAShellWouldTakeApart) {
  EXPECT_THROW(ExternalSolver("external:a {npy} {csv}"), InputError);
  const fs::path folder = fs::path(::testing::TempDir()) / "graybox external";
  fs::create_directories(folder);
  setenv("TMPDIR", folder.c_str(), 1);
  EXPECT_THROW(static_cast<void>(run("true {npy}", scalars({1.0, 2.0}))), InputError);
  // Without placeholders paths are arguments, which may hold anything.
  EXPECT_EQ(run(writing(kBest), scalars({1.0, 2.0})).status, SolveStatus::kSolved);
  unsetenv("TMPDIR");
  EXPECT_TRUE(fs::is_empty(folder));
  fs::remove_all(folder);
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

// Uniform weights on one parameter's candidates of equal worth are optimal, repaired or not.
TEST(ExternalSolver, RepairsWeightsThatMissTheSimplexByRounding) {
  const InformationSet set = scalars({1.0, 1.0, 1.0});
  const Solution solution = run(writing(R"({"format": "graybox-design/1", "support":
      [{"index": 0, "weight": 0.5}, {"index": 1, "weight": 0.5000005},
       {"index": 2, "weight": -2e-7}]})"),
                                set, {.duality_gap = 1e-9});
  EXPECT_EQ(solution.status, SolveStatus::kSolved) << solution.message;
  EXPECT_DOUBLE_EQ(solution.repair.clipped, 2e-7);
  EXPECT_NEAR(solution.repair.rescaled, 5e-7, 1e-15);
  EXPECT_EQ(solution.message,
            "weights repaired: 2e-07 below zero clipped, a sum of 1 + 5e-07 put right");
  const std::vector<double>& weights = solution.design.weights;
  EXPECT_EQ(weights[2], 0.0);
  EXPECT_NEAR(weights[0] + weights[1], 1.0, 1e-15);
  EXPECT_DOUBLE_EQ(weights[1] / weights[0], 0.5000005 / 0.5);
  EXPECT_EQ(certify(set, solution.design).status, CertificateStatus::kCertified);
}

TEST(ExternalSolver, RepairsNothingThatIsADesignAndNothingThatIsFarFromOne) {
  const InformationSet set = scalars({1.0, 1.0});
  const auto answer = [&](const std::string& first, const std::string& second) {
    return run(writing(R"({"format": "graybox-design/1", "support": [{"index": 0, "weight": )" +
                       first + R"(}, {"index": 1, "weight": )" + second + "}]}"),
               set);
  };
  const Solution whole = answer("0.3", "0.7000000000001");
  EXPECT_FALSE(whole.repair.any());
  EXPECT_EQ(whole.design.weights, (std::vector<double>{0.3, 0.7000000000001}));
  for (const auto& [first, second] :
       {std::pair{"0.3", "0.700002"}, std::pair{"0.3", "0.699998"}, std::pair{"1.000002", "-2e-6"},
        std::pair{"-0.9999995", "2"}}) {
    const Solution refused = answer(first, second);
    EXPECT_EQ(refused.status, SolveStatus::kNumericalFailure) << first << ", " << second;
    EXPECT_NE(refused.message.find("design.json: support"), std::string::npos) << refused.message;
    EXPECT_FALSE(refused.repair.any());
    expect_uniform(refused, 2);
  }
}

TEST(ExternalSolver, KeepsTheProgramsOwnAccountBesideWhatIsMeasured) {
  const InformationSet set = scalars({1.0, 2.0});
  const auto answer = [&](const std::string& account) {
    return run(writing(R"({"format": "graybox-design/1", )" + account +
                       R"("support": [{"index": 1, "weight": 1}]})"),
               set);
  };
  const Solution told =
      answer(R"("seconds": 1e-9, "trace": [[0, null], [1e-10, 0.5], [2e-10, 0]],)");
  EXPECT_EQ(told.account.seconds, 1e-9);
  EXPECT_GT(told.counters.seconds, 1e-6);  // of starting a shell
  ASSERT_EQ(told.account.trace.size(), 3U);
  EXPECT_TRUE(std::isinf(told.account.trace[0].duality_gap));
  EXPECT_EQ(told.account.trace[1].duality_gap, 0.5);
  EXPECT_EQ(told.account.trace[2].seconds, 2e-10);
  ASSERT_EQ(told.trace.size(), 1U);  // measured: the end alone
  EXPECT_EQ(answer(R"("counters": {"seconds": 7, "iterations": 3},)").account.seconds, 7.0);
  EXPECT_EQ(answer(R"("counters": {"seconds": 7, "iterations": 3},)").counters.iterations, 3);
  EXPECT_FALSE(answer("").account.seconds.has_value());
  for (const std::string broken :
       {R"("seconds": -1,)", R"("seconds": "1 s",)", R"("trace": [0.1],)", R"("trace": [[0.1]],)",
        R"("trace": [[0.2, 1], [0.1, 0.5]],)", R"("trace": {},)"}) {
    const Solution refused = answer(broken);
    EXPECT_EQ(refused.status, SolveStatus::kNumericalFailure) << broken;
    EXPECT_NE(refused.message.find("design.json: "), std::string::npos) << refused.message;
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
