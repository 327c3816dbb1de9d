// `graybox predict`: errors of models as they stand, against models whose errors are known.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class Predict : public testing::CommandRunner {
 protected:
  Json rows(const std::string& arguments) {
    const Outcome outcome = graybox("predict " + arguments + " --json");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return Json::parse(outcome.out)["rows"];
  }
};

// What `graybox fit` finds for the recording kept out is what the fitted model predicts of it.
TEST_F(Predict, TheDrivesModelPredictsWithWhatItLeavesOut) {
  const std::string folder = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive";
  const Json naive = rows(folder + "/motor.yaml " + folder);
  const Json better =
      rows(folder + "/motor.yaml " + folder + " --physics " + folder + "/friction.yaml");
  ASSERT_EQ(naive.size(), better.size());
  bool has_free_run = false;
  for (std::size_t i = 0; i < naive.size(); ++i) {
    EXPECT_EQ(naive[i]["channel"], "speed");
    EXPECT_GT(naive[i]["nrmse"].get<double>(), 1.0);
    has_free_run = has_free_run || naive[i]["seconds_ahead"].is_null();
  }
  EXPECT_TRUE(has_free_run);
}

// A pendulum's torque by formula, with noise of known size; its model is exact.
TEST_F(Predict, ForcesOfAnExactModelAreOffByTheNoise) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 0.05);
  std::ostringstream csv;
  csv.precision(12);
  csv << "torque,q,v,a\n";
  for (int k = 0; k < 2000; ++k) {
    const double t = 0.01 * k, w = 1.7;
    const double q = std::sin(w * t), v = w * std::cos(w * t), a = -w * w * std::sin(w * t);
    // 2 kg at 0.3 m along x, an axis that lies: J a + m g r cos q + friction
    const double torque = 2.0 * 0.09 * a + 2.0 * 9.81 * 0.3 * std::cos(q) + 0.4 * v;
    csv << torque + normal(random) << ',' << q << ',' << v << ',' << a << '\n';
  }
  write_text(folder_.file("1.csv"), csv.str());
  write_text(folder_.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: torque, unit: N m, is: input}
  - {name: q, unit: rad, is: output}
  - {name: v, unit: rad/s, is: output}
  - {name: a, unit: rad/s^2, is: output}
experiments:
  - {file: 1.csv}
)");
  const std::string model = R"(format: graybox-rigid-robot/1
gravity: [0, -9.81, 0]
denavit_hartenberg: modified
joints:
  - {name: pendulum, a: 0, alpha: 0, d: 0, gear_ratio: 1, rotor_inertia: 0,
     body: {mass: 2, centre_of_mass: [0.3, 0, 0]}}
elements:
  - {name: bearing, location: {kind: element, joint: pendulum, axis: arm}, law: viscous,
     parameters: {damping: {value: 0.4, unit: N m s/rad}}}
channels: {torque: [torque], torque_of: arm, position: [q], position_of: arm, velocity: [v],
           acceleration: [a]}
)";
  write_text(folder_.file("model.yaml"), model);
  const Json exact = rows("model.yaml campaign.yaml -o page.html");
  ASSERT_EQ(exact.size(), 1U);
  EXPECT_EQ(exact[0]["channel"], "torque of pendulum");
  EXPECT_NEAR(exact[0]["error"].get<double>(), 0.05, 0.005);
  EXPECT_EQ(rows("."), exact);  // the folder of both files
  EXPECT_NE(read_text(folder_.file("page.html")).find("<svg"), std::string::npos);
  // What is unknown predicts nothing.
  std::string unknown = model;
  unknown.replace(unknown.find("body: {mass: 2, centre_of_mass: [0.3, 0, 0]}"), 44,
                  "body: unknown");
  write_text(folder_.file("model.yaml"), unknown);
  const Outcome refused = graybox("predict model.yaml campaign.yaml");
  EXPECT_EQ(refused.exit_code, 2);
  expect_refused("predict model.yaml campaign.yaml --initial-state free", "no initial state");
  EXPECT_NE(refused.err.find("the body of pendulum is unknown"), std::string::npos) << refused.err;
}

// Alone, too, a log or a URDF is told which command makes a model of it.
TEST_F(Predict, ALogOrAUrdfIsNoModel) {
  write_text(folder_.file("run.csv"), "time,voltage,speed\n0,1,0\n");
  write_text(folder_.file("arm.urdf"), "<robot name='arm'/>\n");
  write_text(folder_.file("model.yaml"), "format: graybox-lumped/1\n");
  write_text(folder_.file("campaign.yaml"), "format: graybox-campaign/1\n");
  for (const char* command : {"predict", "fit", "diagnose"}) {
    const std::string name = command;
    expect_refused(name + " run.csv", "'graybox model run.csv'");
    expect_refused(name + " arm.urdf", "'graybox model arm.urdf LOG.csv'");
    expect_refused(name + " model.yaml", "graybox " + name + " model.yaml CAMPAIGN");
    expect_refused(name + " nothing", "nothing");
    expect_refused(name + " campaign.yaml", "graybox " + name + " MODEL campaign.yaml");
  }
}

// A mass that flies against a viscous friction. Its model is exact, but of the first sample the
// noise is twenty times as large, so that the state there is hardly told.
TEST_F(Predict, AnEstimatedStartLeavesAnExactModelTheNoise) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal(0.0, 0.001);
  std::ostringstream csv;
  csv.precision(12);
  csv << "force,position\n";
  for (int k = 0; k < 1500; ++k) {
    const double t = 0.01 * k;
    const double position = 3.0 * (1.0 - std::exp(-0.5 * t)) / 0.5;  // 2 kg, 1 N s/m, 3 m/s
    csv << 0.0 << ',' << position + (k == 0 ? 20.0 : 1.0) * normal(random) << '\n';
  }
  write_text(folder_.file("1.csv"), csv.str());
  write_text(folder_.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: force, unit: N, is: input}
  - {name: position, unit: m, is: output}
experiments:
  - {file: 1.csv}
)");
  write_text(folder_.file("model.yaml"), R"(format: graybox-lumped/1
sample_time: 0.01
motion: translation
masses: {mass: 2}
elements:
  - {name: air, location: {kind: element, mass: mass}, law: viscous,
     parameters: {damping: {value: 1, unit: N s/m}}}
inputs: [{name: force, mass: mass}]
outputs: [{name: position, mass: mass, quantity: position}]
)");
  const Json estimated = rows("model.yaml campaign.yaml --initial-state free");
  const Json& free_run = estimated.back();
  ASSERT_TRUE(free_run["seconds_ahead"].is_null());
  EXPECT_NEAR(free_run["error"].get<double>(), 0.001, 2e-4);
  const Json measured = rows("model.yaml campaign.yaml");
  EXPECT_EQ(measured.size(), estimated.size());
  EXPECT_GT(measured.back()["error"].get<double>(), free_run["error"].get<double>());
  const Outcome words = graybox("predict model.yaml campaign.yaml --initial-state free");
  EXPECT_NE(words.out.find("whole recording is met best"), std::string::npos) << words.out;
}

// Compared as by hand (4.6 mm), the start of the pulses estimated from them.
TEST_F(Predict, TheEmpsDriveRunsFreeOverItsPulses) {
  const char* recordings = std::getenv("GRAYBOX_RECORDINGS");
  if (recordings == nullptr) GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  write_text(folder_.file("found.yaml"), R"(format: graybox-lumped/1
sample_time: 0.001
motion: translation
masses: {carriage: 92.70}
elements:
  - {name: dry, location: {kind: element, mass: carriage}, law: coulomb,
     parameters: {level: {value: 20.45, unit: N}, transition_velocity: {value: 8.8e-5, unit: m/s}}}
  - {name: by direction, location: {kind: element, mass: carriage}, law: asymmetric_viscous,
     parameters: {forward_damping: {value: 164.8, unit: N s/m},
                  backward_damping: {value: 245.3, unit: N s/m}}}
inputs: [{name: force, mass: carriage}]
outputs: [{name: position, mass: carriage, quantity: position}]
)");
  const Json last = rows("found.yaml " + std::string(GRAYBOX_SOURCE_DIR) +
                         "/diagnosis/campaigns/emps_free_run.yaml --initial-state free")
                        .back();
  EXPECT_EQ(last["role"], "validation");
  EXPECT_TRUE(last["seconds_ahead"].is_null());
  EXPECT_LE(last["error"].get<double>(), 0.005);  // m
}

TEST_F(Predict, RefusesWhatItCanNotPredict) {
  write_text(folder_.file("robot.yaml"), "format: graybox-robot/1\n");
  const std::string folder = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive";
  EXPECT_EQ(graybox("predict robot.yaml " + folder).exit_code, 2);
  EXPECT_EQ(graybox("predict nowhere.yaml " + folder).exit_code, 2);
  EXPECT_EQ(graybox("predict " + folder + "/motor.yaml nowhere").exit_code, 2);
}

}  // namespace
}  // namespace graybox
