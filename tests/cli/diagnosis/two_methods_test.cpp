// One axis whose motion says little of some forces: prediction error and the balance of forces, and
// which of them answers. Simulated arms, and a real robot's joints to which a force was added.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::write_text;
using Json = nlohmann::json;

class TwoMethods : public testing::CommandRunner {
 protected:
  // One mass with a viscous friction, driven by a torque; its angle is measured.
  void write_axis(double inertia, double damping, bool is_even, const std::string& experiments) {
    write_text(folder_.file("axis.yaml"), fmt::format(R"(format: graybox-lumped/1
sample_time: 0.01
motion: rotation
masses: {{axis: {}}}
elements:
  - name: bearing
    location: {{kind: element, mass: axis}}
    law: viscous
    parameters: {{damping: {{value: {}, unit: N m s/rad}}}}
inputs:
  - {{name: torque, mass: axis}}
outputs:
  - {{name: angle, mass: axis, quantity: position}}
)",
                                                      inertia, damping));
    const std::string head =
        is_even ? "sample_time: 0.01\nhold: zero\n"
                : "sample_time: irregular\ntime: {column: t, unit: s}\nhold: first\n"
                  "preprocess:\n  - {kind: resample, sample_time: 0.01}\n";
    write_text(folder_.file("campaign.yaml"), "format: graybox-campaign/1\n" + head + R"(channels:
  - {name: torque, unit: N m, is: input}
  - {name: angle, unit: rad, is: output}
experiments:
)" + experiments);
  }

  [[nodiscard]] Json diagnosis(const std::string& options = {}) {
    const Outcome outcome = graybox("diagnose axis.yaml campaign.yaml --json " + options);
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    return Json::parse(outcome.out);
  }

  static const Json* law(const Json& verdict, const std::string& name) {
    for (const Json& effect : verdict["physics"]) {
      if (effect["law"] == name) return &effect;
    }
    return nullptr;
  }

  static void expect_near(const Json& effect, const std::string& parameter, double truth,
                          double errors) {
    const Json& found = effect["parameters"][parameter];
    EXPECT_NEAR(found["value"].get<double>(), truth, errors * found["standard_error"].get<double>())
        << parameter;
  }
};

// An arm that moves slowly: its weight and friction take all of the torque, and its inertia does
// not show. The next angles follow from the last ones, whatever pushes.
TEST_F(TwoMethods, TheBalanceTellsTheWeightOfAnArmThatMovesSlowly) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  std::ostringstream rows;
  rows << "torque,angle\n";
  std::vector<double> noise(8, 0.0);
  for (int k = 0; k < 3000; ++k) {
    const double t = 0.01 * k;
    const double q = -0.4 + 0.6 * std::sin(0.31 * t) + 0.12 * std::sin(0.93 * t + 1.0);
    const double v = 0.186 * std::cos(0.31 * t) + 0.1116 * std::cos(0.93 * t + 1.0);
    noise[static_cast<std::size_t>(k % 8)] = normal(random);
    double rest = 0.0;
    for (const double each : noise) rest += 0.028 * each;
    const double torque =
        0.5 * v + 0.33 * std::tanh(v / 0.01) + 1.7 * std::cos(q) + 0.2 * std::sin(q) + rest;
    rows << torque << ',' << 1e-4 * std::round(1e4 * q) << '\n';
  }
  write_text(folder_.file("log.csv"), rows.str());
  write_axis(1.0, 1.0, true,
             "  - {file: log.csv, segments: [[0, 1499]]}\n"
             "  - {file: log.csv, segments: [[1500, 2999]], role: validation}\n");
  const Json found = diagnosis();
  EXPECT_EQ(found["method"], "force_balance");
  ASSERT_NE(law(found, "gravity"), nullptr) << found["words"].dump(1);
  ASSERT_NE(law(found, "coulomb"), nullptr) << found["words"].dump(1);
  expect_near(*law(found, "gravity"), "cosine", 1.7, 4.0);
  expect_near(*law(found, "coulomb"), "level", 0.33, 4.0);
  EXPECT_EQ(law(found, "lag"), nullptr);
}

// Times, currents and angles of one joint of a real robot, a spring and dry friction added.
std::string joint_log(std::size_t joint, double spring, double level) {
  const std::string folder = std::getenv("GRAYBOX_RECORDINGS");
  std::ifstream file(folder + "/UR10e/ur-20_02_06-20sec_10harm.csv");
  std::ostringstream rows;
  rows.precision(10);
  rows << "t,torque,angle\n";
  std::string line;
  while (std::getline(file, line)) {
    std::vector<double> fields;
    std::istringstream text(line);
    for (std::string field; std::getline(text, field, ',');) fields.push_back(std::stod(field));
    const double q = fields[joint], v = fields[6 + joint];
    rows << fields[0] << ',' << fields[12 + joint] + spring * q + level * std::tanh(v / 1e-3) << ','
         << q << '\n';
  }
  return rows.str();
}

// Neither the joint's friction nor the spring lowers the error enough alone, for the inertia takes
// the spring's part.
TEST_F(TwoMethods, ASpringBesideRealFrictionIsTold) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
    GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  }
  write_text(folder_.file("log.csv"), joint_log(1, 1.0, 0.0));
  write_axis(1.0, 1.0, false,
             "  - {file: log.csv, segments: [[568, 1654]]}\n"
             "  - {file: log.csv, segments: [[1655, 2740]], role: validation}\n");
  const Json found = diagnosis("--method force_balance");
  ASSERT_NE(law(found, "coulomb"), nullptr) << found["words"].dump(1);
  ASSERT_NE(law(found, "stiffness"), nullptr) << found["words"].dump(1);
  expect_near(*law(found, "stiffness"), "stiffness", 1.0, 3.0);
}

// Where the inertia is small, dry friction and a drive that does not answer to small currents move
// a joint alike.
TEST_F(TwoMethods, RealFrictionIsNoDeadZoneOfTheDrive) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
    GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  }
  for (const double added : {0.0, 0.165}) {
    write_text(folder_.file("log.csv"), joint_log(6, 0.0, added));
    write_axis(0.06131, 1.034, false,
               "  - {file: log.csv, segments: [[720, 1730]]}\n"
               "  - {file: log.csv, segments: [[1731, 2740]], role: validation}\n");
    const Json found = diagnosis();
    ASSERT_NE(law(found, "coulomb"), nullptr) << found["words"].dump(1);
    EXPECT_NEAR((*law(found, "coulomb"))["parameters"]["level"]["value"].get<double>(),
                0.255 + added, 0.03);
    EXPECT_EQ(law(found, "dead_zone"), nullptr);
  }
}

// A circuit whose spring hardens, read in steps of 1 mV: a spring with a clearance is soft in its
// middle, too.
TEST_F(TwoMethods, ARealSpringThatHardensIsNoClearance) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
    GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  }
  constexpr Eigen::Index kFirst = 41000, kSamples = 8192;
  const RecordingFile file = read_recording_file(std::string(std::getenv("GRAYBOX_RECORDINGS")) +
                                                 "/Silverbox/SNLS80mV.mat");
  const Eigen::VectorXd input = file.at("V1").values, output = file.at("V2").values;
  std::ostringstream rows;
  rows.precision(9);
  rows << "torque,angle\n";
  for (Eigen::Index k = kFirst; k < kFirst + kSamples; ++k) {
    rows << input(k) << ',' << 1e-3 * std::round(1e3 * output(k)) << '\n';
  }
  write_text(folder_.file("log.csv"), rows.str());
  write_axis(4.789e-6, 9.58e-4, true,
             "  - {file: log.csv, segments: [[0, 4095]]}\n"
             "  - {file: log.csv, segments: [[4096, 8191]], role: validation}\n");
  // In volts, as newtons and metres.
  const std::vector<std::pair<std::string, std::string>> changes{
      {"sample_time: 0.01\n", "sample_time: 0.0016384\n"},
      {"motion: rotation", "motion: translation"},
      {"unit: N m s/rad", "unit: N s/m"},
      {"unit: N m,", "unit: N,"},
      {"unit: rad,", "unit: m,"}};
  for (const char* name : {"axis.yaml", "campaign.yaml"}) {
    std::string text = testing::read_text(folder_.file(name));
    for (const auto& [from, to] : changes) {
      const std::size_t at = text.find(from);
      if (at != std::string::npos) text.replace(at, from.size(), to);
    }
    write_text(folder_.file(name), text);
  }
  const Json found = diagnosis("--method prediction_error");
  ASSERT_NE(law(found, "cubic_spring"), nullptr) << found["words"].dump(1);
  ASSERT_NE(law(found, "stiffness"), nullptr) << found["words"].dump(1);
  EXPECT_NEAR((*law(found, "cubic_spring"))["parameters"]["stiffness"]["value"].get<double>(), 3.9,
              0.2);
  EXPECT_EQ(law(found, "dead_zone"), nullptr);
}

// An arm that turns there and back at one speed: damping and dry friction are one number. Friction
// that is larger while it starts asks for a damping below zero, which no bearing has.
TEST_F(TwoMethods, DampingBesideDryFrictionIsNeverBelowZero) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::ostringstream rows;
  rows << "torque,angle\n";
  constexpr double kStep = 0.01, kWay = 2.0 * 3.14159265358979 / 14.0;
  double q = -1.2;
  for (int k = 0; k < 4200; ++k) {
    const double bent = std::tanh(12.0 * std::sin(kWay * k * kStep));
    const double v = 0.35 * bent;
    const double a = 0.35 * (1.0 - bent * bent) * 12.0 * kWay * std::cos(kWay * k * kStep);
    const double friction = std::copysign(13.0 + 4.0 * std::exp(-std::abs(v) / 0.1), v);
    rows << a + friction + 38.0 * std::sin(q) + 0.4 * normal(random) << ','
         << q + 1e-5 * normal(random) << '\n';
    q += kStep * v;
  }
  write_text(folder_.file("log.csv"), rows.str());
  write_axis(1.0, 1.0, true,
             "  - {file: log.csv, segments: [[0, 1399], [2800, 4199]]}\n"
             "  - {file: log.csv, segments: [[1400, 2799]], role: validation}\n");
  const Json found = diagnosis("--method force_balance");
  for (const Json& parameter : found["parameters"]) {
    EXPECT_GE(parameter["after"].get<double>(), 0.0) << parameter["name"];
  }
  ASSERT_NE(law(found, "coulomb"), nullptr) << found["words"].dump(1);
  EXPECT_NEAR((*law(found, "coulomb"))["parameters"]["level"]["value"].get<double>(), 13.1, 0.5);
  EXPECT_NE(found["words"].dump().find("bearing.damping was held at zero"), std::string::npos)
      << found["words"].dump(1);
}

}  // namespace
}  // namespace graybox
