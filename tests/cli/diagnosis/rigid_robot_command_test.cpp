// `graybox fit` of rigid robots: what users see.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using Json = nlohmann::json;

const std::string kModel = R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: carriage, type: prismatic, a: 0, alpha: 90, d: 0, gear_ratio: 1, rotor_inertia: 0}
channels: {torque: [force], torque_of: arm, position: [x], position_of: arm}
)";

const std::string kCampaign = R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: force, unit: N, is: input}
  - {name: x, unit: m, is: output}
hold: zero
experiments:
  - {file: run_1.csv}
  - {file: run_2.csv, role: validation}
)";

const std::string kFriction = R"(format: graybox-physics/1
elements:
  - {name: drag, location: {kind: element, joint: carriage, axis: arm}, law: viscous,
     parameters: {damping: {value: 0, unit: N s/m}}}
)";

// 3 kg with friction 5 N s/m and a little ripple that is in no model.
std::string run_of(double frequency) {
  std::string csv = "time,force,x\n";
  for (int k = 0; k < 600; ++k) {
    const double t = 0.01 * k, w = 2.0 * 3.14159265358979 * frequency;
    const double v = w * std::cos(w * t), a = -w * w * std::sin(w * t);
    csv += fmt::format("{:.17g},{:.17g},{:.17g}\n", t, 3.0 * a + 5.0 * v + 0.1 * std::sin(31.0 * t),
                       std::sin(w * t));
  }
  return csv;
}

class RigidRobotCommand : public testing::CommandRunner {
 protected:
  RigidRobotCommand() {
    testing::write_text(folder_.file("model.yaml"), kModel);
    testing::write_text(folder_.file("campaign.yaml"), kCampaign);
    testing::write_text(folder_.file("friction.yaml"), kFriction);
    testing::write_text(folder_.file("run_1.csv"), run_of(0.7));
    testing::write_text(folder_.file("run_2.csv"), run_of(1.1));
  }
};

TEST_F(RigidRobotCommand, FitsAndSaysHowWell) {
  const testing::Outcome rigid = graybox("fit model.yaml . --json -o fit.json");
  ASSERT_EQ(rigid.exit_code, 0) << rigid.err;
  const Json mass_only = Json::parse(rigid.out);
  EXPECT_EQ(Json::parse(testing::read_text(folder_.file("fit.json"))), mass_only);
  const testing::Outcome extended =
      graybox("fit model.yaml . --physics friction.yaml --decimate 2 --json");
  ASSERT_EQ(extended.exit_code, 0) << extended.err;
  const Json both = Json::parse(extended.out);
  EXPECT_EQ(both["format"], "graybox-fit/1");
  EXPECT_EQ(both["status"], "converged");
  ASSERT_EQ(both["parameters"].size(), 2U);
  EXPECT_EQ(both["parameters"][0]["name"], "M1");
  EXPECT_EQ(both["parameters"][0]["unit"], "kg");
  EXPECT_NEAR(both["parameters"][0]["value"].get<double>(), 3.0, 0.02);
  EXPECT_EQ(both["parameters"][1]["name"], "drag.damping");
  EXPECT_NEAR(both["parameters"][1]["value"].get<double>(), 5.0, 0.1);
  EXPECT_TRUE(both["parameters"][1]["start"].is_null());
  EXPECT_EQ(both["covariance"].size(), 2U);
  const auto nrmse = [](const Json& fit, const char* role) {
    return fit["fit"][role]["nrmse"].get<double>();
  };
  EXPECT_LT(nrmse(both, "validation"), 0.1 * nrmse(mass_only, "validation"));
  EXPECT_EQ(both["details"]["records"][1]["role"], "validation");
  EXPECT_EQ(both["details"]["records"][1]["joints"][0]["name"], "carriage");
  const testing::Outcome text = graybox("fit model.yaml .");
  EXPECT_NE(text.out.find("|error|/|torque|"), std::string::npos) << text.out;
}

TEST_F(RigidRobotCommand, RefusesWrongInput) {
  expect_refused("fit model.yaml . --physics missing.yaml", "missing.yaml");
  expect_refused("fit model.yaml . --physics friction.yaml --refine drag.damping",
                 "enters the force linearly");
  expect_refused("fit model.yaml . --refine spring.stiffness", "names no element");
  expect_refused("fit model.yaml . --decimate 0", "--decimate");
  expect_refused("fit model.yaml . --decimate 500", "too short");
  std::string campaign = kCampaign;
  campaign.replace(campaign.find("unit: N,"), 8, "unit: N m,");
  testing::write_text(folder_.file("campaign.yaml"), campaign);
  expect_refused("fit model.yaml .", "channel force is in N m; joint carriage");
  std::string model = kModel;
  model.replace(model.find("gear_ratio: 1"), 13, "gear_ratio: 0");
  testing::write_text(folder_.file("model.yaml"), model);
  expect_refused("fit model.yaml .", "gear_ratio: must not be zero");
}

}  // namespace
}  // namespace graybox
