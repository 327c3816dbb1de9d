// Finding D4: what a command prints and writes is the same to the last bit for any number of
// threads.
#include <gtest/gtest.h>

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
using Json = nlohmann::ordered_json;

// Keys that measure the run, not the answer.
void drop_measurements(Json& json) {
  if (json.is_object()) {
    for (const char* key :
         {"seconds", "threads", "peak_memory_bytes", "time_to_efficiency", "counters", "options"}) {
      json.erase(key);
    }
  }
  if (json.is_structured()) {
    for (auto& child : json) drop_measurements(child);
  }
}

class ThreadCommand : public testing::CommandRunner {
 protected:
  std::string answer(const std::string& arguments, int threads) {
    const Outcome outcome = graybox(arguments + " --threads " + std::to_string(threads));
    EXPECT_LE(outcome.exit_code, 1) << arguments << ": " << outcome.err;
    Json json = Json::parse(outcome.out, nullptr, false);
    if (json.is_discarded()) return outcome.out;
    drop_measurements(json);
    return json.dump(1);
  }
  void expect_same_bits(const std::string& arguments) {
    SCOPED_TRACE(arguments);
    const std::string one = answer(arguments, 1);
    EXPECT_FALSE(one.empty());
    EXPECT_EQ(one, answer(arguments, 2));
    EXPECT_EQ(one, answer(arguments, 3));
  }
  void expect_same_to_rounding(const std::string& arguments) {
    SCOPED_TRACE(arguments);
    const Json one = Json::parse(answer(arguments, 1)), two = Json::parse(answer(arguments, 2));
    ASSERT_EQ(one["parameters"].size(), two["parameters"].size());
    ASSERT_FALSE(one["parameters"].empty());
    for (std::size_t k = 0; k < one["parameters"].size(); ++k) {
      const double value = one["parameters"][k]["value"].get<double>();
      EXPECT_NEAR(two["parameters"][k]["value"].get<double>(), value, 1e-6 * std::abs(value));
    }
    EXPECT_EQ(one["status"], two["status"]);
  }
  void expect_same_file(const std::string& arguments, const std::string& file) {
    SCOPED_TRACE(arguments);
    std::string first;
    for (int threads = 1; threads <= 3; ++threads) {
      const Outcome outcome = graybox(arguments + " --threads " + std::to_string(threads));
      ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
      const std::string bytes = read_text(folder_.file(file));
      if (threads == 1) first = bytes;
      EXPECT_TRUE(bytes == first) << threads << " threads";
    }
  }
  void make(const std::string& arguments) {
    const Outcome made = graybox(arguments);
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
};

TEST_F(ThreadCommand, EveryBackEndAnswersTheSame) {
  make("problem random --family wis --candidates 300 --dimension 12 -o set.h5");
  make("problem random --family wis --candidates 700 --dimension 4 -o wide.h5");
  const Outcome listed = graybox("solvers --json");
  for (const auto& solver : Json::parse(listed.out)) {
    if (!solver["available"].get<bool>()) continue;
    const std::string name = solver["name"];
    // Ends by gap or by iterations, never by the clock.
    for (const char* set : {"set.h5", "wide.h5"}) {
      expect_same_bits("solve " + std::string(set) +
                       " --json --gap 1e-7 --iteration-limit 60 --solver " + name);
    }
  }
}

TEST_F(ThreadCommand, ExactDesignsAreTheSame) {
  make("problem random --family wis --candidates 300 --dimension 6 -o set.h5");
  for (const char* method : {"exchange", "branch_and_bound"}) {
    expect_same_bits("exact set.h5 -M 9 --json --method " + std::string(method));
  }
}

TEST_F(ThreadCommand, TheRobotsMatricesAreTheSame) {
  expect_same_file("problem robot --grid 500 -o set.npy", "set.npy");
}

TEST_F(ThreadCommand, SimulationDiagnosisAndResponsesAreTheSame) {
  for (const char* name : {"rotor.yaml", "rotor_short_plan.yaml"}) {
    fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "docs/examples/diagnose" / name,
                  folder_.file(name));
  }
  make("simulate rotor.yaml rotor_short_plan.yaml -o campaign --threads 1");
  make("simulate rotor.yaml rotor_short_plan.yaml -o other --threads 3");
  EXPECT_EQ(read_text(folder_.file("campaign/run_1.csv")),
            read_text(folder_.file("other/run_1.csv")));
  expect_same_bits("diagnose rotor.yaml campaign --json");
  expect_same_bits("responses campaign --json");
}

TEST_F(ThreadCommand, FitsOfRecordingsAreTheSame) {
  const fs::path drive = fs::path(GRAYBOX_SOURCE_DIR) / "docs/examples/fit/drive";
  fs::copy(drive, folder_.file("drive"), fs::copy_options::recursive);
  expect_same_bits("fit drive/motor.yaml drive --json");
}

// Names of other lengths move everything in memory; the order of addresses must not matter.
TEST_F(ThreadCommand, FitsAreTheSameWhereverTheirNumbersLie) {
  const fs::path drive = fs::path(GRAYBOX_SOURCE_DIR) / "docs/examples/fit/drive";
  fs::copy(drive, folder_.file("drive"), fs::copy_options::recursive);
  std::string first;
  for (const std::size_t length : {1U, 20U, 47U, 90U}) {
    make("fit drive/motor.yaml drive -o " + std::string(length, 'a') + ".json");
    Json fit = Json::parse(read_text(folder_.file(std::string(length, 'a') + ".json")));
    drop_measurements(fit);
    if (first.empty()) first = fit.dump();
    EXPECT_EQ(fit.dump(), first) << "a name of " << length << " letters";
  }
}

// The exception: Ceres sums the robot's responses by thread.
TEST_F(ThreadCommand, FitsOfTheRobotAgreeToRounding) {
  for (const char* name : {"irb6600_like.yaml", "irb6600_like.urdf"}) {
    fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "problems/robot" / name, folder_.file(name));
  }
  write_text(folder_.file("plan.yaml"), R"(format: graybox-plan/1
plant: local
positions: [[0, 30, -60, 0, 45, 0], [45, 15, -150, 0, -90, 0], [90, 20, -90, 0, 30, 0]]
levels: [0.5]
realisations: 1
period: 1000
settling_periods: 1
periods: 2
frequencies: {from: 3, to: 60, count: 18, spacing: log}
)");
  make("simulate irb6600_like.yaml plan.yaml -o campaign");
  expect_same_to_rounding("fit irb6600_like.yaml campaign --starts 2 --json");
}

}  // namespace
}  // namespace graybox
