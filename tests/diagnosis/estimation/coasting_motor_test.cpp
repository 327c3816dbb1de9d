// A motor on a bridge that lets it coast, or shorts it, while nothing drives it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr double kSampleTime = 0.02, kInertia = 0.01, kDamping = 0.05;

struct Bridge {
  double undriven = kDamping;  // N m s/rad
  double friction = 0.0;       // N m, dry
};

double speed_after(double speed, double drive, const Bridge& bridge) {
  constexpr int kSteps = 200;
  const double damping = drive != 0.0 ? kDamping : bridge.undriven;
  for (int s = 0; s < kSteps; ++s) {
    const double pull = drive - damping * speed, step = kSampleTime / kSteps / kInertia;
    const bool holds = speed == 0.0 && std::abs(pull) <= bridge.friction;
    const double way = speed != 0.0 ? speed : pull;
    const double slid = speed + step * (pull - std::copysign(bridge.friction, way));
    speed = holds || slid * speed < 0.0 ? 0.0 : slid;
  }
  return speed;
}

// Pulses of several heights, both ways, with pauses between them.
void write_log(const testing::TemporaryFolder& folder, const std::string& name,
               const Bridge& bridge, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::string text = "torque,speed\n";
  double speed = 0.0;
  for (int pulse = 0; pulse < 10; ++pulse) {
    const double height = (pulse % 3 == 2 ? -1.0 : 1.0) * (0.3 + 0.1 * (pulse % 4));
    for (int k = 0; k < 100; ++k) {
      const double drive = k < 50 ? height : 0.0;
      text += fmt::format("{},{:.5f}\n", drive, speed + noise(random));
      speed = speed_after(speed, drive, bridge);
    }
  }
  testing::write_text(folder.file(name), text);
}

PredictionDiagnosis diagnosis_of(const Bridge& bridge, unsigned seed) {
  const testing::TemporaryFolder folder;
  testing::write_text(
      folder.file("motor.yaml"),
      "format: graybox-lumped/1\nsample_time: 0.02\nmotion: rotation\nmasses: {motor: 0.012}\n"
      "elements:\n  - {name: bearing, location: {kind: element, mass: motor}, law: viscous, "
      "parameters: {damping: {value: 0.04, unit: N m s/rad}}}\ninputs:\n"
      "  - {name: torque, mass: motor}\noutputs:\n"
      "  - {name: speed, mass: motor, quantity: velocity}\n");
  testing::write_text(folder.file("campaign.yaml"),
                      "format: graybox-campaign/1\nsample_time: 0.02\nhold: zero\nchannels:\n"
                      "  - {name: torque, unit: N m, is: input}\n"
                      "  - {name: speed, unit: rad/s, is: output}\nexperiments:\n"
                      "  - {file: a.csv}\n  - {file: b.csv, role: validation}\n");
  write_log(folder, "a.csv", bridge, seed);
  write_log(folder, "b.csv", bridge, seed + 100);
  return diagnose_by_prediction(folder.file("motor.yaml"),
                                read_campaign(folder.file("campaign.yaml")), {}, 2);
}

std::vector<std::string> laws_of(const PredictionDiagnosis& result) {
  std::vector<std::string> laws;
  for (const FoundEffect& effect : result.diagnosis.effects) {
    laws.push_back(result.hypotheses[effect.law.hypothesis].law);
  }
  std::ranges::sort(laws);
  return laws;
}

TEST(CoastingMotor, IsToldFromFrictionWhetherTheBridgeLetsGoOrShorts) {
  for (const double undriven : {0.015, 0.15}) {
    for (const double friction : {0.0, 0.04}) {
      const PredictionDiagnosis result = diagnosis_of({undriven, friction}, 3);
      std::vector<std::string> expected{"driven_viscous"};
      if (friction > 0.0) expected.insert(expected.begin(), "coulomb");
      ASSERT_EQ(laws_of(result), expected) << undriven << ' ' << friction;
      EXPECT_EQ(result.diagnosis.verdict, Verdict::kExplained) << undriven << ' ' << friction;
      for (const FoundEffect& effect : result.diagnosis.effects) {
        if (result.hypotheses[effect.law.hypothesis].law != "driven_viscous") continue;
        const LawParameterEstimate& change = effect.law.parameters[0];
        EXPECT_NEAR(change.value, kDamping - undriven, 4.0 * change.standard_error);
        EXPECT_LT(change.standard_error, 0.1 * kDamping);
      }
    }
  }
}

TEST(CoastingMotor, IsNotClaimedOfABridgeThatBrakesAlikeThroughout) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const double friction : {0.0, 0.04}) {
      const PredictionDiagnosis result = diagnosis_of({kDamping, friction}, seed);
      EXPECT_EQ(std::ranges::count(laws_of(result), "driven_viscous"), 0)
          << seed << ' ' << friction;
    }
  }
}

}  // namespace
}  // namespace graybox
