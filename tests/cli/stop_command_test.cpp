// Ctrl-C and --time-limit, as users see them: every long command ends soon after, with what it has.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

// Far above what a command may take, also on a busy machine and under sanitizers; what does not end
// by then is killed, exit code 137.
const std::string kAfterOneSecond =
    "timeout --foreground --preserve-status --signal=INT --kill-after=20 1";
const std::string kAtMost = "timeout --foreground --signal=KILL 30";

class StopCommand : public testing::CommandRunner {
 protected:
  void example(const std::string& name) {
    fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "docs/examples" / name,
                  folder_.file(fs::path(name).filename()));
  }
  void robot() {
    for (const char* name : {"irb6600_like.yaml", "irb6600_like.urdf"}) {
      fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "problems/robot" / name, folder_.file(name));
    }
  }
  void make(const std::string& arguments) {
    const Outcome made = graybox(arguments);
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  // One that has something to hand over (1), has nothing and ends as any program (130), or was
  // done.
  void expect_stopped(const std::string& arguments) {
    SCOPED_TRACE(arguments);
    const Outcome outcome = graybox(arguments, kAfterOneSecond);
    EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 130 || outcome.exit_code == 0)
        << outcome.exit_code << ": " << outcome.err;
    EXPECT_EQ(outcome.err.find("internal error"), std::string::npos) << outcome.err;
  }
};

TEST_F(StopCommand, CommandsOfSetsEndAtCtrlC) {
  make("problem random --family wis --candidates 3000 --dimension 30 -o set.h5");
  make("problem random --family cube3 -o cube.h5");
  make("solve set.h5 --gap 1e-3 -o design.json");
  for (const char* solver : {"multiplicative", "dual_interior_point", "ipopt_lifted"}) {
    expect_stopped("solve set.h5 --gap 1e-14 --solver " + std::string(solver));
  }
  for (const char* method : {"exchange", "branch_and_bound"}) {
    expect_stopped("exact cube.h5 -M 14 --gap 1e-9 --method " + std::string(method));
  }
  expect_stopped("exact cube.h5 -M 12:40 --table table.csv");
  expect_stopped("check set.h5 design.json");
  expect_stopped("design criteria set.h5 --gap 1e-14");
  expect_stopped("design robust set.h5 --largest-share 0.5 --of-positions 0.01 --gap 1e-14");
}

TEST_F(StopCommand, CommandsOfTheRobotEndAtCtrlC) {
  robot();
  expect_stopped("problem robot --grid 400000 -o big.h5");
  expect_stopped("design robust --samples 400");
  expect_stopped("design sequential --repetitions 50");
  expect_stopped("design continuous --refined 10000000");
  expect_stopped("design spectrum");
  expect_stopped("design verify --grid 500 --recordings 0 --repetitions 5000 -o responses");
  expect_stopped("design verify --grid 500 --recordings 100 --repetitions 0 -o recordings");
  make("problem robot -o robot.h5");
  make("solve robot.h5 -o design.json");
  expect_stopped("design efficiency design.json --samples 2000 -o efficiency.csv");
  write_text(folder_.file("plan.yaml"), R"(format: graybox-plan/1
plant: robot
positions: [[0, 30, -60, 0, 45, 0], [45, 15, -150, 0, -90, 0], [90, 20, -90, 0, 30, 0]]
levels: [0.5]
realisations: 20
period: 4000
settling_periods: 4
periods: 4
frequencies: {from: 5, to: 60, count: 20, spacing: log}
)");
  expect_stopped("simulate irb6600_like.yaml plan.yaml -o campaign");
}

TEST_F(StopCommand, CommandsOfRecordingsEndAtCtrlC) {
  example("diagnose/rotor.yaml");
  example("diagnose/rotor_plan.yaml");
  make("simulate rotor.yaml rotor_plan.yaml -o campaign");
  expect_stopped("diagnose rotor.yaml campaign");
  expect_stopped("recordings campaign");
  expect_stopped("responses campaign");
  expect_stopped("fit rotor.yaml campaign");
}

// What was found until then is handed over, in the form of a finished run.
TEST_F(StopCommand, ADiagnosisHandsOverWhatItHasAtItsTimeLimit) {
  example("diagnose/rotor.yaml");
  example("diagnose/rotor_plan.yaml");
  make("simulate rotor.yaml rotor_plan.yaml -o campaign");
  for (const char* limit : {"0.01", "0.1", "0.3", "1"}) {
    SCOPED_TRACE(limit);
    const Outcome outcome =
        graybox("diagnose rotor.yaml campaign --json -o report --time-limit " + std::string(limit),
                kAtMost);
    ASSERT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1) << outcome.err;
    const Json found = Json::parse(outcome.out);
    EXPECT_EQ(found["interrupted"].get<bool>(), found["verdict"] == "unknown") << outcome.out;
    EXPECT_EQ(Json::parse(read_text(folder_.file("report/verdict.json"))), found);
  }
  // Then no recording is read once more, and the user is told so.
  const Json found =
      Json::parse(graybox("diagnose rotor.yaml campaign --json --time-limit 0.01").out);
  EXPECT_NE(found["recording_warnings"].dump().find("not looked at for faults"), std::string::npos)
      << found["recording_warnings"];
}

// Finding S5.
TEST_F(StopCommand, TheExchangeThatNeverEndedEnds) {
  // Eight matrices of d = 5: full rank of 1e-6 and rank one of 1 by turns.
  std::string lines;
  const auto hash = [](int i, int j, int k) {
    return static_cast<double>((i * 7919 + j * 104729 + k * 1299709) % 1000) / 500.0 - 1.0;
  };
  for (int i = 0; i < 8; ++i) {
    for (int r = 0; r < 5; ++r) {
      for (int c = 0; c <= r; ++c) {
        double sum = 0.0;
        for (int k = 0; k < (i % 2 == 0 ? 5 : 1); ++k) sum += hash(i, r, k) * hash(i, c, k);
        lines +=
            std::to_string(1e6 * sum * (i % 2 == 0 ? 1e-6 : 1.0)) + (r == 4 && c == 4 ? "\n" : ",");
      }
    }
  }
  write_text(folder_.file("set.csv"), lines);
  const Outcome outcome = graybox("exact set.csv -M 3 --json --time-limit 5", kAtMost);
  EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1 || outcome.exit_code == 2)
      << outcome.exit_code << outcome.err;
}

// At d = 150 one step of an exchange, or of a certificate, is a matter of milliseconds to seconds.
TEST_F(StopCommand, LargeMatricesStopInTime) {
  constexpr double kPatience = 3.0;  // s beyond the limit; a second would do on an idle machine
  make("problem random --family wis --candidates 1500 --dimension 150 -o set.h5");
  for (const char* command :
       {"solve set.h5 --gap 1e-12 --solver vertex_exchange --time-limit 2",
        "solve set.h5 --gap 1e-12 --solver randomized_exchange --time-limit 10",
        "exact set.h5 -M 200 --gap 1e-9 --time-limit 6",
        "exact set.h5 -M 200 --gap 1e-9 --method exchange --time-limit 6"}) {
    SCOPED_TRACE(command);
    const std::string text = command;
    const double limit = std::stod(text.substr(text.rfind(' ')));
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = graybox(text, kAtMost);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1) << outcome.err;
    EXPECT_LE(taken.count(), limit + kPatience);
  }
}

// Commands that work long on what they read, each with a limit that it can't keep: one line and
// exit code 1, and no file that is half written.
TEST_F(StopCommand, OtherCommandsEndAtTheirTimeLimitToo) {
  constexpr double kPatience = 3.0;  // s beyond the limit; a second would do on an idle machine
  robot();
  example("diagnose/rotor.yaml");
  make("problem random --family wis --candidates 200000 --dimension 20 -o set.h5");
  write_text(folder_.file("design.json"),
             R"({"format": "graybox-design/1", "support": [{"index": 0, "weight": 1}]})");
  const std::string frequencies =
      "realisations: 20\nperiod: 200000\nsettling_periods: 2\nperiods: 4\n"
      "frequencies: {from: 2, to: 80, count: 40, spacing: log}\n";
  write_text(folder_.file("plan.yaml"), "format: graybox-plan/1\nlevels: [2]\n" + frequencies);
  write_text(folder_.file("small_plan.yaml"),
             "format: graybox-plan/1\nlevels: [2]\nrealisations: 6\nvalidation_realisations: 1\n"
             "period: 20000\nsettling_periods: 1\nperiods: 4\n"
             "frequencies: {from: 2, to: 80, count: 40, spacing: log}\n");
  make("simulate rotor.yaml small_plan.yaml -o campaign");
  std::string log = "time,current,speed\n";  // much of it, and the responses of many frequencies
  for (int k = 0; k < 400000; ++k) {
    log += fmt::format("{:.3f},{:.6f},{:.6f}\n", 0.001 * k, std::sin(1e-5 * k * (1 + k % 7)),
                       std::cos(1e-5 * k * (1 + k % 7)) + 1e-3 * (k % 101));
  }
  write_text(folder_.file("log.csv"), log);
  write_text(folder_.file("long.yaml"),
             "format: graybox-campaign/1\nsample_time: 0.001\nchannels:\n"
             "  - {name: current, unit: A, is: input}\n  - {name: speed, unit: rad/s, is: output}\n"
             "experiments: [{file: log.csv}]\n");
  const std::vector<std::string> commands{
      "check set.h5 design.json",
      "simulate rotor.yaml plan.yaml -o new",
      "recordings long.yaml -o summary.json",
      "responses long.yaml --method local_polynomial -o responses.h5",
      "predict rotor.yaml campaign -o page.html",
      "fit rotor.yaml campaign -o fit.json --report fit.html",
      "design verify --grid 500 --recordings 0 --repetitions 50000 -o verified"};
  for (const std::string& command : commands) {
    SCOPED_TRACE(command);
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = graybox(command + " --time-limit 0.01", kAtMost);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    EXPECT_LE(taken.count(), kPatience);
    const bool may_be_done = command.find("long.yaml") != std::string::npos;
    if (may_be_done && outcome.exit_code == 0) continue;  // in the half second after the limit
    EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  }
  for (const char* name : {"page.html", "fit.json", "fit.html"}) {
    EXPECT_FALSE(fs::exists(folder_.file(name))) << name;
  }
}

// Reading counts.
TEST_F(StopCommand, TheTimeLimitHoldsFromReadingOn) {
  make("problem random --family wis --candidates 400000 --dimension 12 -o set.csv");
  const Outcome outcome = graybox("solve set.csv --time-limit 0.01", kAtMost);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  EXPECT_NE(outcome.err.find("set.csv"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace graybox
