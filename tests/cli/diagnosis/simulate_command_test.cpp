// `graybox simulate`: campaigns as users get them, resumed, on any number of threads, and one clear
// line for wrong input.
#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/simulation/excitation_plan.hpp"
#include "diagnosis/simulation/simulated_system.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using testing::Outcome;
using testing::read_text;
using testing::write_text;

const std::string kPlan = R"(format: graybox-plan/1
plant: local
positions: [[0, 30, -60, 0, 45, 0], [45, 15, -150, 0, -90, 0]]
levels: [0.5]
realisations: 2
validation_realisations: 1
period: 400
settling_periods: 1
periods: 2
frequencies: {from: 5, to: 60, count: 5, spacing: log}
)";

class SimulateCommand : public testing::CommandRunner {
 protected:
  SimulateCommand() {
    for (const char* name : {"irb6600_like.yaml", "irb6600_like.urdf"}) {
      fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "problems/robot" / name, folder_.file(name));
    }
    write_text(folder_.file("plan.yaml"), kPlan);
  }

  // kPlan with one text replaced.
  void write_plan(const std::string& from, const std::string& to) {
    std::string text = kPlan;
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_text(folder_.file("plan.yaml"), text.replace(at, from.size(), to));
  }
};

TEST_F(SimulateCommand, WritesTheSameCampaignOnAnyNumberOfThreadsAndAfterAnInterruption) {
  const Outcome first = graybox("simulate irb6600_like.yaml plan.yaml --seed 3 -o one");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(first.err, "");
  ASSERT_EQ(graybox("simulate irb6600_like.yaml plan.yaml --seed 3 --threads 2 -o two").exit_code,
            0);
  const std::string campaign = read_text(folder_.file("one/campaign.yaml"));
  EXPECT_EQ(std::ranges::count(campaign, '\n'), 27 + 24 * 8) << campaign;
  EXPECT_EQ(campaign, read_text(folder_.file("two/campaign.yaml")));
  for (const char* name : {"p1_l1_r1_e1.h5", "p2_l1_r2_e6.h5"}) {
    EXPECT_TRUE(read_text(folder_.file("one/") + name) == read_text(folder_.file("two/") + name));
  }
  const std::string lost = read_text(folder_.file("one/p1_l1_r2_e4.h5"));
  fs::remove(folder_.file("one/p1_l1_r2_e4.h5"));
  write_text(folder_.file("one/.p1_l1_r2_e4.h5.graybox-999999999-Ab3dEf.tmp"),
             "half");  // killed while it wrote
  const Outcome resumed = graybox("simulate irb6600_like.yaml plan.yaml --seed 3 -o one --json");
  EXPECT_EQ(resumed.exit_code, 0);
  EXPECT_NE(resumed.out.find("\"already_there\":23"), std::string::npos) << resumed.out;
  EXPECT_TRUE(read_text(folder_.file("one/p1_l1_r2_e4.h5")) == lost);
  EXPECT_FALSE(fs::exists(folder_.file("one/.p1_l1_r2_e4.h5.graybox-999999999-Ab3dEf.tmp")));
}

TEST_F(SimulateCommand, TheNonLinearRobotIntoCsv) {
  write_plan("plant: local\npositions: [[0, 30, -60, 0, 45, 0], [45, 15, -150, 0, -90, 0]]",
             "plant: robot\ndata: csv\nnoise: 0\npositions: [[0, 30, -60, 0, 45, 0]]");
  std::string text = read_text(folder_.file("plan.yaml"));
  text.replace(text.find("period: 400"), 11, "period: 100");
  text.replace(text.find("realisations: 2\nvalidation_realisations: 1"), 42, "realisations: 1");
  text.replace(text.find("{from: 5, to: 60, count: 5, spacing: log}"), 41, "[20, 60]");
  write_text(folder_.file("plan.yaml"), text);
  const Outcome outcome = graybox("simulate irb6600_like.yaml plan.yaml -o out");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string data = read_text(folder_.file("out/p1_l1_r1_e1.csv"));
  EXPECT_EQ(data.find("time,r_1,r_2"), 0U);
  EXPECT_EQ(std::ranges::count(data, '\n'), 201);
  EXPECT_EQ(read_text(folder_.file("out/campaign.yaml")).find("noise:"), std::string::npos);
}

const std::string kDrive = R"(format: graybox-lumped/1
sample_time: 0.001
motion: rotation
masses: {motor: 0.002, load: 0.03}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: 45, unit: N m/rad}}
inputs:
  - {name: torque, mass: motor}
outputs:
  - {name: speed, mass: motor, quantity: velocity}
controller: {kind: pi, proportional: [0.2], integral_time: [0.05]}
)";
const std::string kDrivePlan =
    "format: graybox-plan/1\nlevels: [2]\nperiod: 200\nfrequencies: [5, 35]\ndata: csv\n";
const std::string kFriction = R"(format: graybox-physics/1
elements:
  - name: dry friction
    location: {kind: element, mass: load}
    law: coulomb
    parameters: {level: {value: 0.3, unit: N m}, transition_velocity: {value: 0.01, unit: rad/s}}
)";

TEST_F(SimulateCommand, ADriveWithAndWithoutHiddenFriction) {
  write_text(folder_.file("drive.yaml"), kDrive);
  write_text(folder_.file("drive_plan.yaml"), kDrivePlan);
  write_text(folder_.file("friction.yaml"), kFriction);
  ASSERT_EQ(graybox("simulate drive.yaml drive_plan.yaml -o known").exit_code, 0);
  const std::string hidden = "simulate drive.yaml drive_plan.yaml --hidden friction.yaml -o ";
  ASSERT_EQ(graybox(hidden + "hidden").exit_code, 0);
  const std::string known = read_text(folder_.file("known/p1_l1_r1_e1.csv"));
  EXPECT_EQ(known.find("time,reference_speed,torque,speed\n"), 0U);
  EXPECT_NE(known, read_text(folder_.file("hidden/p1_l1_r1_e1.csv")));
  // What is hidden stays out of the folder.
  const std::string campaign = read_text(folder_.file("hidden/campaign.yaml"));
  EXPECT_EQ(campaign, read_text(folder_.file("known/campaign.yaml")));
  EXPECT_EQ(campaign.find("position:"), std::string::npos);
  EXPECT_NE(campaign.find("model: drive.yaml"), std::string::npos);
  EXPECT_NE(campaign.find("{name: torque, unit: N m, is: input}"), std::string::npos) << campaign;
  expect_refused(hidden + "known", "another model, plan");
}

// A motion without bound is no bad input: one line that names the recording, exit code 1.
TEST_F(SimulateCommand, SaysWhichRecordingIsUnstable) {
  write_text(folder_.file("drive.yaml"), kDrive);
  write_text(folder_.file("drive_plan.yaml"), kDrivePlan);
  for (const auto& [law, parameters] : std::vector<std::pair<std::string, std::string>>{
           {"viscous", "{damping: {value: -20, unit: N m s/rad}}"},
           {"cubic_spring", "{stiffness: {value: -1e9, unit: N m/rad^3}}"}}) {
    write_text(
        folder_.file("physics.yaml"),
        "format: graybox-physics/1\nelements:\n  - name: wild\n    location: {kind: element, "
        "between: [motor, load]}\n    law: " +
            law + "\n    parameters: " + parameters + "\n");
    const Outcome outcome =
        graybox("simulate drive.yaml drive_plan.yaml --hidden physics.yaml -o " + law);
    EXPECT_EQ(outcome.exit_code, 1) << law;
    EXPECT_EQ(outcome.err.find("graybox: p1_l1_r1_e1: the motion"), 0U) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  }
}

// What can't be simulated is refused before anything is written.
TEST_F(SimulateCommand, RefusesWhatCannotBeDoneAtAPosition) {
  write_text(folder_.file("physics.yaml"),
             "format: graybox-physics/1\nelements:\n  - name: weak\n    location: {kind: actuator, "
             "joint: joint_2}\n    law: saturation\n    parameters: {limit: {value: 0.01, unit: N "
             "m}}\n");
  expect_refused("simulate irb6600_like.yaml plan.yaml --hidden physics.yaml -o out", "'weak'");
  write_plan("levels: [0.5]", "levels: [0.5]\ncrest_limit: 1.1");
  expect_refused("simulate irb6600_like.yaml plan.yaml -o out", "crest");
}

TEST_F(SimulateCommand, ListsTheLaws) {
  const Outcome outcome = graybox("simulate --laws");
  EXPECT_EQ(outcome.exit_code, 0);
  for (const char* law : {"backlash", "lugre", "delay", "payload"}) {
    EXPECT_NE(outcome.out.find(law), std::string::npos) << law;
  }
  EXPECT_EQ(graybox("simulate --laws --json").out.find("[{\"law\":"), 0U);
}

TEST_F(SimulateCommand, RefusesWrongModelsAndPhysics) {
  write_text(folder_.file("drive_plan.yaml"), kDrivePlan);
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::string simulate = "simulate drive.yaml drive_plan.yaml --hidden friction.yaml -o out";
  const std::vector<std::array<std::string, 3>> drives{
      {"lumped/1", "lump/1", "format"},
      {"load: 0.03", "load: 0", "masses.load"},
      {"motion: rotation", "motion: circular", "motion"},
      {"quantity: velocity", "quantity: jerk", "quantity"},
      {"name: torque, mass: motor", "name: torque, mass: rotor", "no mass 'rotor'"},
      {"name: speed", "name: torque", "given twice"},
      {"name: speed", "name: a b", "letters"},
      {"[0.2]", "[0.2, 1]", "proportional"},
  };
  write_text(folder_.file("friction.yaml"), kFriction);
  for (const auto& [from, to, message] : drives) {
    write_text(folder_.file("drive.yaml"), replaced(kDrive, from, to));
    testing::expect_refused([&] { (void)load_system(folder_.file("drive.yaml")); }, message);
  }
  write_text(folder_.file("drive.yaml"), kDrive);
  for (const auto& [from, to, message] : std::vector<std::array<std::string, 3>>{
           {"physics/1", "physics/2", "format"},
           {"law: coulomb", "law: coulombe", "no law 'coulombe'"},
           {"unit: rad/s", "unit: m/s", "must be 'rad/s'"},
           {"value: 0.3", "value: -0.3", "negative"}}) {
    write_text(folder_.file("friction.yaml"), replaced(kFriction, from, to));
    testing::expect_refused(
        [&] { (void)load_system(folder_.file("drive.yaml"), folder_.file("friction.yaml")); },
        message);
  }
  expect_refused(simulate, "negative");  // the last of them, as the user sees it
  write_text(folder_.file("friction.yaml"), kFriction);
  write_text(folder_.file("drive_plan.yaml"), kDrivePlan + "plant: robot\n");
  expect_refused(simulate, "is for robots");
  write_text(folder_.file("drive_plan.yaml"), replaced(kDrivePlan, "frequencies: [5, 35]\n", ""));
  expect_refused(simulate, "frequencies");
  expect_refused("simulate drive.yaml drive_plan.yaml --hidden nothing.yaml -o out",
                 "nothing.yaml");
  expect_refused("simulate drive.yaml", "needs a model");
}

TEST_F(SimulateCommand, RefusesWrongInput) {
  const std::string simulate = "simulate irb6600_like.yaml plan.yaml -o out";
  expect_refused("simulate missing.yaml plan.yaml -o out", "missing.yaml");
  expect_refused("simulate irb6600_like.yaml missing.yaml -o out", "missing.yaml");
  const std::vector<std::array<std::string, 3>> mistakes{
      {"plan/1", "plan/2", "format"},
      {"plant: local", "plant: imagined", "plant"},
      {"[[0, 30, -60, 0, 45, 0], ", "[[0, 30], ", "positions"},
      {"levels: [0.5]", "levels: [-1]", "levels"},
      {"levels: [0.5]", "levels: []", "levels"},
      {"validation_realisations: 1", "validation_realisations: 2", "validation_realisations"},
      {"to: 60", "to: 1500", "period"},
      {"periods: 2", "perioden: 2", "perioden"},
      {"to: 60", "to: 2", "to"},
      {"count: 5", "count: 0", "count"},
      {"{from: 5, to: 60, count: 5, spacing: log}", "[60, 20]", "must increase"},
      {"period: 400", "detection_lines: 1\nperiod: 400", "detection_lines"},
  };
  const SimulatedSystem robot = load_system(folder_.file("irb6600_like.yaml"));
  for (const auto& [from, to, field] : mistakes) {
    write_plan(from, to);
    testing::expect_refused([&] { (void)read_plan(folder_.file("plan.yaml"), robot); }, field);
  }
  expect_refused(simulate, "detection_lines");  // the last of them, as the user sees it
  write_text(folder_.file("plan.yaml"), kPlan);
  write_text(folder_.file("file"), "");
  expect_refused("simulate irb6600_like.yaml plan.yaml -o file", "file");
  ASSERT_EQ(graybox(simulate).exit_code, 0);
  expect_refused(simulate + " --seed 9", "another model, plan or seed");
  fs::create_directory(folder_.file("full"));
  write_text(folder_.file("full/notes.txt"), "mine");
  expect_refused("simulate irb6600_like.yaml plan.yaml -o full", "not empty");
}

}  // namespace
}  // namespace graybox
