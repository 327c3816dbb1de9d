// Which laws a fit tells at all: sizes from none, and waves from constants.
#include "diagnosis/predictor/told_law.hpp"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr const char* kAxis = R"(format: graybox-lumped/1
sample_time: 0.01
motion: rotation
masses: {axis: 1.0}
elements:
  - name: bearing
    location: {kind: element, mass: axis}
    law: viscous
    parameters: {damping: {value: 0.1, unit: N m s/rad}}
inputs:
  - {name: torque, mass: axis}
outputs:
  - {name: angle, mass: axis, quantity: position}
)";

// At the axis, or at the sensor of an output.
PredictionFit fit_with(const std::string& law, const std::vector<double>& values, int output = -1,
                       const std::string& text = kAxis) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("axis.yaml"), text);
  const LumpedModel axis = load_lumped_model(folder.file("axis.yaml"));
  LawExtension extension;
  extension.location = axis.parts.front().location;
  if (output >= 0) {
    extension.location.kind = LocationKind::kSensor;
    extension.location.channel = output;
  }
  extension.law = law;
  extension.base = values;
  extension.direction.assign(values.size(), 0.0);
  extension.fixed.assign(values.size(), false);
  PredictionFit fit;
  fit.model = extended(as_given(axis, 10.0), extension, 0.0);
  fit.free = fit.model.free_parameters();
  return fit;
}

// Deviations of the free parameters, `of_law` of the law's.
VectorXd deviations(const PredictionFit& fit, const std::vector<double>& of_law) {
  VectorXd result = VectorXd::Constant(static_cast<Index>(fit.free.size()), 0.01);
  for (std::size_t k = 0; k < of_law.size(); ++k) {
    result(result.size() - static_cast<Index>(of_law.size() - k)) = of_law[k];
  }
  return result;
}

TEST(ToldLaw, AWaveIsToldByItsAmplitudeAndNotByItsPeriod) {
  const PredictionFit fit = fit_with("ripple", {-0.26, 0.18, 4.0});
  const PlacedFinding law = fit.model.laws.front();
  const ToldSize told = told_size(fit, deviations(fit, {0.19, 0.01, 15.0}), law, 2.5);
  EXPECT_TRUE(told.is_free);
  EXPECT_FALSE(told.is_told);
  EXPECT_TRUE(told_size(fit, deviations(fit, {0.05, 0.01, 0.2}), law, 2.5).is_told);
}

TEST(ToldLaw, FrictionIsToldByItsLevelAndNotByItsTransition) {
  const PredictionFit fit = fit_with("coulomb", {0.3, 0.01});
  const PlacedFinding law = fit.model.laws.front();
  EXPECT_FALSE(told_size(fit, deviations(fit, {0.4, 0.001}), law, 1.0).is_told);
  EXPECT_TRUE(told_size(fit, deviations(fit, {0.1, 0.1}), law, 1.0).is_told);
}

// The search allows a signal to be so late and no later: there something else is missing.
TEST(ToldLaw, ASignalThatIsAsLateAsMayBeIsNotLate) {
  PredictionFit fit = fit_with("lag", {0.02}, 0);
  const PlacedFinding law = fit.model.laws.front();
  const std::size_t time = fit.model.first_parameter(law.part);
  EXPECT_FALSE(is_late_at_bound(fit, law));
  fit.model.model.parameters[time].value = fit.model.space[time].high;
  EXPECT_TRUE(is_late_at_bound(fit, law));
  EXPECT_FALSE(is_late_at_bound(fit_with("coulomb", {0.3, 0.01}),
                                fit_with("coulomb", {0.3, 0.01}).model.laws.front()));
}

// 1 + c |s|/reference, with the largest |s| as the reference: at c = -1 the drive gives nothing.
TEST(ToldLaw, ADriveWhoseGainTurnsIsNone) {
  const auto turns = [](double curvature) {
    const PredictionFit fit = fit_with("curved_gain", {curvature, 2.0}, 0);
    return turns_its_drive(fit, fit.model.laws.front());
  };
  EXPECT_TRUE(turns(-6.8));
  EXPECT_FALSE(turns(-0.66));
  EXPECT_FALSE(turns(0.5));
  PredictionFit reversed = fit_with("gain", {-1.8}, 0);
  EXPECT_FALSE(turns_its_drive(reversed, reversed.model.laws.front()));  // of a sensor
  reversed.model.model.parts.back().location.kind = LocationKind::kActuator;
  EXPECT_TRUE(turns_its_drive(reversed, reversed.model.laws.front()));
  reversed.model.model.parts.back().parameters[0] = -0.3;
  EXPECT_FALSE(turns_its_drive(reversed, reversed.model.laws.front()));
}

// A tachometer that reads exactly zero at rest is not off from it, nor is one by half its range.
TEST(ToldLaw, ASpeedThatReadsZeroAtRestHasNoOffset) {
  std::string text = kAxis;
  text.replace(text.find("{name: angle"), std::string("{name: angle").size(), "{name: speed");
  text.replace(text.find("quantity: position"), std::string("quantity: position").size(),
               "quantity: velocity");
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("axis.yaml"), text);
  testing::write_text(folder.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.01
time: {column: t, unit: s}
channels:
  - {name: torque, column: u, unit: N m, is: input}
  - {name: speed, column: v, unit: rad/s, is: output}
hold: zero
experiments: [{file: log.csv}]
)");
  const auto is_contradicted = [&](int zeros, double offset) {
    std::string log = "t,u,v\n";
    for (int k = 0; k < 200; ++k) {
      const double speed = k < zeros ? 0.0 : 4.0 * std::sin(0.07 * k) + 0.01 * (k % 3);
      log += fmt::format("{:.2f},{:.4f},{:.4f}\n", 0.01 * k, std::cos(0.07 * k), speed);
    }
    testing::write_text(folder.file("log.csv"), log);
    const LumpedModel axis = load_lumped_model(folder.file("axis.yaml"));
    const PredictionData data(axis, read_campaign(folder.file("campaign.yaml")), 1);
    const PredictionFit fit = fit_with("offset", {offset}, 0, text);
    return contradicts_its_zero(fit, fit.model.laws.front(), data);
  };
  EXPECT_FALSE(is_contradicted(1, 0.1));
  EXPECT_TRUE(is_contradicted(2, 0.1));
  EXPECT_TRUE(is_contradicted(1, -0.5));
}

// The spring of a servo is known, and its mass and damper may be guesses all the same.
TEST(ToldLaw, AMassOnAKnownSpringIsAlone) {
  const testing::TemporaryFolder folder;
  const auto is_alone = [&](const std::string& spring) {
    std::string text = kAxis;
    text.insert(text.find("inputs:"),
                "  - {name: servo, location: {kind: element, mass: axis}, law: stiffness, "
                "parameters: {stiffness: " +
                    spring + "}}\n");
    testing::write_text(folder.file("axis.yaml"), text);
    return is_one_mass_alone(load_lumped_model(folder.file("axis.yaml")));
  };
  EXPECT_TRUE(is_alone("{value: 1, unit: N m/rad, fixed: true}"));
  EXPECT_FALSE(is_alone("{value: 1, unit: N m/rad}"));
}

TEST(ToldLaw, AWaveLongerThanTheWayIsNone) {
  const auto is_longer = [](double period, double way) {
    const PredictionFit fit = fit_with("ripple", {1.0, period, 0.0});
    Eigen::MatrixXd motion(100, 2);
    motion.col(0) = VectorXd::LinSpaced(100, 0.0, way);
    motion.col(1).setOnes();
    return is_longer_than_the_way(fit, fit.model.laws.front(), motion);
  };
  EXPECT_TRUE(is_longer(0.031, 0.012));
  EXPECT_FALSE(is_longer(0.006, 0.012));
}

}  // namespace
}  // namespace graybox
