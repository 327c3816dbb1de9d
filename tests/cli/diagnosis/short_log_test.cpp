// Logs so short that a part of them does not show what the whole does, and logs of speeds alone.
// The machine is a pendulum, J q'' = u - b q' - g sin q.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::write_text;
using Json = nlohmann::json;

constexpr double kInertia = 0.00167, kDamping = 0.0006, kWeight = 0.15, kStep = 0.004;

class ShortLog : public testing::CommandRunner {
 protected:
  struct Start {
    double angle = 0.0, speed = 0.0, torque = 0.0;  // amplitude of the drive
  };
  void write_run(const std::string& file, const Start& start, int samples, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::ostringstream rows;
    rows.precision(9);
    rows << "torque,angle,speed\n";
    double x = start.angle, v = start.speed;
    for (int k = 0; k < samples; ++k) {
      const double driven = start.torque * std::sin(4.0 * std::numbers::pi * k * kStep);
      rows << driven + 0.005 * normal(random) << ',' << x + 4e-4 * normal(random) << ','
           << v + 0.02 * normal(random) << '\n';
      constexpr int kSteps = 20;
      for (int i = 0; i < kSteps; ++i) {
        v += kStep / kSteps * (driven - kDamping * v - kWeight * std::sin(x)) / kInertia;
        x += kStep / kSteps * v;
      }
    }
    write_text(folder_.file(file), rows.str());
  }
  void write_files(const std::string& channel, const std::string& quantity,
                   const std::string& unit) {
    write_text(folder_.file("axis.yaml"), fmt::format(R"(format: graybox-lumped/1
sample_time: 0.004
motion: rotation
masses: {{axis: 0.0025}}
elements:
  - name: bearing
    location: {{kind: element, mass: axis}}
    law: viscous
    parameters: {{damping: {{value: 0.0001, unit: N m s/rad}}}}
inputs:
  - {{name: torque, mass: axis}}
outputs:
  - {{name: {}, mass: axis, quantity: {}}}
)",
                                                      channel, quantity));
    write_text(folder_.file("campaign.yaml"), fmt::format(R"(format: graybox-campaign/1
sample_time: 0.004
channels:
  - {{name: torque, unit: N m, is: input}}
  - {{name: {}, unit: {}, is: output}}
experiments:
  - {{file: fall.csv}}
  - {{file: driven.csv, role: validation}}
)",
                                                          channel, unit));
  }
  [[nodiscard]] Json diagnosis() {
    const Outcome outcome = graybox("diagnose axis.yaml campaign.yaml --json");
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    return Json::parse(outcome.out);
  }
};

// A free fall does not tell weight from inertia, which the driven motion kept out does. With both
// in the fit the weight is found, and nothing has tested it.
TEST_F(ShortLog, AllRecordingsAreFittedWhereAPartShowsNoLaw) {
  write_run("fall.csv", {1.84, 0.0, 0.0}, 100, 1);
  write_run("driven.csv", {0.6, 3.5, 0.1}, 100, 2);
  write_files("angle", "position", "rad");
  const Json found = diagnosis();
  ASSERT_EQ(found["physics"].size(), 1U) << found["words"].dump(1);
  const Json& weight = found["physics"][0];
  EXPECT_EQ(weight["law"], "gravity");
  const Json& sine = weight["parameters"]["sine"];
  EXPECT_NEAR(sine["value"].get<double>(), kWeight,
              std::max(0.003, 4.0 * sine["standard_error"].get<double>()));
  EXPECT_EQ(found["verdict"], "ambiguous");
  EXPECT_NE(found["words"].dump().find("were fitted, too, and nothing has tested"),
            std::string::npos)
      << found["words"].dump(1);
}

// From speeds alone nobody knows where a pendulum hangs.
TEST_F(ShortLog, SpeedsAloneTellNoWeight) {
  write_run("fall.csv", {1.84, 0.0, 0.0}, 300, 1);
  write_run("driven.csv", {0.6, 3.5, 0.1}, 300, 2);
  write_files("speed", "velocity", "rad/s");
  const Json found = diagnosis();
  for (const Json& effect : found["physics"]) EXPECT_NE(effect["law"], "gravity");
  EXPECT_NE(found["verdict"], "explained");
}

}  // namespace
}  // namespace graybox
