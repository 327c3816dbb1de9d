// Logs so short that a part of them does not show what the whole does, and logs of speeds alone.
// The machines are a pendulum, J q'' = u - b q' - g sin q, and axes with dry friction that sticks.
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
    write_campaign("fall.csv", "driven.csv", channel, unit);
  }
  void write_campaign(const std::string& fitted, const std::string& kept_out,
                      const std::string& channel, const std::string& unit) {
    write_text(folder_.file("campaign.yaml"), fmt::format(R"(format: graybox-campaign/1
sample_time: 0.004
channels:
  - {{name: torque, unit: N m, is: input}}
  - {{name: {}, unit: {}, is: output}}
experiments:
  - {{file: {}}}
  - {{file: {}, role: validation}}
)",
                                                          channel, unit, fitted, kept_out));
  }
  [[nodiscard]] Json diagnosis() {
    const Outcome outcome = graybox("diagnose axis.yaml campaign.yaml --json");
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    return Json::parse(outcome.out);
  }
  // The diagnosis of a free fall, with a driven motion of so many samples kept out: the weight and
  // nothing else. The recorded torque has noise that the machine never felt, so a log this short
  // gives the weight to a twentieth.
  [[nodiscard]] Json weight_beside_driven_motion(int samples) {
    write_run("fall.csv", {1.84, 0.0, 0.0}, 100, 1);
    write_run("driven.csv", {0.6, 3.5, 0.1}, samples, 2);
    write_files("angle", "position", "rad");
    Json found = diagnosis();
    EXPECT_EQ(found["physics"].size(), 1U) << found["words"].dump(1);
    EXPECT_EQ(found["physics"].at(0)["law"], "gravity");
    EXPECT_NEAR(found["physics"].at(0)["parameters"]["sine"]["value"].get<double>(), kWeight,
                0.1 * kWeight);
    return found;
  }
};

// A free fall does not tell weight from inertia, which the driven motion kept out does. What that
// one shows is tested on the fall: which of the two is named first makes no difference.
TEST_F(ShortLog, RecordingsChangePlacesWhereThoseOfTheFitShowNoLaw) {
  const Json found = weight_beside_driven_motion(100);
  EXPECT_NE(found["words"].dump().find("the two changed places"), std::string::npos)
      << found["words"].dump(1);
  write_campaign("driven.csv", "fall.csv", "angle", "rad");
  const Json other = diagnosis();
  EXPECT_EQ(other["physics"], found["physics"]);
  EXPECT_EQ(other["verdict"], found["verdict"]);
  EXPECT_EQ(other["words"].dump().find("changed places"), std::string::npos);
}

// Twenty samples kept out are too few to be searched by themselves, which is no fault of theirs.
TEST_F(ShortLog, RecordingsTooShortToBeSearchedDoNotChangePlaces) {
  write_run("fall.csv", {1.84, 0.0, 0.0}, 100, 1);
  write_run("driven.csv", {0.6, 3.5, 0.1}, 20, 2);
  write_files("angle", "position", "rad");
  const Json found = diagnosis();
  EXPECT_TRUE(found.contains("verdict"));
  EXPECT_EQ(found["words"].dump().find("changed places"), std::string::npos);
}

// A driven motion of 40 samples shows no weight by itself either. With both in the fit it is found,
// and nothing has tested it.
TEST_F(ShortLog, AllRecordingsAreFittedWhereNeitherPartShowsALaw) {
  const Json found = weight_beside_driven_motion(40);
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

// m v' = u + off - b v - c sign v, which sticks where the rest is below c.
struct StickingAxis {
  double mass = 1.0, damping = 0.0, level = 0.0, offset = 0.0;
  double x = 0.0, v = 0.0;

  void advance(double u, double step) {
    constexpr int kSteps = 20;
    const double h = step / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double push = u + offset - damping * v;
      if (v == 0.0 && std::abs(push) <= level) continue;
      const double way = v != 0.0 ? std::copysign(1.0, v) : std::copysign(1.0, push);
      const double next = v + h * (push - level * way) / mass;
      v = v != 0.0 && next * v < 0.0 ? 0.0 : next;
      x += h * v;
    }
  }
};

class StickingLog : public testing::CommandRunner {
 protected:
  void write_model(double mass, double damping, double step, const std::string& experiments) {
    write_text(folder_.file("axis.yaml"), fmt::format(R"(format: graybox-lumped/1
sample_time: {}
motion: translation
masses: {{axis: {}}}
elements:
  - name: bearing
    location: {{kind: element, mass: axis}}
    law: viscous
    parameters: {{damping: {{value: {}, unit: N s/m}}}}
inputs:
  - {{name: force, mass: axis}}
outputs:
  - {{name: position, mass: axis, quantity: position}}
)",
                                                      step, mass, damping));
    write_text(folder_.file("campaign.yaml"), fmt::format(R"(format: graybox-campaign/1
sample_time: {}
channels:
  - {{name: force, unit: N, is: input}}
  - {{name: position, unit: m, is: output}}
experiments:
{})",
                                                          step, experiments));
  }
  [[nodiscard]] Json diagnosis() {
    const Outcome outcome =
        graybox("diagnose axis.yaml campaign.yaml --method prediction_error --json");
    EXPECT_LE(outcome.exit_code, 1) << outcome.err;
    return Json::parse(outcome.out);
  }
  static void expect_size(const Json& found, const std::string& law, const std::string& parameter,
                          double truth, double share) {
    for (const Json& effect : found["physics"]) {
      if (effect["law"] != law) continue;
      EXPECT_NEAR(effect["parameters"][parameter]["value"].get<double>(), truth, share * truth);
      return;
    }
    ADD_FAILURE() << "no " << law << found["words"].dump(1);
  }
};

// A linear axis steps there and back by its position loop. Over short windows a disturbance passes
// for its friction and its constant force; over the whole recording nothing else does, and the
// recording kept out confirms both.
TEST_F(StickingLog, WholeRecordingsTellWhatShortWindowsDoNot) {
  StickingAxis axis{
      .mass = 1950.0, .damping = 16100.0, .level = 450.0, .offset = -120.0, .x = -0.005};
  std::ostringstream rows;
  rows.precision(9);
  rows << "force,position\n";
  for (int k = 0; k < 350; ++k) {
    const double wanted = k / 50 % 2 == 0 ? 0.005 : -0.005;
    const double measured = 1e-5 * std::round(1e5 * axis.x);
    const double force = std::clamp(4e5 * (wanted - measured), -3200.0, 3200.0);
    rows << force << ',' << measured << '\n';
    axis.advance(force, 0.01);
  }
  write_text(folder_.file("steps.csv"), rows.str());
  write_model(1900.0, 19000.0, 0.01,
              "  - {file: steps.csv, segments: [[0, 174]]}\n"
              "  - {file: steps.csv, segments: [[175, 349]], role: validation}\n");
  const Json found = diagnosis();
  EXPECT_EQ(found["physics"].size(), 2U) << found["words"].dump(1);
  expect_size(found, "coulomb", "level", 450.0, 0.1);
  expect_size(found, "offset", "value", 120.0, 0.1);
  EXPECT_NE(found["verdict"], "unknown");  // a richer friction may be named beside
}

// In motion one way a constant force is dry friction, and the motion kept out goes the other way.
TEST_F(StickingLog, TheRivalThatHoldsWhereKeptOutIsTaken) {
  for (const double way : {1.0, -1.0}) {
    StickingAxis axis{.mass = 0.018, .damping = 0.09, .level = 0.17};
    std::ostringstream rows;
    rows.precision(9);
    rows << "force,position\n";
    for (int k = 0; k < 150; ++k) {
      const double turn = 2.0 * std::numbers::pi * 0.02 * k;
      const double force = way * (0.55 + 0.25 * std::sin(turn / 0.9) + 0.1 * std::sin(turn / 0.37));
      rows << force << ',' << 0.002 * std::round(500.0 * axis.x) << '\n';
      axis.advance(force, 0.02);
    }
    write_text(folder_.file(way > 0.0 ? "up.csv" : "down.csv"), rows.str());
  }
  write_model(0.017, 0.1, 0.02, "  - {file: up.csv}\n  - {file: down.csv, role: validation}\n");
  const Json found = diagnosis();
  EXPECT_EQ(found["physics"].size(), 1U) << found["words"].dump(1);
  expect_size(found, "coulomb", "level", 0.17, 0.05);
}

// A bar that was bent and let go: m x'' = -k (x - rest) - b x', and nothing drives it.
class ReleasedLog : public StickingLog {
 protected:
  static constexpr double kStiffness = 400.0;
  void write_release(double rest, const std::string& file, double amplitude, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::ostringstream rows;
    rows.precision(9);
    rows << "force,position\n";
    double x = amplitude, v = 0.0;
    for (int k = 0; k < 120; ++k) {
      rows << "0," << rest + x + 2e-4 * normal(random) << '\n';
      constexpr int kSteps = 100;
      for (int i = 0; i < kSteps; ++i) {
        v += 0.03 / kSteps * (-kStiffness * x - 3.0 * v);
        x += 0.03 / kSteps * v;
      }
    }
    write_text(folder_.file(file), rows.str());
  }
};

// Wherever the sensor has its zero, it is one spring, and the zero is told.
TEST_F(ReleasedLog, ASpringIsFoundWhereverItRests) {
  write_model(1.0, 0.01, 0.03, "  - {file: one.csv}\n  - {file: two.csv, role: validation}\n");
  for (const double rest : {0.0, 0.0005, 0.014, -0.2}) {
    write_release(rest, "one.csv", 0.07, 1);
    write_release(rest, "two.csv", 0.05, 2);
    const Json found = diagnosis();
    expect_size(found, "stiffness", "stiffness", kStiffness, 0.03);
    for (const Json& effect : found["physics"]) {
      EXPECT_TRUE(effect["law"] == "stiffness" || effect["law"] == "offset")
          << rest << effect["law"];
    }
    if (std::abs(rest) < 0.001) continue;
    const std::string words = found["words"].dump();
    const std::size_t at = words.find("it rests at ");
    ASSERT_NE(at, std::string::npos) << rest << found["words"].dump(1);
    EXPECT_NEAR(std::stod(words.substr(at + 12)), rest, 3e-4);
  }
}

// Nothing is missing, and what was kept out shows it. Without that nobody knows.
TEST_F(StickingLog, NothingIsCalledMissingOnlyWhereSomethingTestedIt) {
  for (const char* const file : {"one.csv", "two.csv"}) {
    StickingAxis axis{.mass = 1.0, .damping = 2.0};
    std::mt19937_64 random(static_cast<unsigned char>(file[0]));
    std::normal_distribution<double> normal;
    std::ostringstream rows;
    rows << "force,position\n";
    for (int k = 0; k < 300; ++k) {
      const double force = 3.0 * std::sin(0.11 * k) + 2.0 * std::sin(0.037 * k * (1 + file[0] % 3));
      rows << force << ',' << axis.x + 1e-4 * normal(random) << '\n';
      axis.advance(force, 0.02);
    }
    write_text(folder_.file(file), rows.str());
  }
  write_model(0.9, 2.2, 0.02, "  - {file: one.csv}\n  - {file: two.csv, role: validation}\n");
  EXPECT_EQ(diagnosis()["verdict"], "none");
  write_model(0.9, 2.2, 0.02, "  - {file: one.csv}\n  - {file: two.csv}\n");
  const Json untested = diagnosis();
  EXPECT_EQ(untested["verdict"], "unknown");
  EXPECT_NE(untested["words"].dump().find("no recordings were kept out to test that"),
            std::string::npos)
      << untested["words"].dump(1);
}

// An arm that swings slowly against a spring and sticks at each end, its torque counted the other
// way. Counted the right way nothing is said of the sign.
TEST_F(StickingLog, DryFrictionTellsADriveThatCountsTheOtherWay) {
  for (const double sign : {1.0, -1.0}) {
    std::ostringstream rows;
    rows.precision(9);
    rows << "force,position\n";
    StickingAxis axis{.mass = 2.0, .damping = 1.0, .level = 12.0};
    for (int k = 0; k < 800; ++k) {
      const double force = 20.0 * std::sin(0.02 * k);
      rows << sign * force << ',' << 1e-4 * std::round(1e4 * axis.x) << '\n';
      axis.offset = -40.0 * axis.x;
      axis.advance(force, 0.03);
    }
    write_text(folder_.file("swing.csv"), rows.str());
    write_model(5.0, 20.0, 0.03,
                "  - {file: swing.csv, segments: [[0, 399]]}\n"
                "  - {file: swing.csv, segments: [[400, 799]], role: validation}\n");
    const Outcome outcome = graybox("diagnose axis.yaml campaign.yaml --json");
    const Json found = Json::parse(outcome.out);
    if (sign > 0.0) {
      EXPECT_TRUE(found["channel_faults"].empty()) << found["channel_faults"].dump(1);
      expect_size(found, "coulomb", "level", 12.0, 0.1);
      continue;
    }
    EXPECT_EQ(found["verdict"], "unknown");
    ASSERT_EQ(found["channel_faults"].size(), 1U) << found["words"].dump(1);
    EXPECT_NE(found["channel_faults"].dump().find("wrong sign, or "), std::string::npos);
  }
}

}  // namespace
}  // namespace graybox
