// `graybox responses`: from a simulated campaign to files, and one clear line for recordings that
// don't allow it.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;

// Two motors on one shaft, each under its controller.
const std::string kModel = R"(format: graybox-lumped/1
sample_time: 0.002
motion: rotation
masses: {left: 0.002, right: 0.003, load: 0.02}
elements:
  - name: left shaft
    location: {kind: element, between: [left, load]}
    law: stiffness
    parameters: {stiffness: {value: 6, unit: N m/rad}}
  - name: right shaft
    location: {kind: element, between: [right, load]}
    law: stiffness
    parameters: {stiffness: {value: 9, unit: N m/rad}}
  - name: bearing
    location: {kind: element, mass: load}
    law: viscous
    parameters: {damping: {value: 0.02, unit: N m s/rad}}
inputs:
  - {name: torque_1, mass: left}
  - {name: torque_2, mass: right}
outputs:
  - {name: speed_1, mass: left, quantity: velocity}
  - {name: speed_2, mass: right, quantity: velocity}
noise: {speed_1: 0.01, speed_2: 0.01}
controller: {kind: pi, proportional: [0.05, 0.07], integral_time: [0.1, 0.2]}
)";
const std::string kPlan =
    "format: graybox-plan/1\nlevels: [1, 2]\nrealisations: 3\nvalidation_realisations: 1\n"
    "period: 200\nsettling_periods: 6\nperiods: 2\nfrequencies: [7.5, 12.5, 22.5, 47.5]\n"
    "data: csv\n";

class ResponsesCommand : public testing::CommandRunner {
 protected:
  ResponsesCommand() {
    write_text(folder_.file("model.yaml"), kModel);
    write_text(folder_.file("plan.yaml"), kPlan);
  }
  void simulate() {
    ASSERT_EQ(graybox("simulate model.yaml plan.yaml -o campaign").exit_code, 0);
    original_ = read_text(folder_.file("campaign/campaign.yaml"));
  }
  // The campaign with one text replaced, everywhere or at its first place.
  void replace(const std::string& from, const std::string& to, bool everywhere = false) {
    std::string text = original_;
    std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    while (at != std::string::npos) {
      text.replace(at, from.size(), to);
      at = everywhere ? text.find(from, at + to.size()) : std::string::npos;
    }
    write_text(folder_.file("campaign/campaign.yaml"), text);
  }
  std::string original_;
};

TEST_F(ResponsesCommand, WritesTheSameFilesOnAnyNumberOfThreads) {
  simulate();
  const Outcome outcome = graybox("responses campaign -o one.h5");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("2 responses from torque_1, torque_2 to speed_1, speed_2"),
            std::string::npos)
      << outcome.out;
  ASSERT_EQ(graybox("responses campaign -o two.h5 --threads 3").exit_code, 0);
  EXPECT_TRUE(read_text(folder_.file("one.h5")) == read_text(folder_.file("two.h5")));
  ASSERT_EQ(graybox("responses campaign -o all.csv").exit_code, 0);
  const std::string table = read_text(folder_.file("all.csv"));
  EXPECT_EQ(table.find("response,position,level,"), 0U);
  EXPECT_EQ(std::ranges::count(table, '\n'), 1 + 2 * 4 * 4);
  ASSERT_EQ(graybox("responses campaign -o each.csv --separate").exit_code, 0);
  EXPECT_EQ(std::ranges::count(read_text(folder_.file("each.csv")), '\n'), 1 + 4 * 4 * 4);
  ASSERT_EQ(graybox("responses campaign -o other.csv --role validation").exit_code, 0);
  const Outcome json = graybox("responses campaign --json");
  EXPECT_EQ(json.exit_code, 0);
  EXPECT_EQ(std::ranges::count(json.out, '\n'), 1);
  for (const char* key : {"\"realisations\":2", "\"signal_to_noise_db\"", "\"largest_bias\"",
                          "\"total_over_noise_db\"", "\"findings\":[]"}) {
    EXPECT_NE(json.out.find(key), std::string::npos) << key << json.out;
  }
}

TEST_F(ResponsesCommand, LocalPolynomialsNeedNoPeriods) {
  write_text(folder_.file("plan.yaml"),
             "format: graybox-plan/1\nlevels: [1]\nperiod: 2000\nperiods: 1\ndata: csv\n"
             "frequencies: {from: 0.25, to: 240, count: 900, spacing: linear}\n");
  simulate();
  // A dense multisine of one period: every line but the even ones; not said to be periodic.
  std::string text = original_;
  for (std::size_t at = text.find("    excitation:"); at != std::string::npos;
       at = text.find("    excitation:")) {
    text.erase(at, text.find('\n', at) + 1 - at);
  }
  write_text(folder_.file("campaign/campaign.yaml"), text);
  const Outcome outcome =
      graybox("responses campaign --from 10 --to 100 --count 7 --json -o responses.csv");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("\"method\":\"local_polynomial\""), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("\"frequencies\":7"), std::string::npos) << outcome.out;
  EXPECT_NE(graybox("responses campaign --direct --from 10 --to 100").out.find("feedback"),
            std::string::npos);
  expect_refused("responses campaign --method periodic", "states no excitation");
  expect_refused("responses campaign --from 240 --to 249.9", "must fit");
  expect_refused("responses campaign --degrees-of-freedom 9000", "too few");
}

TEST_F(ResponsesCommand, RefusesRecordingsThatDoNotAllowIt) {
  simulate();
  const std::string responses = "responses campaign -o out.h5";
  expect_refused("responses campaign -o out.txt", "unknown ending '.txt'");
  expect_refused("responses nowhere", "nowhere");
  expect_refused("responses campaign --method magic", "--method");
  expect_refused("responses campaign -o nowhere/out.h5", "nowhere");

  const auto line = original_.find("excitation: {period: 200, periods: 2, lines: [");
  ASSERT_NE(line, std::string::npos);
  const std::string excitation = original_.substr(line, original_.find('}', line) + 1 - line);
  const std::vector<std::array<std::string, 3>> mistakes{
      {"    sub_experiment: 2\n", "    sub_experiment: 3\n", "sub_experiment 2 of realisation 1"},
      {"    sub_experiment: 2\n", "    sub_experiment: 1\n", "is there twice"},
      {excitation, "excitation: {period: 200, periods: 2, lines: [3, 5]}",
       "other periods or lines"},
      {excitation, "excitation: {period: 200, periods: 5, lines: [3, 5, 9, 19]}", "other periods"},
      {"    segments: []\n", "    segments: [[0, 399], [0, 399]]\n", "one segment"},
  };
  for (const auto& [from, to, message] : mistakes) {
    replace(from, to);
    expect_refused(responses, message);
  }
  replace("    sub_experiment: 2\n", "    sub_experiment: 1\n    realisation: 7\n");
  expect_refused(responses, "realisation");
  replace("is: input", "is: other", true);
  expect_refused(responses, "needs an input and an output");
  replace("role: estimation", "role: validation", true);
  expect_refused(responses, "none has the role estimation");
  // The same recording for both sub-experiments: U has no inverse.
  replace("p1_l1_r1_e2.csv", "p1_l1_r1_e1.csv");
  expect_refused("responses campaign --separate", "not independent");
}

TEST_F(ResponsesCommand, OnePeriodHasNoNoise) {
  write_text(folder_.file("plan.yaml"),
             "format: graybox-plan/1\nlevels: [1]\nperiod: 200\nperiods: 1\nfrequencies: [7.5]\n");
  simulate();
  const Outcome outcome = graybox("responses campaign -o out.csv");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("one period tells nothing of the noise"), std::string::npos)
      << outcome.out;
}

TEST_F(ResponsesCommand, SaysWhereAPlantIsNotLinearAndWhereItHasNotSettled) {
  std::string quiet = kModel;
  quiet.replace(quiet.find("{speed_1: 0.01, speed_2: 0.01}"), 30,
                "{speed_1: 0.001, speed_2: 0.001}");
  write_text(folder_.file("model.yaml"), quiet);
  write_text(folder_.file("friction.yaml"),
             "format: graybox-physics/1\nelements:\n  - name: dry\n    location: {kind: element, "
             "mass: load}\n    law: coulomb\n    parameters: {level: {value: 0.02, unit: N m}, "
             "transition_velocity: {value: 0.05, unit: rad/s}}\n");
  ASSERT_EQ(graybox("simulate model.yaml plan.yaml --hidden friction.yaml -o campaign").exit_code,
            0);
  const Outcome outcome = graybox("responses campaign");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("silent odd lines answer"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("depends on the phases"), std::string::npos) << outcome.out;
  std::string plan = kPlan;
  plan.replace(plan.find("settling_periods: 6"), 19, "settling_periods: 0");
  write_text(folder_.file("plan.yaml"), plan);
  ASSERT_EQ(graybox("simulate model.yaml plan.yaml -o early").exit_code, 0);
  EXPECT_NE(graybox("responses early").out.find("a transient"), std::string::npos);
}

}  // namespace
}  // namespace graybox
