// `graybox fit` of a robot, from simulated recordings to the report, and one clear line for wrong
// input; `graybox design verify` on a small study.
#include <Eigen/Cholesky>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "problems/base/distributions.hpp"
#include "problems/formats/information_set_file.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Outcome;
using testing::read_text;
using testing::replaced;
using testing::write_text;

const std::string kPlan = R"(format: graybox-plan/1
plant: local
positions: [[45, 15, -150, 0, -90, 0], [45, -15, -45, 45, -90, 0], [0, 15, -105, 0, -45, 0]]
levels: [1.0]
realisations: 2
validation_realisations: 1
period: 4000
settling_periods: 2
periods: 2
frequencies: {from: 3, to: 60, count: 18, spacing: log}
noise: 1e-4
)";

class FitCommand : public testing::CommandRunner {
 protected:
  FitCommand() {
    for (const char* name : {"irb6600_like.yaml", "irb6600_like.urdf"}) {
      fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "problems/robot" / name, folder_.file(name));
    }
  }

  // The robot that is measured has another second gearbox than the model says.
  void simulate(const std::string& plan) {
    const std::string model = read_text(folder_.file("irb6600_like.yaml"));
    write_text(folder_.file("truth.yaml"), replaced(model, "3.07e6", "3.40e6"));
    write_text(folder_.file("plan.yaml"), plan);
    const Outcome outcome = graybox("simulate truth.yaml plan.yaml -o campaign");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }

  void change_campaign(const std::string& from, const std::string& to) {
    const std::string file = folder_.file("campaign/campaign.yaml");
    write_text(file, replaced(read_text(file), from, to));
  }
};

// (theta_hat - theta)^T C^-1 (theta_hat - theta), C as the fit states it.
double error_in_covariance(const json& fit) {
  Eigen::VectorXd error(12);
  Eigen::MatrixXd covariance(12, 12);
  for (Eigen::Index p = 0; p < 12; ++p) {
    const json& each = fit["parameters"][static_cast<std::size_t>(p)];
    const bool changed = each["name"] == "joint_2.gearbox";
    const double truth = changed ? 3.40e6 : each["start"].get<double>();
    error(p) = each["value"].get<double>() - truth;
    for (Eigen::Index q = 0; q < 12; ++q) {
      covariance(p, q) =
          fit["covariance"][static_cast<std::size_t>(p)][static_cast<std::size_t>(q)].get<double>();
    }
  }
  return error.dot(covariance.llt().solve(error));
}
constexpr double kOnceIn100000 = 1.0 - 1e-5;

TEST_F(FitCommand, FindsTheStiffnessOfASimulatedRobotWithinItsCovariance) {
  simulate(kPlan);
  const Outcome outcome = graybox("fit irb6600_like.yaml campaign -o fit.json --starts 1 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json fit = json::parse(outcome.out);
  EXPECT_EQ(fit, json::parse(read_text(folder_.file("fit.json"))));
  EXPECT_EQ(fit["format"], "graybox-fit/1");
  EXPECT_EQ(fit["status"], "converged");
  ASSERT_EQ(fit["parameters"].size(), 12U);
  EXPECT_LT(error_in_covariance(fit), chi_square_quantile(kOnceIn100000, 12.0));
  const json& quality = fit["fit"];
  for (const char* role : {"estimation", "validation"}) {
    EXPECT_EQ(quality[role]["recordings"], 18) << role;
    // The noise is estimated from a few bins beside each line, leakage of the loop included.
    const double spread = std::sqrt(2.0 / fit["degrees_of_freedom"].get<double>());
    EXPECT_NEAR(quality[role]["chi_square_per_dof"].get<double>(), 1.0, 10.0 * spread) << role;
    EXPECT_LT(quality[role]["nrmse"].get<double>(), 30.0) << role;
    EXPECT_GT(quality[role]["variance_accounted_for"].get<double>(), 90.0) << role;
  }
  EXPECT_TRUE(fit["identifiability"]["unseen"].empty());
  const Outcome text = graybox("fit irb6600_like.yaml campaign --starts 1");
  EXPECT_NE(text.out.find("joint_2.gearbox"), std::string::npos);
  EXPECT_NE(text.out.find("1 of 1 start ended in the best optimum"), std::string::npos) << text.out;
}

// No polynomials, whose noise they pay for: smaller errors, and they hold.
TEST_F(FitCommand, GoesOnWithTheLinesThemselves) {
  simulate(kPlan);
  const Outcome responses = graybox("fit irb6600_like.yaml campaign --starts 1 --json");
  const Outcome lines = graybox("fit irb6600_like.yaml campaign --starts 1 --lines local --json");
  ASSERT_EQ(lines.exit_code, 0) << lines.err;
  const json before = json::parse(responses.out), fit = json::parse(lines.out);
  EXPECT_EQ(fit["method"], "spectral lines, maximum likelihood (local models)");
  EXPECT_LT(error_in_covariance(fit), chi_square_quantile(kOnceIn100000, 12.0));
  for (std::size_t p = 0; p < 12; ++p) {
    EXPECT_LT(fit["parameters"][p]["standard_error"].get<double>(),
              before["parameters"][p]["standard_error"].get<double>())
        << p;
  }
  for (const char* role : {"estimation", "validation"}) {
    const json& quality = fit["fit"][role];
    EXPECT_EQ(quality["recordings"], 18) << role;
    EXPECT_NEAR(quality["chi_square_per_dof"].get<double>(), 1.0, 0.05) << role;
  }
  const Outcome threads =
      graybox("fit irb6600_like.yaml campaign --starts 1 --lines local --json --threads 2");
  const json other = json::parse(threads.out);
  for (std::size_t p = 0; p < 12; ++p) {
    const auto value = fit["parameters"][p]["value"].get<double>();
    EXPECT_NEAR(other["parameters"][p]["value"].get<double>(), value, 1e-7 * value) << p;
  }
}

// Motions that are not small: the arm's own forces are no noise.
TEST_F(FitCommand, FitsTheLinesOfAFullRobot) {
  for (const char* name : {"three_axis.yaml", "three_axis.urdf"}) {
    fs::copy_file(fs::path(GRAYBOX_SOURCE_DIR) / "problems/robot" / name, folder_.file(name));
  }
  const std::string model = read_text(folder_.file("three_axis.yaml"));
  write_text(folder_.file("truth.yaml"), replaced(model, "4.0e4", "4.4e4"));
  write_text(folder_.file("plan.yaml"), R"(format: graybox-plan/1
plant: robot
positions: [[20, 30, 40], [0, -20, 60]]
levels: [2.0]
realisations: 2
validation_realisations: 1
period: 1000
settling_periods: 5
periods: 4
frequencies: {from: 2, to: 60, count: 20, spacing: log}
noise: 1e-11
)");
  ASSERT_EQ(graybox("simulate truth.yaml plan.yaml -o campaign").exit_code, 0);
  const Outcome outcome = graybox("fit three_axis.yaml campaign --starts 2 --lines full --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json fit = json::parse(outcome.out);
  for (const char* role : {"estimation", "validation"}) {
    EXPECT_NEAR(fit["fit"][role]["chi_square_per_dof"].get<double>(), 1.0, 0.15) << role;
  }
  for (const json& each : fit["parameters"]) {
    const bool changed = each["name"] == "joint_1.gearbox";
    const double truth = changed ? 4.4e4 : each["start"].get<double>();
    const auto error = each["standard_error"].get<double>();
    EXPECT_NEAR(each["value"].get<double>(), truth, 4.5 * error) << each["name"];
    EXPECT_LT(error, 0.01 * truth) << each["name"];
  }
}

TEST_F(FitCommand, RefusesLinesOfSinglePeriodsAndOtherModels) {
  simulate(
      replaced(replaced(kPlan, "periods: 2\nfreq", "periods: 1\nfreq"), "count: 18", "count: 4"));
  expect_refused("fit irb6600_like.yaml campaign --lines some", "--lines");
  write_text(folder_.file("drive.yaml"), "format: graybox-lumped/1\n");
  expect_refused("fit drive.yaml campaign --lines full", "--lines is for graybox-robot/1 models");
  expect_refused("fit irb6600_like.yaml campaign --starts 1 --lines full", "period");
}

TEST_F(FitCommand, SaysWhatOneFrequencyInOnePositionDoesNotShow) {
  std::string plan = replaced(kPlan, ", [45, -15, -45, 45, -90, 0], [0, 15, -105, 0, -45, 0]", "");
  plan = replaced(plan, "validation_realisations: 1", "validation_realisations: 0");
  plan = replaced(plan, "{from: 3, to: 60, count: 18, spacing: log}", "[1.25, 2.25, 3.25]");
  simulate(replaced(plan, "noise: 1e-4", "noise: 1e-2"));
  const Outcome outcome = graybox("fit irb6600_like.yaml campaign --starts 1 --json");
  const json fit = json::parse(outcome.out);
  EXPECT_FALSE(fit["identifiability"]["unseen"].empty());
  int without = 0;
  for (const json& each : fit["parameters"]) without += each["standard_error"].is_null() ? 1 : 0;
  EXPECT_GT(without, 0);
  EXPECT_TRUE(fit["fit"]["validation"].is_null());
  EXPECT_NE(fit["notes"].dump().find("no recording has the role validation"), std::string::npos);
}

// What a diagnosis writes every other command reads: what a linear model can hold is in it, and the
// rest is named.
TEST_F(FitCommand, AModelWithFurtherPhysicsIsReadByTheCommandsOfLinearModels) {
  const std::string model = read_text(folder_.file("irb6600_like.yaml"));
  const std::string stiffer = R"(elements:
  - name: brace
    location: {kind: element, joint: joint_2, axis: gearbox}
    law: stiffness
    parameters: {stiffness: {value: 3e5, unit: N m/rad}}
)";
  const std::string rubbing = R"(  - name: grease
    location: {kind: element, joint: joint_1, axis: motor}
    law: coulomb
    parameters: {level: {value: 1, unit: N m}, transition_velocity: {value: 0.5, unit: rad/s}}
)";
  write_text(folder_.file("stiffer.yaml"), model + stiffer);
  write_text(folder_.file("extended.yaml"), model + stiffer + rubbing);
  for (const char* command : {"problem robot --grid 20 -o set.h5 --model",
                              "design robust --grid 20 --samples 4 -o robust.json --model"}) {
    const std::string text = command;
    const Outcome whole = graybox(text + " stiffer.yaml");
    ASSERT_EQ(whole.exit_code, 0) << text << whole.err;
    EXPECT_EQ(whole.err, "");
    const Outcome part = graybox(text + " extended.yaml");
    ASSERT_EQ(part.exit_code, 0) << text << part.err;
    EXPECT_NE(part.err.find("leaves out 'grease' (coulomb at joint_1.motor)"), std::string::npos)
        << part.err;
  }
  ASSERT_EQ(graybox("problem robot --grid 20 -o own.h5").exit_code, 0);
  ASSERT_EQ(graybox("problem robot --grid 20 -o stiffer.h5 --model stiffer.yaml").exit_code, 0);
  const auto hash_of = [&](const std::string& file) {
    return read_information_set(folder_.file(file)).content_hash();
  };
  EXPECT_EQ(hash_of("set.h5"), hash_of("stiffer.h5"));
  EXPECT_NE(hash_of("set.h5"), hash_of("own.h5"));
  simulate(kPlan);
  const Outcome fit = graybox("fit extended.yaml campaign --starts 1 --json");
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  EXPECT_NE(json::parse(fit.out)["notes"].dump().find("'grease' (coulomb at joint_1.motor)"),
            std::string::npos);
}

TEST_F(FitCommand, RefusesWrongInput) {
  expect_refused("fit", "model is required");
  expect_refused("fit none.yaml campaign", "none.yaml");
  expect_refused("fit irb6600_like.yaml nowhere", "nowhere");
  write_text(folder_.file("other.yaml"), "format: graybox-plan/1\n");
  expect_refused("fit other.yaml campaign", "models that can be fitted: graybox-robot/1");
  simulate(replaced(kPlan, "count: 18", "count: 3"));
  expect_refused("fit irb6600_like.yaml campaign -o nowhere/fit.json", "nowhere");
  expect_refused("fit irb6600_like.yaml campaign --starts 0", "--starts");
  const std::string model = read_text(folder_.file("irb6600_like.yaml"));
  write_text(folder_.file("slow.yaml"),
             replaced(model, "sample_time: 0.0005", "sample_time: 0.001"));
  expect_refused("fit slow.yaml campaign", "sample_time: 0.0005 s");
  const std::string campaign = read_text(folder_.file("campaign/campaign.yaml"));
  const auto refused_with = [&](const std::string& from, const std::string& to,
                                const std::string& text) {
    write_text(folder_.file("campaign/campaign.yaml"), replaced(campaign, from, to));
    expect_refused("fit irb6600_like.yaml campaign", text);
  };
  refused_with("hold: zero", "hold: band_limited", "hold");
  refused_with("{name: u_6, unit: N m, is: input}", "{name: u_6, unit: N m, is: other}",
               "5 inputs and 6 outputs");
  refused_with("sub_experiment: 2", "sub_experiment: 1", "twice");
  refused_with("position: [45, 15, -150, 0, -90, 0]", "position: [45, 15, -150]", "sub_experiment");
}

TEST_F(FitCommand, VerifiesADesignAndTakesFinishedFitsOver) {
  write_text(folder_.file("quick.yaml"),
             replaced(read_text(folder_.file("irb6600_like.yaml")), "count: 50", "count: 6"));
  const std::string command =
      "design verify --model quick.yaml --grid 6 --experiments 8 --recordings 0 -o study --json "
      "--repetitions 70 --seed ";
  const Outcome first = graybox(command + "3");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const std::string rows = read_text(folder_.file("study/verify_rows.jsonl"));
  const Outcome again = graybox(command + "3 --threads 2");
  EXPECT_EQ(again.out, first.out) << again.err;
  EXPECT_EQ(read_text(folder_.file("study/verify_rows.jsonl")), rows);
  const json study = json::parse(first.out);
  ASSERT_EQ(study["summary"].size(), 3U);
  EXPECT_EQ(
      study["summary"][0]["estimates"].get<int>() + study["summary"][0]["rejected"].get<int>(), 70);
  // Frequency responses with the stated noise: each fit says what formula (12) says, and estimates
  // scatter alike against either.
  const json& optimal = study["summary"][0];
  const double stated = optimal["stated_over_predicted"].get<double>();
  EXPECT_NEAR(stated, 1.0, 0.15);  // the mean over fits at theta_hat, 8 experiments
  EXPECT_NEAR(optimal["against_stated"]["estimate"].get<double>() * stated,
              optimal["determinant"]["estimate"].get<double>(), 1e-3);
  // The best single position can't be better than the optimum.
  EXPECT_GT(study["ratios"][0]["predicted"].get<double>(), 1.0);
  expect_refused(command + "4", "holds estimates of another study");
  expect_refused("design verify -o study --noise 0", "--noise");
  expect_refused("design verify --grid 60", "-o: needs a folder");
  expect_refused("design verify --grid 60 -o third --repetitions 5", "more than 13");
}

}  // namespace
}  // namespace graybox
