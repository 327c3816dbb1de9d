// Diagnoses by prediction error of machines in free motion, of imposed motions with hysteresis, and
// of delays that may be at either end.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

void write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file) << text;
}

std::string channel(const char* name, const char* unit, const char* role) {
  return fmt::format("  - {{name: {0}, column: {0}, unit: {1}, is: {2}}}\n", name, unit, role);
}

// The log a.csv in the fit and b.csv kept out, with held inputs.
void write_campaign(const testing::TemporaryFolder& folder, const char* sample_time,
                    const std::string& channels) {
  write(folder.file("campaign.yaml"),
        fmt::format("format: graybox-campaign/1\nsample_time: {}\nchannels:\n{}hold: zero\n"
                    "experiments:\n  - file: a.csv\n  - {{file: b.csv, role: validation}}\n",
                    sample_time, channels));
}

PredictionDiagnosis diagnosis_in(const testing::TemporaryFolder& folder) {
  return diagnose_by_prediction(folder.file("model.yaml"),
                                read_campaign(folder.file("campaign.yaml")), {}, 2);
}

const FoundEffect* effect_of(const PredictionDiagnosis& result, const std::string& law) {
  for (const FoundEffect& effect : result.diagnosis.effects) {
    if (result.hypotheses[effect.law.hypothesis].law == law) return &effect;
  }
  return nullptr;
}

double parameter(const FoundEffect& effect, const std::string& name) {
  for (const LawParameterEstimate& each : effect.law.parameters) {
    if (each.name == name) return each.value;
  }
  return std::nan("");
}

constexpr double kWeight = 20.0;  // N m, of a pendulum of 1 kg m^2

// J q'' = -0.05 q' - 20 sin q, by Runge and Kutta; angle noise of 1e-4 rad.
std::string free_swing(double start, unsigned seed, bool with_column) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0.0, 1e-4);
  std::string text = with_column ? "t,torque,angle\n" : "t,angle\n";
  double q = start, v = 0.0;
  constexpr double kStep = 1e-3;
  const auto pull = [](double at, double rate) { return -0.05 * rate - kWeight * std::sin(at); };
  for (int k = 0; k < 8000; ++k) {
    if (k % 10 == 0) {
      text +=
          fmt::format("{:.2f}{},{:.9g}\n", kStep * k, with_column ? ",0" : "", q + noise(engine));
    }
    const double a1 = pull(q, v), a2 = pull(q + 0.5 * kStep * v, v + 0.5 * kStep * a1);
    const double a3 = pull(q + 0.5 * kStep * (v + 0.5 * kStep * a1), v + 0.5 * kStep * a2);
    const double a4 = pull(q + kStep * (v + 0.5 * kStep * a2), v + kStep * a3);
    q += kStep * (v + kStep * (a1 + a2 + a3) / 6.0);
    v += kStep * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0;
  }
  return text;
}

class FreeSwing : public ::testing::TestWithParam<bool> {};  // with a drive that is zero throughout

TEST_P(FreeSwing, TellsTheWeightRelativeToTheInertia) {
  const testing::TemporaryFolder folder;
  write(folder.file("a.csv"), free_swing(1.6, 1, GetParam()));
  write(folder.file("b.csv"), free_swing(1.2, 2, GetParam()));
  const std::string input = "inputs:\n  - {name: torque, mass: arm}\n";
  const std::string torque = channel("torque", "N m", "input");
  write(folder.file("model.yaml"),
        "format: graybox-lumped/1\nsample_time: 0.01\nmotion: rotation\nmasses: {arm: 1}\n"
        "elements:\n  - {name: bearing, location: {kind: element, mass: arm}, law: viscous, "
        "parameters: {damping: {value: 0.1, unit: N m s/rad}}}\n" +
            (GetParam() ? input : std::string()) +
            "outputs:\n  - {name: angle, mass: arm, quantity: position}\n");
  write_campaign(folder, "0.01",
                 (GetParam() ? torque : std::string()) + channel("angle", "rad", "output"));
  const PredictionDiagnosis result = diagnosis_in(folder);
  ASSERT_EQ(result.diagnosis.assumptions.size(), 1U);
  EXPECT_NE(result.diagnosis.assumptions.front().find("arm.inertia was held at 1 kg m^2"),
            std::string::npos);
  const FoundEffect* gravity = effect_of(result, "gravity");
  ASSERT_NE(gravity, nullptr);
  EXPECT_NEAR(parameter(*gravity, "sine"), kWeight, 0.02 * kWeight);
  EXPECT_LT(result.diagnosis.validation_after.value().nrmse, 2.0);
}

INSTANTIATE_TEST_SUITE_P(OfAPendulum, FreeSwing, ::testing::Bool());

// m v' = -friction - drag v^2 of a drum that coasts, read as a speed alone, in any unit: from where
// it is let go to where it still turns.
std::string run_down(double friction, double drag, double unit, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0.0, 2e-3);
  std::string text = "t,speed\n";
  double v = 9.0;
  for (int k = 0; v > 1.5; ++k) {
    if (k % 100 == 0) text += fmt::format("{:.1f},{:.9g}\n", 0.01 * k, unit * (v + noise(engine)));
    v -= 0.01 * (friction + drag * v * v);
  }
  return text;
}

PredictionDiagnosis diagnosis_of_run_down(double unit) {
  const testing::TemporaryFolder folder;
  write(folder.file("a.csv"), run_down(0.05, 2e-3, unit, 1));
  write(folder.file("b.csv"), run_down(0.05, 2e-3, unit, 2));
  write(folder.file("model.yaml"),
        "format: graybox-lumped/1\nsample_time: 1\nmotion: translation\nmasses: {drum: 1}\n"
        "elements:\n  - {name: bearing, location: {kind: element, mass: drum}, law: viscous, "
        "parameters: {damping: {value: 0.01, unit: N s/m}}}\n"
        "outputs:\n  - {name: speed, mass: drum, quantity: velocity}\n");
  write_campaign(folder, "1", channel("speed", "m/s", "output"));
  return diagnosis_in(folder);
}

// No spring pulls at what goes on and on; friction and drag, which one by one bend the wrong way,
// are found together, whatever the unit of the speed.
TEST(RunDowns, TellFrictionAndDragTogetherInAnyUnit) {
  for (const double unit : {1.0, 100.0}) {
    const PredictionDiagnosis result = diagnosis_of_run_down(unit);
    const FoundEffect* friction = effect_of(result, "coulomb");
    const FoundEffect* drag = effect_of(result, "quadratic_drag");
    ASSERT_NE(friction, nullptr) << unit;
    ASSERT_NE(drag, nullptr) << unit;
    EXPECT_NEAR(parameter(*friction, "level"), 0.05 * unit, 0.005 * unit);
    EXPECT_NEAR(parameter(*drag, "coefficient"), 2e-3 / unit, 4e-4 / unit);
    for (const FoundEffect& effect : result.diagnosis.effects) {
      for (const std::vector<Rival>* others : {&effect.rivals, &effect.excluded}) {
        for (const Rival& other : *others) {
          const std::string& law = result.hypotheses[other.law.hypothesis].law;
          EXPECT_EQ(law.find("spring"), std::string::npos);
          EXPECT_NE(law, "stiffness");
          EXPECT_NE(law, "dead_zone");
        }
      }
    }
  }
}

// J q'' = torque - 0.02 q' - 6 sin q with q from where it hangs, swung up by a torque that pumps.
std::string swing_up(unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0.0, 1e-3), draw(0.0, 0.6);
  std::string text = "t,torque,angle\n";
  double q = 0.3, v = 0.0, torque = 0.0;
  constexpr double kInertia = 0.3, kStep = 1e-3;
  for (int k = 0; k < 3000; ++k) {
    if (k % 10 == 0) {
      torque = (std::abs(q) < 1.8 ? 1.5 : -0.5) * (v > 0.0 ? 1.0 : -1.0) + draw(engine);
      text += fmt::format("{:.2f},{:.9g},{:.9g}\n", kStep * k, torque, q + noise(engine));
    }
    v += kStep / kInertia * (torque - 0.02 * v - 6.0 * std::sin(q));
    q += kStep * v;
  }
  return text;
}

PredictionDiagnosis diagnosis_of_swing_up(const SearchOptions& options) {
  const testing::TemporaryFolder folder;
  write(folder.file("a.csv"), swing_up(1));
  write(folder.file("b.csv"), swing_up(2));
  write(folder.file("model.yaml"),
        "format: graybox-lumped/1\nsample_time: 0.01\nmotion: rotation\nmasses: {arm: 0.4}\n"
        "elements:\n  - {name: bearing, location: {kind: element, mass: arm}, law: viscous, "
        "parameters: {damping: {value: 0.1, unit: N m s/rad}}}\n"
        "inputs:\n  - {name: torque, mass: arm}\n"
        "outputs:\n  - {name: angle, mass: arm, quantity: position}\n");
  write_campaign(folder, "0.01",
                 channel("torque", "N m", "input") + channel("angle", "rad", "output"));
  return diagnose_by_prediction(folder.file("model.yaml"),
                                read_campaign(folder.file("campaign.yaml")), options, 2);
}

// A weight, and no spring, wherever the angle is counted from; without the law nobody says that
// nothing is missing.
TEST(Pendulums, HaveAWeightAndNoSpring) {
  const PredictionDiagnosis result = diagnosis_of_swing_up({});
  const FoundEffect* weight = effect_of(result, "gravity");
  ASSERT_NE(weight, nullptr);
  EXPECT_NEAR(parameter(*weight, "sine"), 6.0, 0.6);
  EXPECT_EQ(effect_of(result, "stiffness"), nullptr);
  SearchOptions options;
  options.excluded_laws = {"gravity", "stiffness", "cubic_spring", "dead_zone", "ripple"};
  EXPECT_NE(diagnosis_of_swing_up(options).diagnosis.verdict, Verdict::kNone);
}

// f = k x + 60 z with the Bouc-Wen x of k 2000, yield 0.004, exponent 1.5, shape 0.6.
std::string hysteresis(double amplitude, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::string text = "t,angle,torque\n";
  constexpr double kStep = 1e-4;
  double x = 0.0;
  const auto angle = [&](double t) {
    return amplitude * (std::sin(6.0 * t) + 0.4 * std::sin(17.0 * t));
  };
  const auto rate = [&](double t, double at) {
    const double speed = amplitude * (6.0 * std::cos(6.0 * t) + 6.8 * std::cos(17.0 * t));
    const double sign = speed * at > 0.0 ? 1.0 : -1.0;
    return speed * (1.0 - std::pow(std::abs(at) / 0.004, 1.5) * (0.6 * sign + 0.4));
  };
  for (int k = 0; k < 60000; ++k) {
    const double t = kStep * k;
    if (k % 20 == 0) {
      text += fmt::format("{:.3f},{:.9g},{:.9g}\n", t, angle(t),
                          2000.0 * x + 60.0 * angle(t) + noise(engine));
    }
    const double middle = x + 0.5 * kStep * rate(t, x);
    x += kStep * rate(t + 0.5 * kStep, middle);
  }
  return text;
}

TEST(ImposedMotion, ShowsABoucWenSpring) {
  const testing::TemporaryFolder folder;
  write(folder.file("a.csv"), hysteresis(0.004, 1));
  write(folder.file("b.csv"), hysteresis(0.012, 2));
  write(folder.file("c.csv"), hysteresis(0.008, 3));
  write(folder.file("model.yaml"),
        "format: graybox-lumped/1\nsample_time: 0.002\nmotion: rotation\nmasses: {arm: 0}\n"
        "elements:\n  - {name: spring, location: {kind: element, mass: arm}, law: stiffness, "
        "parameters: {stiffness: {value: 500, unit: N m/rad}}}\n"
        "inputs:\n  - {name: angle, mass: arm, quantity: position}\n"
        "outputs:\n  - {name: torque, mass: arm, quantity: force}\n");
  write(folder.file("campaign.yaml"),
        "format: graybox-campaign/1\nsample_time: 0.002\nchannels:\n"
        "  - {name: angle, column: angle, unit: rad, is: input}\n"
        "  - {name: torque, column: torque, unit: N m, is: output}\nhold: first\n"
        "experiments:\n  - file: a.csv\n  - file: b.csv\n  - {file: c.csv, role: validation}\n");
  const PredictionDiagnosis result = diagnosis_in(folder);
  const FoundEffect* spring = effect_of(result, "bouc_wen");
  ASSERT_NE(spring, nullptr);
  EXPECT_NEAR(parameter(*spring, "stiffness"), 2000.0, 60.0);
  EXPECT_NEAR(parameter(*spring, "yield"), 0.004, 1e-4);
  EXPECT_NEAR(parameter(*spring, "exponent"), 1.5, 0.15);
  EXPECT_LT(result.diagnosis.validation_after.value().nrmse, 2.0);
}

// A mass on a spring whose position is read 25 ms late.
std::string late_oscillator(unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0.0, 1e-5), draw(0.0, 10.0);
  std::string text = "t,force,position\n";
  std::vector<double> past(6, 0.0);  // of 5 ms steps
  double q = 0.0, v = 0.0, force = 0.0;
  for (int k = 0; k < 3000; ++k) {
    if (k % 12 == 0) force = draw(engine);
    if (k % 2 == 0) {
      text += fmt::format("{:.2f},{:.9g},{:.9g}\n", 0.005 * k, force, past.back() + noise(engine));
    }
    constexpr int kParts = 50;
    for (int part = 0; part < kParts; ++part) {
      v += 0.005 / kParts * (force - 40.0 * q - 1.0 * v);
      q += 0.005 / kParts * v;
    }
    past.insert(past.begin(), q);
    past.pop_back();
  }
  return text;
}

TEST(OneDriveAndOneSensor, TellADelayButNotWhere) {
  const testing::TemporaryFolder folder;
  write(folder.file("a.csv"), late_oscillator(1));
  write(folder.file("b.csv"), late_oscillator(2));
  write(folder.file("model.yaml"),
        "format: graybox-lumped/1\nsample_time: 0.01\nmotion: translation\nmasses: {cart: 1.2}\n"
        "elements:\n  - {name: spring, location: {kind: element, mass: cart}, law: stiffness, "
        "parameters: {stiffness: {value: 45, unit: N/m}}}\n"
        "  - {name: damper, location: {kind: element, mass: cart}, law: viscous, "
        "parameters: {damping: {value: 1.5, unit: N s/m}}}\n"
        "inputs:\n  - {name: force, mass: cart}\n"
        "outputs:\n  - {name: position, mass: cart, quantity: position}\n");
  write_campaign(folder, "0.01",
                 channel("force", "N", "input") + channel("position", "m", "output"));
  const PredictionDiagnosis result = diagnosis_in(folder);
  const FoundEffect* delay = effect_of(result, "delay");
  ASSERT_NE(delay, nullptr);
  EXPECT_NEAR(parameter(*delay, "time"), 0.025, 0.003);
  ASSERT_EQ(delay->same_at.size(), 1U);
  const auto place_of = [&](const FittedLaw& law) {
    return result.hypotheses[law.hypothesis].place;
  };
  EXPECT_NE(place_of(delay->law), place_of(delay->same_at.front()));
  for (const Rival& rival : delay->excluded) {
    EXPECT_NE(result.hypotheses[rival.law.hypothesis].law, "delay");
  }
}

}  // namespace
}  // namespace graybox
