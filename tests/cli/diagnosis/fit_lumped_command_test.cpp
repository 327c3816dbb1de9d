// `graybox fit` of lumped models: the worked example of docs/how_to/fit_lumped.md, bad input, and
// real data.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

const std::string kRoot = GRAYBOX_SOURCE_DIR;
const std::string kExample = kRoot + "/docs/examples/fit/drive/";

class FitLumped : public testing::CommandRunner {
 protected:
  // Copies of the example's files, with one text replaced in the model or the campaign.
  void copy(const std::string& from = {}, const std::string& to = {}, bool in_model = true) {
    const auto replaced = [&](std::string text, bool here) {
      const std::size_t at = here && !from.empty() ? text.find(from) : std::string::npos;
      if (here && !from.empty()) {
        EXPECT_NE(at, std::string::npos) << from;
      }
      return at == std::string::npos ? text : text.replace(at, from.size(), to);
    };
    write_text(folder_.file("motor.yaml"), replaced(read_text(kExample + "motor.yaml"), in_model));
    write_text(folder_.file("campaign.yaml"),
               replaced(read_text(kExample + "campaign.yaml"), !in_model));
    for (const char* run : {"run_1.csv", "run_2.csv"}) {
      write_text(folder_.file(run), read_text(kExample + run));
    }
  }
};

TEST_F(FitLumped, FitsTwoCsvFilesOfADrive) {
  const Outcome text = graybox("fit " + kExample + "motor.yaml " + kExample + " -o fit.json");
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("motor.inertia"), std::string::npos) << text.out;
  const Json fit = Json::parse(read_text(folder_.file("fit.json")));
  EXPECT_EQ(fit["format"], "graybox-fit/1");
  EXPECT_EQ(fit["status"], "converged");
  EXPECT_EQ(fit["parameters"][0]["name"], "motor.inertia");
  EXPECT_EQ(fit["parameters"][0]["unit"], "kg m^2");
  EXPECT_GT(fit["parameters"][0]["standard_error"].get<double>(), 0.0);
  const Json more = Json::parse(graybox("fit " + kExample + "motor.yaml " + kExample +
                                        " --json --physics " + kExample + "friction.yaml")
                                    .out);
  EXPECT_LT(more["fit"]["validation"]["nrmse"].get<double>(),
            0.5 * fit["fit"]["validation"]["nrmse"].get<double>());
  // The truth behind the example.
  const double truth[] = {0.0021, 0.004, 0.05};
  for (std::size_t i = 0; i < 3; ++i) {
    const Json& parameter = more["parameters"][i];
    EXPECT_NEAR(parameter["value"].get<double>(), truth[i],
                5.0 * parameter["standard_error"].get<double>());
  }
}

TEST_F(FitLumped, TakesFurtherElementsAndFixedParameters) {
  copy("damping: {value: 0.001,", "damping: {fixed: true, value: 0.001,");
  const Outcome fixed = graybox("fit motor.yaml . --starts 1 --json");
  EXPECT_EQ(Json::parse(fixed.out)["parameters"].size(), 1U) << fixed.err;
  const Outcome more =
      graybox("fit motor.yaml . --starts 1 --json --physics " + kExample + "friction.yaml");
  EXPECT_EQ(Json::parse(more.out)["parameters"].size(), 2U) << more.err;
}

TEST_F(FitLumped, RefusesWhatDoesNotFitTogether) {
  copy("name: torque", "name: force");
  expect_refused("fit motor.yaml .", "none is called 'force' like the model's input");
  copy("name: speed", "name: omega");
  expect_refused("fit motor.yaml .", "none is called 'omega' like the model's output");
  copy("quantity: velocity", "quantity: position");
  expect_refused("fit motor.yaml .", "speed is in rad/s, but the model's output in rad");
  copy("masses:", "parameters: [rotor.inertia]\nmasses:");
  expect_refused("fit motor.yaml .", "no parameter 'rotor.inertia'; there are motor.inertia");
  copy("masses:", "parameters: []\nmasses:");
  expect_refused("fit motor.yaml .", "no parameter is free");
  copy("run_1.csv}", "run_1.csv, segments: [[0, 4]]}", false);
  expect_refused("fit motor.yaml .", "has a segment of 5 samples; a fit needs 10");
  copy("- {file: run_1.csv}", "- {file: run_1.csv, role: validation}", false);
  expect_refused("fit motor.yaml .", "no experiment for estimation");
  copy();
  std::string text = read_text(folder_.file("run_1.csv"));
  const std::size_t at = text.find("0.002,") + 6;
  text.replace(at, text.find(',', at) - at, "nan");
  write_text(folder_.file("run_1.csv"), text);
  expect_refused("fit motor.yaml .", "run_1.csv");
  copy("{name: torque, mass: motor}", "{name: torque, mass: motor, quantity: velocity}");
  expect_refused("fit motor.yaml .", "needs an input for the position of the same mass");
}

TEST_F(FitLumped, TellsDivergenceAndWhatIsNotSeenByItsExitCode) {
  copy("law: viscous\n    parameters: {damping: {value: 0.001, unit: N m s/rad}}",
       "law: viscous\n    parameters: {damping: {value: -1e6, unit: N m s/rad, fixed: true}}");
  const Outcome diverged = graybox("fit motor.yaml . --starts 1 --json");
  EXPECT_EQ(diverged.exit_code, 1) << diverged.err;
  EXPECT_NE(Json::parse(diverged.out)["status"], "converged");
  copy("elements:",
       "elements:\n  - name: twin\n    location: {kind: element, mass: motor}\n    law: viscous\n"
       "    parameters: {damping: {value: 0.001, unit: N m s/rad}}");
  const Outcome twins = graybox("fit motor.yaml . --starts 1 --json");
  EXPECT_EQ(twins.exit_code, 1) << twins.err;
  const Json fit = Json::parse(twins.out);
  EXPECT_EQ(fit["status"], "unidentifiable");
  ASSERT_EQ(fit["identifiability"]["unseen"].size(), 1U);
  EXPECT_TRUE(fit["parameters"][1]["standard_error"].is_null());
}

// ---- real recordings ----------------------------------------------------------------------------

class RealAxes : public FitLumped {
 protected:
  void SetUp() override {
    if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
      GTEST_SKIP()
          << "set GRAYBOX_RECORDINGS to the folder of the recordings (docs/how_to/recordings.md)";
    }
  }
  Json fit(const std::string& model, const std::string& campaign, const std::string& physics) {
    const std::string folder = kRoot + "/diagnosis/";
    const Outcome outcome = graybox(
        "fit " + folder + "models/" + model + ".yaml " + folder + "campaigns/" + campaign +
        ".yaml --json --starts 1" +
        (physics.empty() ? "" : " --physics " + kRoot + "/docs/examples/fit/physics/" + physics));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
  static double nrmse(const Json& fit, std::size_t recording) {
    return fit["details"]["recordings"][recording]["score"]["nrmse"][0];
  }
};

// 30.0 % and 100 % by hand (every second sample held out).
TEST_F(RealAxes, TheCoggingMotorsRippleHasItsHarmonics) {
  EXPECT_NEAR(nrmse(fit("cogging_motor", "cogging_motor", ""), 1), 100.0, 1.0);
  EXPECT_NEAR(nrmse(fit("cogging_motor", "cogging_motor", "motor_4_harmonics.yaml"), 1), 30.0, 3.0);
}

// 47.8 % and 97.0 % by hand.
TEST_F(RealAxes, TheFrictionDamperIsNoSpringAndDamper) {
  const Json linear = fit("friction_damper", "friction_damper", "damper_offset.yaml");
  EXPECT_NEAR(nrmse(linear, 0), 47.8, 4.8);
  EXPECT_NEAR(nrmse(linear, 1), 97.0, 9.7);
}

// 11.6 % and 22.3 % by hand.
TEST_F(RealAxes, TheFrictionDampersBandsSlipBehindPlay) {
  const Json bands = fit("friction_damper", "friction_damper", "damper_play.yaml");
  EXPECT_LT(nrmse(bands, 0), 12.8);
  EXPECT_LT(nrmse(bands, 1), 24.5);
}

// By hand, of the twist between the encoders: skew 15.7, 25, 12 %, with the compliance 7.5, 9.2,
// 10.2 %.
TEST_F(RealAxes, TheKr300sEncodersDifferBySkewAndComplianceOnAxis3) {
  const Json zero = fit("two_encoders", "kr300_axis_3", "");
  const Json skew = fit("two_encoders", "kr300_axis_3", "encoder_skew.yaml");
  const Json both = fit("two_encoders", "kr300_axis_3", "encoder_compliance.yaml");
  const auto of_twist = [&](const Json& fit, std::size_t recording) {
    const auto deviation = [&](const Json& of) {
      return of["details"]["recordings"][recording]["score"]["deviation"][0].get<double>();
    };
    return 100.0 * deviation(fit) / deviation(zero);
  };
  EXPECT_NEAR(of_twist(skew, 0), 15.7, 1.6);
  EXPECT_NEAR(of_twist(skew, 1), 25.0, 2.5);
  EXPECT_NEAR(of_twist(skew, 2), 12.0, 1.2);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_LT(of_twist(both, k), 11.5) << k;
  EXPECT_NEAR(skew["parameters"][1]["value"].get<double>(), 3.0e-3, 0.1e-3);
  EXPECT_NEAR(both["parameters"][2]["value"].get<double>(), -1.0 / 7.6e6, 0.1 / 7.6e6);
}

}  // namespace
}  // namespace graybox
