#include "bench/study/study.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench/study/environment.hpp"
#include "bench/study/process.hpp"
#include "bench/study/row_file.hpp"
#include "bench/study/run_row.hpp"
#include "bench/study/statistics.hpp"
#include "bench/study/study_sets.hpp"
#include "bench/study/summary.hpp"
#include "bench/study/tables.hpp"
#include "bench/study/verify.hpp"
#include "bench/study_page/page_facts.hpp"
#include "bench/study_page/solver_sections.hpp"
#include "bench/study_page/study_page.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "tests/support/built_executable.hpp"
#include "tests/support/study_solvers.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// H = g g' with g standard normal, d = 3.
InformationSet small_set(const std::string& family, std::size_t count) {
  constexpr std::size_t d = 3;
  Random random(family == "robot" ? 1 : 2);
  AlignedArray information(count * packed_size(d));
  for (std::size_t i = 0; i < count; ++i) {
    double g[d];
    for (double& x : g) x = random.normal();
    for (std::size_t r = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c) {
        information[i * packed_size(d) + packed_index(r, c)] = g[r] * g[c];
      }
    }
  }
  return InformationSet(d, std::move(information), {}, {}, family);
}

class Study : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("graybox_study_") + test->name() + "_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    options_.output = folder_ / "results";
    options_.max_candidates = 100;
    options_.mode = StudyMode::kQuick;
    options_.duality_gap = 1e-3;
    options_.families = false;
    options_.time_limit = 5.0;
    setup_.make_set = small_set;
    setup_.worker = {testing::built_executable("tests/study_worker")};
    setup_.binary = "test";
  }
  void TearDown() override { fs::remove_all(folder_); }

  StudyOutcome run(const std::vector<std::string>& solvers) {
    std::FILE* log = std::fopen((folder_ / "log.txt").c_str(), "w");
    Progress progress(log);
    const StudyOutcome outcome =
        run_study(options_, testing::study_registry(solvers), setup_, progress);
    std::fclose(log);
    return outcome;
  }
  [[nodiscard]] StudyRows rows() const { return read_rows(options_.output / "rows.jsonl"); }
  [[nodiscard]] std::string log() const { return text(folder_ / "log.txt"); }
  static std::string text(const fs::path& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  fs::path folder_;
  StudyOptions options_;
  StudySetup setup_;
};

RunRow example_row() {
  RunRow row;
  row.key = {"scaling", "abc", "honest", 1e-6, 2, 1, 7, 10.0, 1000, "binary", ""};
  row.family = "robot";
  row.candidates = 50;
  row.dimension = 12;
  row.status = ReportStatus::kSolved;
  row.claimed = "solved";
  row.seconds = 0.125;
  row.duality_gap = 1e-7;
  row.rounding_bound = 1e-15;
  row.log_det = -3.5;
  row.passes = 4.5;
  row.reached["1e-1"] = {0.01, 1.0};
  row.trace = {{0.0, 1.0, kInfinity, 1}, {0.1, 4.5, 1e-7, 9}};
  row.message = "fine, \"quoted\"";
  row.solve_cpu_seconds = 0.25;
  row.account.seconds = 0.0625;
  row.account.trace = {{0.0, 0.0, kInfinity, 0}, {0.0625, 0.0, 1e-7, 0}};
  row.repair = {1e-8, -2e-8};
  return row;
}

TEST_F(Study, RowsSurviveTheirFile) {
  RunRow row = example_row();
  const RunRow back = nlohmann::json::parse(nlohmann::json(row).dump()).get<RunRow>();
  EXPECT_EQ(back.key, row.key);
  EXPECT_EQ(back.status, row.status);
  EXPECT_EQ(back.seconds, row.seconds);
  EXPECT_EQ(back.log_det, row.log_det);
  EXPECT_EQ(back.message, row.message);
  EXPECT_EQ(back.reached.at("1e-1").passes, 1.0);
  EXPECT_EQ(back.solve_cpu_seconds, 0.25);
  EXPECT_EQ(back.account.seconds, 0.0625);
  ASSERT_EQ(back.account.trace.size(), 2U);
  EXPECT_TRUE(std::isinf(back.account.trace[0].duality_gap));
  EXPECT_EQ(back.account.trace[1].duality_gap, 1e-7);
  EXPECT_EQ(back.repair, row.repair);
  ASSERT_EQ(back.trace.size(), 2U);
  EXPECT_TRUE(std::isinf(back.trace[0].duality_gap));
  EXPECT_EQ(back.trace[1].iteration, 9);
  row.duality_gap = kInfinity;
  EXPECT_TRUE(
      std::isinf(nlohmann::json::parse(nlohmann::json(row).dump()).get<RunRow>().duality_gap));
}

TEST_F(Study, ATornLastLineIsPassedOverAndCutOff) {
  const fs::path file = folder_ / "rows.jsonl";
  {
    RowFile out(file);
    out.append(example_row());
    out.append(example_row());
  }
  std::ofstream(file, std::ios::app) << R"({"kind":"run","solver":"ho)";
  EXPECT_EQ(read_rows(file).runs.size(), 2U);
  EXPECT_EQ(read_rows(file).unreadable, 1U);
  RowFile(file).append(example_row());
  EXPECT_EQ(read_rows(file).runs.size(), 3U);
  EXPECT_EQ(read_rows(file).unreadable, 0U);
}

TEST_F(Study, ASkipIsForgottenOnceThePointWasRun) {
  const fs::path file = folder_ / "rows.jsonl";
  RowFile out(file);
  out.append(SkipRow{"scaling", "robot", 50, "honest", 1e-6, "no time"});
  out.append(SkipRow{"scaling", "robot", 100, "honest", 1e-6, "no time"});
  EXPECT_EQ(read_rows(file).skips.size(), 2U);
  out.append(example_row());
  ASSERT_EQ(read_rows(file).skips.size(), 1U);
  EXPECT_EQ(read_rows(file).skips[0].candidates, 100U);
}

TEST(Process, ReportsExitCodesSignalsAndOutput) {
  const ProcessOutcome three =
      run_process({.command = {"sh", "-c", "echo out; echo err >&2; exit 3"}});
  EXPECT_EQ(three.ending, ProcessEnding::kExited);
  EXPECT_EQ(three.code, 3);
  EXPECT_EQ(three.output, "out\n");
  EXPECT_EQ(three.error_tail, "err\n");
  const ProcessOutcome signalled = run_process({.command = {"sh", "-c", "kill -SEGV $$"}});
  EXPECT_EQ(signalled.ending, ProcessEnding::kSignalled);
  EXPECT_EQ(signalled.code, SIGSEGV);
  EXPECT_EQ(run_process({.command = {"/no/such/program"}}).code, 127);
}

TEST(Process, PassesTheEnvironmentOn) {
  const ProcessOutcome outcome = run_process({.command = {"sh", "-c", "echo $GRAYBOX_X$HOME"},
                                              .environment = {{"GRAYBOX_X", "7"}, {"HOME", "h"}}});
  EXPECT_EQ(outcome.output, "7h\n");
}

TEST(Process, KillsTheWholeGroupAtTheTimeLimit) {
  const ProcessOutcome outcome = run_process(
      {.command = {"sh", "-c", "echo started; sleep 60 & sleep 60"}, .time_limit = 0.3});
  EXPECT_EQ(outcome.ending, ProcessEnding::kTimeLimit);
  EXPECT_EQ(outcome.output, "started\n");
  EXPECT_LT(outcome.seconds, 30.0);
}

// `tail` keeps the one line that it is given, all 300 MB, in a process that a shell has started.
TEST(Process, LimitsTheMemoryOfWhatTheChildHasStarted) {
  const ProcessOutcome outcome =
      run_process({.command = {"sh", "-c", "head -c 300000000 /dev/zero | tail -n 1 | wc -c; true"},
                   .time_limit = 60.0,
                   .memory_limit = std::size_t{100} << 20});
  EXPECT_EQ(outcome.ending, ProcessEnding::kMemoryLimit);
  EXPECT_GT(outcome.peak_memory_bytes, std::size_t{50} << 20);
}

// The program in a session of its own inherits the writing end of a pipe: that ends with it.
TEST(Process, KillsWhatHasLeftTheGroup) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const ProcessOutcome outcome =
      run_process({.command = {"sh", "-c", "setsid sleep 60 & wait"}, .time_limit = 0.3});
  EXPECT_EQ(outcome.ending, ProcessEnding::kTimeLimit);
  close(ends[1]);
  pollfd reading{.fd = ends[0], .events = POLLIN, .revents = 0};
  EXPECT_EQ(poll(&reading, 1, 20000), 1);
  EXPECT_TRUE(reading.revents & POLLHUP);
  close(ends[0]);
}

TEST(Process, StopsWhenInterrupted) {
  const ProcessOutcome outcome =
      run_process({.command = {"sleep", "60"}, .interrupted = [] { return true; }});
  EXPECT_EQ(outcome.ending, ProcessEnding::kInterrupted);
}

TEST(Classify, TheCheckerDecidesNotTheClaim) {
  const auto judged = [](SolveStatus claimed, double checked_gap) {
    WorkerAnswer answer;
    answer.claimed = claimed;
    Certificate certificate;
    certificate.status =
        std::isfinite(checked_gap) ? CertificateStatus::kCertified : CertificateStatus::kSingular;
    certificate.duality_gap = checked_gap;
    certificate.rounding_bound = 1e-14;
    return classify(ProcessOutcome{}, answer, certificate, 1e-6);
  };
  EXPECT_EQ(judged(SolveStatus::kSolved, 1e-6 - 2e-14), ReportStatus::kSolved);
  EXPECT_EQ(judged(SolveStatus::kSolved, 1e-6), ReportStatus::kNumericalFailure);  // not proven
  EXPECT_EQ(judged(SolveStatus::kSolved, 1e-6 + 1e-15), ReportStatus::kInaccurate);
  EXPECT_EQ(judged(SolveStatus::kSolved, -1e-13), ReportStatus::kNumericalFailure);
  EXPECT_EQ(judged(SolveStatus::kSolved, 1.1e-6), ReportStatus::kInaccurate);
  EXPECT_EQ(judged(SolveStatus::kSolved, 1.1e-5), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(judged(SolveStatus::kSolved, kInfinity), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(judged(SolveStatus::kNumericalFailure, 1e-7), ReportStatus::kSolved);
  EXPECT_EQ(judged(SolveStatus::kIterationLimit, 1e-2), ReportStatus::kIterationLimit);
  EXPECT_EQ(judged(SolveStatus::kUnsupported, kInfinity), ReportStatus::kUnsupported);
}

TEST(Classify, AWideRoundingBoundDoesNotExcuseAMiss) {
  WorkerAnswer answer;
  answer.claimed = SolveStatus::kSolved;
  Certificate certificate;
  certificate.status = CertificateStatus::kCertified;
  certificate.duality_gap = 0.5;
  certificate.rounding_bound = 1.0;
  EXPECT_EQ(classify(ProcessOutcome{}, answer, certificate, 1e-6), ReportStatus::kClaimedButWrong);
}

TEST(Classify, GapsBelowTheCheckedOneAreNotBelieved) {
  const std::vector<TracePoint> trace{{1, 1, 0.05, 1}, {2, 2, 1e-3, 2}, {3, 3, 1e-8, 3}};
  const auto reached = gaps_reached(trace, 5e-4, 0.0);
  ASSERT_EQ(reached.size(), 3U);
  EXPECT_EQ(reached.at("1e-1").seconds, 1.0);
  EXPECT_EQ(reached.at("1e-2").seconds, 2.0);
  EXPECT_EQ(reached.at("1e-3").seconds, 2.0);
  EXPECT_TRUE(gaps_reached(trace, kInfinity, 0.0).empty());
}

TEST_F(Study, EveryWayToFailGetsItsName) {
  options_.max_candidates = 50;
  options_.time_limit = 5.0;
  options_.memory_limit = std::size_t{400} << 20;
  run({});
  std::map<std::string, ReportStatus> status;
  std::map<std::string, RunRow> first;
  for (const RunRow& row : rows().runs) {
    if (row.key.repetition == 0) status[row.key.solver] = row.status, first[row.key.solver] = row;
  }
  EXPECT_EQ(status.at("honest"), ReportStatus::kSolved);
  EXPECT_EQ(status.at("liar"), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(status.at("quitter"), ReportStatus::kNumericalFailure);
  EXPECT_EQ(status.at("crasher"), ReportStatus::kCrashed);
  EXPECT_EQ(status.at("sleeper"), ReportStatus::kTimeLimit);
  EXPECT_EQ(status.at("glutton"), ReportStatus::kOutOfMemory);
  EXPECT_EQ(status.at("short"), ReportStatus::kOutOfMemory);

  EXPECT_EQ(first.at("liar").claimed, "solved");
  EXPECT_GT(first.at("liar").duality_gap, 1e-2);
  EXPECT_TRUE(first.at("liar").reached.empty() || !first.at("liar").reached.contains("1e-9"));
  EXPECT_LE(first.at("honest").duality_gap, 1e-3);
  EXPECT_GE(first.at("honest").trace.size(), 2U);
  EXPECT_GT(first.at("honest").passes, 1.0);
  EXPECT_LE(first.at("honest").seconds, first.at("honest").wall_seconds);
  EXPECT_GT(first.at("honest").solve_cpu_seconds, 0.0);
  EXPECT_LT(first.at("honest").solve_cpu_seconds, first.at("honest").cpu_seconds);
  EXPECT_GE(first.at("honest").peak_memory_bytes, first.at("honest").baseline_memory_bytes);
  // A killed run leaves the trace it had written.
  ASSERT_EQ(first.at("sleeper").trace.size(), 1U);
  EXPECT_EQ(first.at("sleeper").trace[0].duality_gap, 0.5);
  EXPECT_EQ(first.at("honest").key.problem, small_set("robot", 50).content_hash());
}

TEST_F(Study, AFalseClaimIsChargedTheLimit) {
  options_.max_candidates = 50;
  run({"honest", "liar"});
  std::size_t liars = 0, honest = 0;
  for (const PointSummary& point : summarise_points(rows().runs)) {
    if (point.solver == "liar") {
      ++liars;
      EXPECT_EQ(point.charged_seconds, 5.0);
    } else {
      ++honest;
      EXPECT_EQ(point.charged_seconds, point.seconds.median);
    }
  }
  EXPECT_GE(liars, 1U);
  EXPECT_GE(honest, 1U);
}

TEST_F(Study, RepeatsSolvedPointsAndThemAlone) {
  options_.max_candidates = 50;
  run({"honest", "quitter"});
  std::map<std::string, std::vector<int>> repetitions;
  for (const RunRow& row : rows().runs) {
    repetitions[row.key.solver].push_back(row.key.repetition);
  }
  EXPECT_GE(repetitions.at("honest").size(), 1U);
  EXPECT_LE(repetitions.at("honest").size(), 3U);
  EXPECT_EQ(repetitions.at("quitter"), std::vector<int>{0});
}

TEST_F(Study, StopsASolverAtTheSizeItCouldNotDo) {
  options_.time_limit = 1.5;
  run({"sleeper", "quitter"});
  const StudyRows all = rows();
  std::size_t sleeper_runs = 0, quitter_runs = 0;
  for (const RunRow& row : all.runs) {
    sleeper_runs += row.key.solver == "sleeper" ? 1U : 0U;
    quitter_runs += row.key.solver == "quitter" ? 1U : 0U;
  }
  EXPECT_EQ(sleeper_runs, 1U);
  EXPECT_EQ(quitter_runs, 2U);  // a numerical failure says nothing about larger sets
  ASSERT_EQ(all.skips.size(), 1U);
  EXPECT_EQ(all.skips[0].reason, "stopped at Q = 50: time_limit");
  EXPECT_EQ(all.skips[0].candidates, 100U);
}

TEST_F(Study, StopsASolverAtTheDrawItCouldNotDo) {
  options_.mode = StudyMode::kStandard;  // three draws
  options_.families = true;
  options_.max_candidates = 50;
  setup_.families = {.whole = {}, .drawn = {"wis"}, .dimensions = {}};
  run({"sleeper", "quitter"});
  std::map<std::string, std::vector<std::string>> drawn;
  for (const RunRow& row : rows().runs) {
    if (row.key.experiment == "draws") drawn[row.key.solver].push_back(row.family);
    EXPECT_EQ(row.origin.seed, study_set_seed(row.family));
  }
  EXPECT_EQ(drawn.at("sleeper"), std::vector<std::string>{"wis_draw_1"});
  EXPECT_EQ(drawn.at("quitter"),
            (std::vector<std::string>{"wis_draw_1", "wis_draw_2", "wis_draw_3"}));
  std::vector<std::string> reasons;
  for (const SkipRow& skip : rows().skips) reasons.push_back(skip.reason);
  EXPECT_EQ(reasons, std::vector<std::string>(2, "stopped at wis_draw_1: time_limit"));
}

TEST_F(Study, ResumesAfterATornLineAndRunsOnlyWhatIsMissing) {
  const StudyOutcome whole = run({"honest", "quitter", "crasher"});
  const std::size_t total = rows().runs.size();
  EXPECT_EQ(whole.runs_made, total);
  EXPECT_EQ(whole.runs_found, 0U);

  options_.resume = true;
  const StudyOutcome again = run({"honest", "quitter", "crasher"});
  EXPECT_EQ(again.runs_made, 0U);
  EXPECT_EQ(again.runs_found, total);

  // Cut the file in the middle of its last run row, as a kill would.
  const fs::path file = options_.output / "rows.jsonl";
  std::string content = text(file);
  const std::size_t last_run = content.rfind("\"kind\":\"run\"");
  std::ofstream(file) << content.substr(0, last_run + 20);
  const StudyOutcome repaired = run({"honest", "quitter", "crasher"});
  EXPECT_EQ(repaired.runs_made, 1U);
  EXPECT_EQ(rows().runs.size(), total);
  EXPECT_EQ(rows().unreadable, 0U);
}

TEST_F(Study, RunsOfAnotherProgramAreSetAsideNotMixedIn) {
  run({"quitter"});
  options_.resume = true;
  setup_.binary = "newer";
  const StudyOutcome outcome = run({"quitter"});
  EXPECT_EQ(outcome.runs_found, 0U);
  EXPECT_EQ(rows().runs.size(), 2U);
  for (const RunRow& row : rows().runs) EXPECT_EQ(row.key.binary, "newer");
  EXPECT_EQ(read_rows(options_.output / "rows_of_other_builds.jsonl").runs.size(), 2U);
}

TEST_F(Study, EndsCleanlyWhenInterrupted) {
  int polls = 0;
  setup_.interrupted = [&] { return ++polls > 3; };
  // Nothing that may end before the fourth look.
  const StudyOutcome outcome = run({"sleeper"});
  EXPECT_TRUE(outcome.interrupted);
  EXPECT_TRUE(rows().runs.empty());
  EXPECT_EQ(rows().unreadable, 0U);
}

TEST_F(Study, SaysOneLineAFinishedPointInAPipe) {
  run({"quitter", "crasher"});
  const std::string said = log();
  EXPECT_EQ(std::ranges::count(said, '\n'), 4);
  EXPECT_NE(said.find("robot Q = 50, quitter, gap 1e-03: numerical_failure"), std::string::npos);
  EXPECT_NE(said.find("crasher"), std::string::npos);
}

TEST_F(Study, RefusesWhatItCanNotRun) {
  options_.solvers = {"honset"};
  EXPECT_THROW(run({}), InputError);
  options_.solvers = {};
  options_.max_candidates = 10;
  EXPECT_THROW(run({}), InputError);
  options_.max_candidates = 100;
  options_.duality_gap = 0.0;
  EXPECT_THROW(run({}), InputError);
}

TEST_F(Study, WritesItsTablesAndSummary) {
  run({"honest", "liar"});
  const std::string summary = write_tables(rows(), options_.output);
  for (const char* name :
       {"points.csv", "fitted_exponents.csv", "time_to_gap.csv", "performance_profile.csv",
        "data_profile.csv", "profile_instances.csv", "mean_times.csv", "paired_ratios.csv",
        "agreement.csv", "headlines.csv", "skipped.csv"}) {
    EXPECT_TRUE(fs::exists(options_.output / "tables" / name)) << name;
  }
  EXPECT_NE(summary.find("claimed_but_wrong"), std::string::npos);
  EXPECT_NE(summary.find("Mean seconds to equal accuracy"), std::string::npos);
  EXPECT_NE(summary.find("| liar | claimed_but_wrong | 2 | robot Q = 50, gap 1e-03 |"),
            std::string::npos)
      << summary;
  EXPECT_NE(summary.find("processor"), std::string::npos);
  EXPECT_EQ(text(options_.output / "summary.md"), summary);
}

TEST(Environment, IsToldInWords) {
  const nlohmann::json found = {{"caches", {"L1 32K", "L2 512K"}},
                                {"memory", "24684092 kB"},
                                {"cores", 2},
                                {"date", "2026-11-21T08:40:01Z"},
                                {"system", "Debian"}};
  EXPECT_EQ(environment_words(found, "caches"), "L1 32K, L2 512K");
  EXPECT_EQ(environment_words(found, "memory"), "25.3 GB");  // 24684092 * 1024 bytes
  EXPECT_EQ(environment_words(found, "cores"), "2");
  EXPECT_EQ(environment_words(found, "system"), "Debian");
  EXPECT_EQ(environment_words(found, "date"), "2026-11-21T08:40:01Z");
  EXPECT_EQ(environment_words(found, "load"), "unknown");
}

// Lines that are no rows, however they came to be: they count, and the first is named.
TEST_F(Study, LinesThatAreNoRowsAreCounted) {
  const nlohmann::json good = example_row();
  const auto with = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json row = good;
    row[key] = value;
    return row.dump();
  };
  const std::vector<std::string> damaged{
      "hello",
      "[1, 2]",
      good.dump().substr(0, 200),
      with("kind", "rum"),
      with("kind", nullptr),
      with("seconds", nullptr),
      with("seconds", -1.0),
      with("candidates", -50),
      with("candidates", 0),
      with("gap", "1e-6"),
      with("gap", 0.0),
      with("status", 3),
      R"({"kind": "skip"})",
  };
  for (const std::string& line : damaged) {
    const fs::path file = folder_ / "rows.jsonl";
    std::ofstream(file) << good.dump() << "\n\n" << line << "\n" << good.dump() << "\n";
    const StudyRows rows = read_rows(file);
    EXPECT_EQ(rows.runs.size(), 2U) << line;
    EXPECT_EQ(rows.unreadable, 1U) << line;
    EXPECT_EQ(rows.first_unreadable, 3U) << line;
    EXPECT_EQ(unreadable_note(rows, "f"), "f: line 3 is no row of a study and is left out");
  }
}

// ---- the page -----------------------------------------------------------------------------------

// A row of one solver on one set, in seconds; infinite ones are not solved.
RunRow timed_row(const std::string& solver, const std::string& family, double seconds) {
  RunRow row = example_row();
  row.key.experiment = "families";
  row.key.solver = solver;
  row.key.problem = family;
  row.family = family;
  row.seconds = std::isfinite(seconds) ? seconds : 3.0;
  row.status = std::isfinite(seconds) ? ReportStatus::kSolved : ReportStatus::kTimeLimit;
  return row;
}

TEST(StudyPage, NamesTheWorstInstance) {
  const std::vector<RunRow> runs{timed_row("fast", "a", 1.0), timed_row("slow", "a", 8.0),
                                 timed_row("fast", "b", 2.0), timed_row("slow", "b", 10.0),
                                 timed_row("weak", "a", 0.5), timed_row("weak", "b", kInfinity)};
  const PageFacts facts = page_facts(summarise_points(runs));
  const auto worst = [&](const char* solver) { return worst_of(facts.of_solver(solver)); };
  EXPECT_EQ(worst("slow")->point.family, "a");  // 16 times, on b but 5
  EXPECT_DOUBLE_EQ(worst("slow")->ratio, 16.0);
  EXPECT_EQ(worst("slow")->fastest, "weak");
  EXPECT_EQ(worst("fast")->point.family, "a");
  EXPECT_EQ(worst("weak")->point.family, "b");  // not solved counts before any ratio
  EXPECT_EQ(status_words(facts.of_solver("weak")), "solved 1, time_limit 1");
  EXPECT_EQ(facts.solvers, (std::vector<std::string>{"fast", "slow", "weak"}));
}

// The colour of the first words, and what follows them.
std::string top_of(const StudyRows& rows) {
  const std::string page = study_page(rows, {});
  const std::size_t from = page.find("<h1");
  return page.substr(from, page.find("<h2", from) - from);
}

TEST(StudyPage, ATickIsForAWholeStudy) {
  StudyRows rows;
  rows.runs = {timed_row("fast", "a", 1.0), timed_row("weak", "a", 2.0)};
  const std::string whole = top_of(rows);
  EXPECT_NE(whole.find("passed"), std::string::npos) << whole;
  EXPECT_EQ(whole.find("unsolved"), std::string::npos) << whole;
  rows.unreadable = 3;
  rows.first_unreadable = 17;
  const std::string damaged = top_of(rows);
  EXPECT_EQ(damaged.find("passed"), std::string::npos) << damaged;
  EXPECT_NE(damaged.find("rows.jsonl: 3 lines are no rows of a study (the first: line 17)"),
            std::string::npos)
      << damaged;
  rows.unreadable = 0;
  rows.runs.push_back(timed_row("weak", "b", kInfinity));
  const std::string unsolved = top_of(rows);
  EXPECT_EQ(unsolved.find("passed"), std::string::npos) << unsolved;
  const std::size_t told = unsolved.find("1 of 3 runs is unsolved: 1 time_limit.");
  EXPECT_LT(told, unsolved.find("All certified answers")) << unsolved;
}

TEST(StudyPage, EscapesWhatSolversAreCalled) {
  const std::string name = "external:run <b>&\"x\"</script>";
  StudyRows rows;
  rows.runs = {timed_row(name, "a", 1.0)};
  const std::string page = study_page(rows, {});
  EXPECT_EQ(page.find("<b>&"), std::string::npos);
  EXPECT_NE(page.find("run &lt;b&gt;&amp;"), std::string::npos);
  EXPECT_NE(page.find("run \\u003cb>&"), std::string::npos);  // in the JSON
}

// ---- rows that can be verified -----------------------------------------------------------------

// Changes the first run row of a solver and verifies all.
class Verify : public Study {
 protected:
  RowVerification after(const std::string& solver,
                        const std::function<void(nlohmann::json&)>& change) {
    std::ifstream stream(options_.output / "rows.jsonl");
    std::string lines;
    bool changed = false;
    for (std::string line; std::getline(stream, line);) {
      nlohmann::json row = nlohmann::json::parse(line);
      if (!changed && row["kind"] == "run" && row["solver"] == solver) {
        change(row);
        changed = true;
      }
      lines += row.dump() + "\n";
    }
    EXPECT_TRUE(changed);
    std::ofstream(options_.output / "changed.jsonl") << lines;
    return verify_rows(options_.output / "changed.jsonl", small_set);
  }
  static void keep(nlohmann::json&) {}
  // [index, weight]. The multiplicative algorithm leaves most weights near zero.
  static nlohmann::json& heaviest(nlohmann::json& row) {
    return *std::ranges::max_element(row["design"]["support"], {}, [](const nlohmann::json& pair) {
      return pair[1].is_null() ? 0.0 : double(pair[1]);
    });
  }
};

TEST_F(Verify, TrueRowsAreFoundTrueWhateverTheSolverClaimed) {
  run({"honest", "liar", "quitter", "crasher"});
  const RowVerification found = after("honest", keep);
  EXPECT_TRUE(found.holds()) << describe(found) << found.lines.front();
  std::size_t answered = 0, crashed = 0;
  for (const RunRow& row : rows().runs) ++(row.key.solver == "crasher" ? crashed : answered);
  EXPECT_EQ(found.verified, answered);
  EXPECT_EQ(found.without_answer, crashed);
  EXPECT_EQ(found.without_design, 0U);
}

TEST_F(Verify, EveryFalseStatementIsFound) {
  run({"honest", "liar"});
  using Change = std::function<void(nlohmann::json&)>;
  const std::vector<std::pair<Change, std::string>> changes{
      {[](auto& row) { heaviest(row)[1] = 0.9 * double(heaviest(row)[1]); }, "states a gap"},
      {[](auto& row) { heaviest(row)[1] = nullptr; }, "states a gap"},
      {[](auto& row) { std::swap(heaviest(row)[0], row["design"]["support"].back()[0]); },
       "states a gap"},
      {[](auto& row) { row["design"]["support"][0][0] = 100; }, "candidate 100"},
      {[](auto& row) { row["duality_gap"] = 0.5 * double(row["duality_gap"]); }, "states a gap"},
      {[](auto& row) { row["duality_gap"] = 1e-12, row["rounding_bound"] = 1.0; }, "states a gap"},
      {[](auto& row) { row["duality_gap"] = nullptr; }, "states a gap"},
      {[](auto& row) { row["log_det"] = 1e-9 + double(row["log_det"]); }, "states log det M"},
      {[](auto& row) { row["support_size"] = 3; }, "states a support of 3"},
      {[](auto& row) { row["status"] = "inaccurate"; }, "is called inaccurate, but is solved"},
  };
  for (const auto& [change, words] : changes) {
    const RowVerification found = after("honest", change);
    EXPECT_FALSE(found.holds());
    EXPECT_EQ(found.false_rows, 1U) << words;
    ASSERT_EQ(found.lines.size(), 1U) << words;
    EXPECT_NE(found.lines[0].find("robot Q = 50, honest, gap 1e-03, run 1: "), std::string::npos);
    EXPECT_NE(found.lines[0].find(words), std::string::npos) << found.lines[0];
  }
  const RowVerification lie = after("liar", [](auto& row) { row["status"] = "solved"; });
  EXPECT_EQ(lie.false_rows, 1U);
  EXPECT_NE(lie.lines.at(0).find("is called solved, but is claimed_but_wrong"), std::string::npos);
}

TEST_F(Verify, WhatCanNotBeVerifiedIsSaid) {
  options_.max_candidates = 50;
  run({"honest"});
  const std::size_t count = rows().runs.size();
  const RowVerification old = after("honest", [](auto& row) { row.erase("design"); });
  EXPECT_EQ(old.without_design, 1U);
  EXPECT_EQ(old.false_rows, 0U);
  EXPECT_EQ(old.verified, count - 1);
  // Another set under the same name, and a generator of another seed.
  const auto other = verify_rows(options_.output / "rows.jsonl",
                                 [](const auto&, std::size_t q) { return small_set("other", q); });
  EXPECT_EQ(other.without_set, count);
  EXPECT_FALSE(other.holds());
  ASSERT_EQ(other.lines.size(), 1U);
  EXPECT_NE(other.lines[0].find("is now another set"), std::string::npos) << other.lines[0];
  // A row can't have a set made that no study has.
  const auto huge = after("honest", [](auto& row) { row["candidates"] = 1'000'000'000'000; });
  EXPECT_EQ(huge.without_set, count);
  EXPECT_NE(huge.lines.at(0).find("no set of the study"), std::string::npos) << huge.lines[0];
  const auto unknown = after("honest", [](auto& row) { row["set"]["generator"] = "wis_90000"; });
  EXPECT_EQ(unknown.without_set, count);
  const auto seed = after("honest", [](auto& row) { row["set"]["seed"] = 5; });
  EXPECT_EQ(seed.without_set, count);
  EXPECT_THROW((void)verify_rows(folder_ / "none.jsonl", small_set), InputError);
  std::ofstream(folder_ / "rows.jsonl") << "{}\n";
  EXPECT_FALSE(verify_rows(folder_ / "rows.jsonl", small_set).holds());
}

TEST_F(Verify, ManyWeightsStandInASideFileThatIsGuardedByItsHash) {
  Design design;
  for (std::size_t i = 0; i <= kLongestSupport; ++i)
    design.weights.push_back(1.0 / (1.0 + double(i)));
  design.weights.push_back(0.0);
  const StoredDesign stored = store_design(design, folder_);
  EXPECT_TRUE(stored.support.empty());
  EXPECT_EQ(store_design(design, folder_).file, stored.file);
  const StoredDesign back =
      nlohmann::json::parse(nlohmann::json(stored).dump()).get<StoredDesign>();
  EXPECT_EQ(stored_design(back, design.weights.size(), folder_).weights, design.weights);
  EXPECT_THROW((void)stored_design(back, 5, folder_), InputError);
  const fs::path file = folder_ / stored.file;
  std::string bytes = text(file);
  bytes[bytes.size() - 20] = static_cast<char>(bytes[bytes.size() - 20] ^ 1);
  std::ofstream(file, std::ios::binary) << bytes;
  EXPECT_THROW((void)stored_design(back, design.weights.size(), folder_), InputError);
  fs::remove(file);
  EXPECT_THROW((void)stored_design(back, design.weights.size(), folder_), InputError);
  // One weight less stands in the row, exactly.
  design.weights[0] = 0.0;
  const StoredDesign few = store_design(design, folder_);
  EXPECT_EQ(few.support.size(), kLongestSupport);
  EXPECT_EQ(stored_design(nlohmann::json::parse(nlohmann::json(few).dump()).get<StoredDesign>(),
                          design.weights.size(), folder_)
                .weights,
            design.weights);
}

TEST(Statistics, QuartilesInterpolateBetweenOrderStatistics) {
  EXPECT_EQ(quartiles({3.0}).median, 3.0);
  const Quartiles four = quartiles({4.0, 1.0, 3.0, 2.0});
  EXPECT_DOUBLE_EQ(four.lower, 1.75);
  EXPECT_DOUBLE_EQ(four.median, 2.5);
  EXPECT_DOUBLE_EQ(four.upper, 3.25);
  EXPECT_TRUE(std::isinf(quartiles({1.0, kInfinity}).upper));
  EXPECT_THROW((void)quartiles({}), InputError);
}

TEST(Statistics, ExactPowerLawsAreFoundWithoutUncertainty) {
  const std::vector<double> x{500, 1000, 2000, 4000, 7920};
  std::vector<double> y;
  for (const double each : x) y.push_back(3e-9 * std::pow(each, 2.5));
  const auto law = fit_power_law(x, y);
  ASSERT_TRUE(law);
  EXPECT_NEAR(law->exponent, 2.5, 1e-12);
  EXPECT_NEAR(law->factor / 3e-9, 1.0, 1e-10);
  EXPECT_NEAR(law->lower, 2.5, 1e-6);
  EXPECT_NEAR(law->upper, 2.5, 1e-6);
}

TEST(Statistics, ConfidenceOfTheExponentAgainstTheClosedForm) {
  // Residuals e, -2e, e are orthogonal to the line, so the slope is exact, the residual sum of
  // squares 6 e^2 with one degree of freedom, and sum (x - mean)^2 = 2.
  const double slope = 1.5, e = 0.01;
  const std::vector<double> x{std::exp(-1.0), 1.0, std::exp(1.0)};
  const std::vector<double> y{std::exp(-slope + e), std::exp(-2 * e), std::exp(slope + e)};
  const auto law = fit_power_law(x, y);
  ASSERT_TRUE(law);
  EXPECT_NEAR(law->exponent, slope, 1e-12);
  EXPECT_NEAR(law->upper - law->exponent, 12.7062 * e * std::sqrt(3.0), 1e-5);
  EXPECT_NEAR(law->exponent - law->lower, 12.7062 * e * std::sqrt(3.0), 1e-5);
}

TEST(Statistics, ConfidenceIntervalsCoverNineteenTimesInTwenty) {
  const std::vector<double> x{500, 1000, 2000, 4000, 7920};
  Random random(5);
  constexpr int kTrials = 4000;
  int covered = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> y;
    for (const double each : x) y.push_back(std::pow(each, 1.2) * std::exp(0.2 * random.normal()));
    const auto law = fit_power_law(x, y);
    covered += law->lower <= 1.2 && 1.2 <= law->upper ? 1 : 0;
  }
  // Five standard deviations of a binomial share around 0.95.
  EXPECT_NEAR(static_cast<double>(covered) / kTrials, 0.95, 5 * std::sqrt(0.95 * 0.05 / kTrials));
}

TEST(Statistics, TooFewPointsGiveNoLawAndTwoNoInterval) {
  EXPECT_FALSE(fit_power_law(std::vector<double>{5}, std::vector<double>{1}));
  EXPECT_FALSE(fit_power_law(std::vector<double>{5, 5}, std::vector<double>{1, 2}));
  const auto two = fit_power_law(std::vector<double>{1, 10}, std::vector<double>{1, 100});
  ASSERT_TRUE(two);
  EXPECT_NEAR(two->exponent, 2.0, 1e-12);
  EXPECT_TRUE(std::isinf(two->upper));
}

TEST(Statistics, StudentQuantilesFallTowardsTheNormal) {
  // At one and two degrees of freedom the quantile has a closed form.
  EXPECT_NEAR(student_975(1), std::tan(0.475 * M_PI), 1e-3);
  EXPECT_NEAR(student_975(2), 0.95 * std::sqrt(2.0 / (1.0 - 0.95 * 0.95)), 1e-4);
  for (std::size_t n = 1; n < 40; ++n) EXPECT_GT(student_975(n), student_975(n + 1));
  EXPECT_NEAR(student_975(1'000'000), 1.959964, 1e-5);
}

TEST(Statistics, CrossoverOfTwoPowerLaws) {
  const std::vector<double> x{50, 100, 200, 500, 1000};
  std::vector<double> cubic, linear;
  for (const double each : x) {
    cubic.push_back(std::pow(each / 300.0, 3));
    linear.push_back(each / 300.0);
  }
  EXPECT_NEAR(crossover(x, cubic, linear).value(), 300.0, 1e-9);
  EXPECT_FALSE(crossover(x, linear, std::vector<double>(5, 1e9)));
  EXPECT_EQ(crossover(x, std::vector<double>(5, 1e9), linear).value(), 50.0);
}

TEST(Statistics, PerformanceProfilesByHand) {
  const auto profiles = performance_profiles({{1.0, 4.0, kInfinity}, {2.0, 2.0, 3.0}});
  ASSERT_EQ(profiles.size(), 2U);
  ASSERT_EQ(profiles[0].size(), 2U);  // best on one of three, within 2 on two
  EXPECT_EQ(profiles[0][0].tau, 1.0);
  EXPECT_NEAR(profiles[0][0].share, 1.0 / 3.0, 1e-15);
  EXPECT_EQ(profiles[0][1].tau, 2.0);
  EXPECT_NEAR(profiles[0][1].share, 2.0 / 3.0, 1e-15);
  EXPECT_EQ(profiles[1].back().tau, 2.0);
  EXPECT_NEAR(profiles[1].back().share, 1.0, 1e-15);
}

TEST(Statistics, ShiftedGeometricMeanByHand) {
  const std::vector<double> times{1.0, 7.0, kInfinity};
  EXPECT_NEAR(shifted_geometric_mean(times, 1.0, 31.0), 7.0, 1e-12);  // (2 * 8 * 32)^(1/3) - 1
  EXPECT_NEAR(shifted_geometric_mean(std::vector<double>{2.0, 8.0}, 0.0, 1.0), 4.0, 1e-12);
  EXPECT_THROW(static_cast<void>(shifted_geometric_mean({}, 1.0, 1.0)), InputError);
  const std::vector<double> best = virtual_best({{1.0, 4.0, kInfinity}, {2.0, 3.0, kInfinity}});
  EXPECT_EQ(best, (std::vector<double>{1.0, 3.0, kInfinity}));
}

TEST(Statistics, PairedRatiosAreOfCommonInstances) {
  const std::vector<double> a{2.0, 8.0, kInfinity, 5.0}, b{1.0, 1.0, 1.0, kInfinity};
  const auto ratio = paired_ratio(a, b, std::vector<std::size_t>{0, 1, 2, 3});
  ASSERT_TRUE(ratio);
  EXPECT_NEAR(ratio->ratio, 4.0, 1e-12);
  EXPECT_EQ(ratio->instances, 2U);
  EXPECT_NEAR(ratio->lower, 2.0, 1e-12);  // of two groups a quarter of the samples is one twice
  EXPECT_NEAR(ratio->upper, 8.0, 1e-12);
  const auto nested = paired_ratio(a, b, std::vector<std::size_t>{0, 0, 0, 0});
  ASSERT_TRUE(nested);
  EXPECT_EQ(nested->groups, 1U);
  EXPECT_EQ(nested->upper, kInfinity);
  EXPECT_FALSE(paired_ratio(std::vector<double>{kInfinity}, std::vector<double>{1.0},
                            std::vector<std::size_t>{0}));
}

// Over many draws of 40 normal logarithms the interval holds the true ratio in 95 % of them, up to
// what the bootstrap's own optimism on 40 and four standard deviations of 400 draws allow. With
// eight copies of each, as nested subsets are, it must hold it as often; one by one the copies
// would make it too narrow by sqrt(8).
TEST(Statistics, BootstrapIntervalsHoldTheTruthThoughInstancesAreNested) {
  Random random(11);
  int held = 0, held_one_by_one = 0;
  constexpr int kDraws = 400;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<double> a, b;
    std::vector<std::size_t> groups, single;
    for (std::size_t g = 0; g < 40; ++g) {
      const double ratio = 3.0 * std::exp(0.5 * random.normal());
      for (int copy = 0; copy < 8; ++copy) {
        b.push_back(1.0 + random.uniform());
        a.push_back(ratio * b.back());
        groups.push_back(g);
        single.push_back(single.size());
      }
    }
    const PairedRatio nested = paired_ratio(a, b, groups).value();
    held += nested.lower <= 3.0 && 3.0 <= nested.upper ? 1 : 0;
    const PairedRatio loose = paired_ratio(a, b, single).value();
    held_one_by_one += loose.lower <= 3.0 && 3.0 <= loose.upper ? 1 : 0;
  }
  EXPECT_GE(held, 0.89 * kDraws);
  EXPECT_LE(held, 0.99 * kDraws);
  EXPECT_LE(held_one_by_one, 0.7 * kDraws);
}

std::vector<RunRow> rows_of_laws() {
  std::vector<RunRow> runs;
  for (const double q : {50., 100., 200., 500., 1000., 2000., 4000., 7920.}) {
    for (int repetition = 0; repetition < 3; ++repetition) {
      const auto add = [&](const std::string& solver, double seconds) {
        RunRow row = example_row();
        row.key.solver = solver;
        row.key.problem = std::to_string(q);
        row.key.repetition = repetition;
        row.candidates = static_cast<std::size_t>(q);
        row.iterations = 20;
        // The middle one of three is the median, whatever the others are.
        row.seconds = seconds * (repetition == 0 ? 0.5 : repetition == 1 ? 1.0 : 7.0);
        runs.push_back(row);
      };
      add("primal_interior_point", 1e-9 * q * q * q);
      add("dual_interior_point", 1e-5 * q);
      add("dual_interior_point_sparse", 4e-5 * q);
    }
  }
  return runs;
}

TEST(Tables, ExponentsRatioAndCrossoverOfSyntheticRows) {
  const auto points = summarise_points(rows_of_laws());
  EXPECT_EQ(points.size(), 24U);
  std::map<std::string, SolverLaw> laws;
  for (const SolverLaw& law : fit_laws(points)) laws[law.solver] = law;
  EXPECT_NEAR(laws.at("primal_interior_point").time.exponent, 3.0, 1e-9);
  EXPECT_NEAR(laws.at("dual_interior_point").time.exponent, 1.0, 1e-9);
  EXPECT_NEAR(laws.at("dual_interior_point").per_iteration.value().factor, 5e-7, 1e-12);
  EXPECT_EQ(laws.at("dual_interior_point").from, 500U);
  EXPECT_EQ(laws.at("dual_interior_point").to, 7920U);
  std::map<std::string, std::string> values;
  for (const Headline& line : headlines(points)) values[line.name] = line.value;
  EXPECT_EQ(values.at("dual_interior_point_sparse / dual_interior_point"), "4");
  EXPECT_EQ(values.at("crossover primal_interior_point / dual_interior_point"), "100");
}

TEST(Tables, NoHeadlineIsAboutASolverThatTookNoPart) {
  auto points = summarise_points(rows_of_laws());
  std::erase_if(points, [](const PointSummary& point) {
    return point.solver == "dual_interior_point_sparse";
  });
  const std::vector<Headline> lines = headlines(points);
  EXPECT_FALSE(lines.empty());
  for (const Headline& line : lines) {
    EXPECT_EQ(line.name.find("sparse"), std::string::npos) << line.name;
    EXPECT_EQ(line.name.find("low_rank"), std::string::npos) << line.name;
  }
}

TEST(Tables, UnsolvedPointsStayOutOfTheFit) {
  std::vector<RunRow> runs = rows_of_laws();
  for (RunRow& run : runs) {
    if (run.candidates == 7920) run.status = ReportStatus::kInaccurate, run.seconds = 1e-9;
  }
  for (const SolverLaw& law : fit_laws(summarise_points(runs))) EXPECT_EQ(law.to, 4000U);
}

TEST(Agreement, HonestAnswersAgreeAndALieIsCaught) {
  const double optimum = -10.0;
  const double d = 12.0;
  std::vector<RunRow> runs;
  const auto add = [&](const std::string& solver, double log_det, double gap) {
    RunRow row = example_row();
    row.key.solver = solver;
    row.key.repetition = 0;
    row.log_det = log_det;
    row.duality_gap = gap;
    runs.push_back(row);
  };
  add("a", optimum - 0.9 * d * std::log1p(1e-6), 1e-6);
  add("b", optimum, 0.0);
  add("c", optimum - 0.5 * d * std::log1p(1e-2), 1e-2);
  const auto honest = check_agreement(runs);
  ASSERT_EQ(honest.size(), 1U);
  EXPECT_TRUE(honest[0].agrees());
  EXPECT_EQ(honest[0].answers, 3U);
  // Its figures can't both be true: so far below the optimum the gap is not 1e-8.
  add("liar", optimum - 1e-3, 1e-8);
  const auto caught = check_agreement(runs);
  EXPECT_FALSE(caught[0].agrees());
  EXPECT_NE(caught[0].worst_pair.find("liar"), std::string::npos);
  EXPECT_NEAR(caught[0].worst_excess, 1e-3 - d * 1e-8, 1e-9);
}

TEST(Plan, SolversAreShuffledWithinASetAndSizesAscend) {
  const SolverRegistry registry = testing::study_registry({"honest", "liar", "quitter", "crasher"});
  const auto plan =
      make_plan(StudyOptions(), registry, {.whole = {"wis", "smo"}, .drawn = {}, .dimensions = {}});
  const auto order = visiting_order(plan, 1, 0);
  EXPECT_EQ(order, visiting_order(plan, 1, 0));
  std::vector<std::size_t> sorted = order;
  std::ranges::sort(sorted);
  for (std::size_t k = 0; k < plan.size(); ++k) EXPECT_EQ(sorted[k], k);
  std::size_t size = 0, set_changes = 0;
  std::set<std::vector<std::string>> orders;
  std::vector<std::string> names;
  for (const std::size_t k : order) {
    if (plan[k].experiment != "scaling") continue;
    EXPECT_GE(plan[k].candidates, size);
    if (plan[k].candidates != size) ++set_changes;
    size = plan[k].candidates;
    names.push_back(plan[k].solver);
    if (names.size() == 4) orders.insert(std::exchange(names, {}));
  }
  EXPECT_EQ(set_changes, study_sizes(kFullSize).size());
  EXPECT_GT(orders.size(), 1U);  // not the same order at every size
  // All families of one solver before those of the next.
  std::size_t solver_changes = 0;
  std::string last;
  for (const std::size_t k : order) {
    if (plan[k].experiment != "families") continue;
    if (plan[k].solver != last) ++solver_changes;
    last = plan[k].solver;
  }
  EXPECT_EQ(solver_changes, 4U);
  EXPECT_NE(order, visiting_order(plan, 1, 1));
  EXPECT_NE(order, visiting_order(plan, 2, 0));
}

// Every order of three solvers comes about equally often over many rounds.
TEST(Plan, EveryOrderOfSolversIsAsLikely) {
  const SolverRegistry registry = testing::study_registry({"honest", "liar", "quitter"});
  StudyOptions options;
  options.families = false;
  options.max_candidates = 50;
  const auto plan = make_plan(options, registry, {});
  std::map<std::vector<std::size_t>, int> counts;
  constexpr int kRounds = 6000;
  for (int round = 0; round < kRounds; ++round) ++counts[visiting_order(plan, 7, round)];
  ASSERT_EQ(counts.size(), 6U);
  // Five standard deviations of a binomial count.
  for (const auto& [order, count] : counts) {
    EXPECT_NEAR(count, kRounds / 6.0, 5 * std::sqrt(kRounds * 5.0 / 36.0));
  }
}

TEST(Plan, SizesLimitsAndExperiments) {
  EXPECT_EQ(study_sizes(7920).size(), 8U);
  EXPECT_EQ(study_sizes(999).back(), 500U);
  const SolverRegistry registry = testing::study_registry({"honest", "liar"});
  StudyOptions options;
  EXPECT_EQ(make_plan(options, registry, {}).size(), 8U * 2 + 2);
  const StudyFamilies two{.whole = {"wis", "smo"}, .drawn = {}, .dimensions = {}};
  EXPECT_EQ(make_plan(options, registry, two).size(), 8U * 2 + 3 * 2);
  options.families = false;
  options.max_candidates = 200;
  const auto plan = make_plan(options, registry, two);
  ASSERT_EQ(plan.size(), 6U);
  EXPECT_EQ(plan[0].candidates, 50U);
  EXPECT_EQ(plan[1].candidates, 50U);  // all solvers at one Q before the next
  EXPECT_EQ(plan[2].candidates, 100U);
}

}  // namespace
}  // namespace graybox::bench
