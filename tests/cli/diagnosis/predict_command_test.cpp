// `graybox predict`: errors of models as they stand, against models whose errors are known.
#include <gtest/gtest.h>

#include <cmath>
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
  EXPECT_NE(read_text(folder_.file("page.html")).find("<svg"), std::string::npos);
  // What is unknown predicts nothing.
  std::string unknown = model;
  unknown.replace(unknown.find("body: {mass: 2, centre_of_mass: [0.3, 0, 0]}"), 44,
                  "body: unknown");
  write_text(folder_.file("model.yaml"), unknown);
  const Outcome refused = graybox("predict model.yaml campaign.yaml");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("the body of pendulum is unknown"), std::string::npos) << refused.err;
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
