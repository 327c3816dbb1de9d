// Logs whose drive is recorded later than it acts, which no law of a machine does.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::write_text;
using Json = nlohmann::json;

constexpr double kStep = 0.005;

class LateDrive : public testing::CommandRunner {
 protected:
  // A motor with damping alone, driven both ways; its drive is written `late` samples later.
  void write_log(const std::string& file, double scale, int late, unsigned seed) {
    constexpr double kInertia = 4e-4, kDamping = 0.03;
    constexpr int kSamples = 250;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> torques, angles;
    double x = 0.0, v = 0.0;
    for (int k = 0; k < kSamples; ++k) {
      constexpr double kLevels[] = {0.0, 3.0, -2.0, 1.0, -3.0};
      const double torque = scale * kLevels[k / 50];
      torques.push_back(torque);
      angles.push_back(x + 1e-3 * normal(random));
      for (int step = 0; step < 50; ++step) {
        v += kStep / 50 * (torque - kDamping * v) / kInertia;
        x += kStep / 50 * v;
      }
    }
    std::string text = "torque,angle\n";
    for (int k = 0; k < kSamples; ++k) {
      text += fmt::format("{},{}\n", torques[static_cast<std::size_t>(std::max(0, k - late))],
                          angles[static_cast<std::size_t>(k)]);
    }
    write_text(folder_.file(file), text);
  }
  [[nodiscard]] Json diagnosis(int late) {
    write_log("a.csv", 1.0, late, 1);
    write_log("b.csv", -0.8, late, 2);
    write_text(folder_.file("motor.yaml"), R"(format: graybox-lumped/1
sample_time: 0.005
motion: rotation
masses: {rotor: 0.0003}
elements:
  - name: bearing
    location: {kind: element, mass: rotor}
    law: viscous
    parameters: {damping: {value: 0.02, unit: N m s/rad}}
inputs:
  - {name: torque, mass: rotor}
outputs:
  - {name: angle, mass: rotor, quantity: position}
)");
    write_text(folder_.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.005
channels:
  - {name: torque, unit: N m, is: input}
  - {name: angle, unit: rad, is: output}
hold: zero
experiments:
  - {file: a.csv}
  - {file: b.csv, role: validation}
)");
    const Outcome outcome = graybox("diagnose motor.yaml campaign.yaml --json");
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    return Json::parse(outcome.out);
  }
};

TEST_F(LateDrive, IsMovedInTimeAndNamed) {
  const Json found = diagnosis(6);
  EXPECT_EQ(found["verdict"], "explained") << found["words"].dump(1);
  ASSERT_EQ(found["late_channels"].size(), 1U) << found["words"].dump(1);
  const Json& late = found["late_channels"][0];
  EXPECT_EQ(late["channel"], "torque");
  EXPECT_NEAR(late["late_by_s"].get<double>(), 6 * kStep, kStep);
  EXPECT_LT(late["nrmse_held_out"].get<double>(),
            0.6 * late["nrmse_held_out_before"].get<double>());
  EXPECT_TRUE(found["physics"].empty()) << found["words"].dump(1);
  EXPECT_NE(found["words"].dump().find("nothing more is missing"), std::string::npos);
}

TEST_F(LateDrive, IsNotNamedWhereTheDriveIsInTime) {
  const Json found = diagnosis(0);
  EXPECT_EQ(found["verdict"], "none") << found["words"].dump(1);
  EXPECT_TRUE(found["late_channels"].empty());
}

}  // namespace
}  // namespace graybox
