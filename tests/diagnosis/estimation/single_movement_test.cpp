// Diagnoses of logs in which a machine moves once, or one way: what falls and comes to rest, what
// is started with a drive that is counted the other way, and drives whose gain bends.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

// An axis on a bearing, with a drive or none, that is measured.
void write_axis(const testing::TemporaryFolder& folder, double sample_time, double inertia,
                double damping, bool is_driven, bool is_velocity) {
  testing::write_text(
      folder.file("axis.yaml"),
      fmt::format("format: graybox-lumped/1\nsample_time: {}\nmotion: rotation\nmasses: {{axis: "
                  "{}}}\nelements:\n  - {{name: bearing, location: {{kind: element, mass: axis}}, "
                  "law: viscous, parameters: {{damping: {{value: {}, unit: N m s/rad}}}}}}\n{}"
                  "outputs:\n  - {{name: motion, mass: axis, quantity: {}}}\n",
                  sample_time, inertia, damping,
                  is_driven ? "inputs:\n  - {name: torque, mass: axis}\n" : "",
                  is_velocity ? "velocity" : "position"));
  testing::write_text(
      folder.file("campaign.yaml"),
      fmt::format("format: graybox-campaign/1\nsample_time: {}\nchannels:\n{}"
                  "  - {{name: motion, unit: {}, is: output}}\nhold: zero\nexperiments:\n"
                  "  - {{file: a.csv}}\n  - {{file: b.csv, role: validation}}\n",
                  sample_time, is_driven ? "  - {name: torque, unit: N m, is: input}\n" : "",
                  is_velocity ? "rad/s" : "rad"));
}

PredictionDiagnosis diagnosis_in(const testing::TemporaryFolder& folder) {
  return diagnose_by_prediction(folder.file("axis.yaml"),
                                read_campaign(folder.file("campaign.yaml")), {}, 1);
}

std::vector<std::string> laws_of(const PredictionDiagnosis& result) {
  std::vector<std::string> laws;
  for (const FoundEffect& effect : result.diagnosis.effects) {
    laws.push_back(result.hypotheses[effect.law.hypothesis].law);
  }
  std::ranges::sort(laws);
  return laws;
}

// A pendulum of J = 1 kg m^2 that is let go `start` from hanging, with a weight of 15 N m and dry
// friction of 8 N m, which holds it before it hangs. Noise of an encoder.
std::string fall(double start, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1e-3);
  std::string text = "motion\n";
  double angle = start, speed = 0.0;
  for (int k = 0; k < 120; ++k) {
    text += fmt::format("{:.6f}\n", angle + noise(random));
    for (int step = 0; step < 160; ++step) {
      const double pull = -15.0 * std::sin(angle);
      if (speed == 0.0 && std::abs(pull) <= 8.0) continue;
      const double direction = speed == 0.0 ? std::copysign(1.0, pull) : std::copysign(1.0, speed);
      const double next = speed + 1e-4 * (pull - 8.0 * direction);
      speed = next * direction < 0.0 ? 0.0 : next;
      angle += 1e-4 * speed;
    }
  }
  return text;
}

TEST(SingleMovements, OfWhatFallsAndStaysTellWeightAndDryFriction) {
  const testing::TemporaryFolder folder;
  write_axis(folder, 0.016, 1.0, 0.01, false, false);
  testing::write_text(folder.file("a.csv"), fall(1.8, 1));
  testing::write_text(folder.file("b.csv"), fall(1.5, 2));
  const PredictionDiagnosis result = diagnosis_in(folder);
  EXPECT_EQ(laws_of(result), (std::vector<std::string>{"coulomb", "gravity"}));
  for (const FoundEffect& effect : result.diagnosis.effects) {
    const LawParameterEstimate& size = effect.law.parameters[0];
    const double truth = result.hypotheses[effect.law.hypothesis].law == "coulomb" ? 8.0 : 15.0;
    // The damping, which is zero, takes some of both.
    EXPECT_NEAR(size.value, truth, std::max(0.2 * truth, 3.0 * size.standard_error));
  }
}

// A mass that is held, because nothing tells it, is no parameter of the fit.
TEST(SingleMovements, SayWhichParameterMovedFar) {
  const testing::TemporaryFolder folder;
  write_axis(folder, 0.02, 1.0, 0.01, false, true);
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.01);
  for (const char* name : {"a.csv", "b.csv"}) {
    std::string text = "motion\n";
    for (int k = 0; k < 150; ++k) {
      text += fmt::format("{:.6f}\n", 5.0 * std::exp(-0.02 * k) + noise(random));
    }
    testing::write_text(folder.file(name), text);
  }
  const PredictionDiagnosis result = diagnosis_in(folder);
  const auto says = [&](const char* words) {
    return std::ranges::any_of(result.diagnosis.assumptions, [&](const std::string& line) {
      return line.find(words) != std::string::npos;
    });
  };
  EXPECT_TRUE(says("axis.inertia was held at 1 kg m^2"));
  EXPECT_TRUE(says("moved far from what the model states: bearing.damping from 0.01 to 1"));
}

// The motion of what nothing drives is the same motion later.
TEST(SingleMovements, WithoutADriveHaveNoLateSensor) {
  const testing::TemporaryFolder folder;
  for (const bool is_driven : {false, true}) {
    write_axis(folder, 0.016, 1.0, 0.01, is_driven, false);
    testing::write_text(folder.file("a.csv"), fall(1.8, 1));
    testing::write_text(folder.file("b.csv"), fall(1.5, 2));
    if (is_driven) {
      for (const char* name : {"a.csv", "b.csv"}) {
        std::string text = "torque,motion\n", line;
        std::istringstream rows(testing::read_text(folder.file(name)));
        std::getline(rows, line);
        for (int k = 0; std::getline(rows, line); ++k) text += fmt::format("{},{}\n", k % 2, line);
        testing::write_text(folder.file(name), text);
      }
    }
    const LumpedModel model = load_lumped_model(folder.file("axis.yaml"));
    const PredictionData data(model, read_campaign(folder.file("campaign.yaml")), 1);
    const PredictionHypotheses list(model, data, {});
    Eigen::MatrixXd motion(100, 2);
    motion.col(0) = Eigen::VectorXd::LinSpaced(100, 0.0, 1.0);
    motion.col(1) = Eigen::VectorXd::LinSpaced(100, -1.0, 1.0);
    const auto is_late = [](const LawExtension& law) {
      return law.law == "delay" || law.law == "lag";
    };
    EXPECT_EQ(std::ranges::any_of(list.extensions(as_given(model, 10.0), motion), is_late),
              is_driven);
  }
}

// J = 0.03 kg m^2, 0.7 N m s/rad and 5 N m of dry friction, driven by steps that hold for `hold`
// samples; the gain of the drive falls by `bend` at 150 N m.
std::string driven_log(const std::vector<double>& torques, int hold, double sign, double bend,
                       double drag, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::string text = "torque,motion\n";
  double speed = 0.0;
  for (const double torque : torques) {
    const double acts = torque * (1.0 - bend * std::abs(torque) / 150.0);
    for (int k = 0; k < hold; ++k) {
      text += fmt::format("{},{:.6f}\n", sign * torque, speed + noise(random));
      for (int step = 0; step < 50; ++step) {
        const double friction =
            0.7 * speed + drag * speed * std::abs(speed) + 5.0 * std::tanh(speed / 0.01);
        speed += 1e-4 * (acts - friction) / 0.03;
      }
    }
  }
  return text;
}

// A single start and stop one way: few blocks move, and a load could be braked so, were it not that
// the axis is the faster the more it is braked.
TEST(SingleMovements, TellADriveThatIsCountedTheOtherWay) {
  const std::vector<double> torques{0, 0, 20, 40, 60, 60, 40, 20, 0, 0};
  for (const double sign : {1.0, -1.0}) {
    const testing::TemporaryFolder folder;
    write_axis(folder, 0.005, 0.05, 1.0, true, true);
    testing::write_text(folder.file("a.csv"), driven_log(torques, 16, sign, 0.0, 0.0, 1));
    testing::write_text(folder.file("b.csv"), driven_log(torques, 16, sign, 0.0, 0.0, 2));
    const PredictionDiagnosis result = diagnosis_in(folder);
    ASSERT_EQ(result.diagnosis.channel_faults.size(), sign > 0.0 ? 0U : 1U);
    if (sign > 0.0) continue;
    EXPECT_EQ(result.diagnosis.channel_faults[0].channels, std::vector<std::string>{"torque"});
  }
}

// Steady speeds tell neither from the other; steps do a little, and both are named.
TEST(SingleMovements, TellADriveWhoseGainBendsFromDragOrNameBoth) {
  const std::vector<double> torques{30, 140, 60, 110, 20, 150, 90, 40, 130, 70, 25, 100};
  for (const bool bends : {true, false}) {
    const testing::TemporaryFolder folder;
    write_axis(folder, 0.005, 0.05, 1.0, true, true);
    const double bend = bends ? 0.45 : 0.0, drag = bends ? 0.0 : 0.01;
    testing::write_text(folder.file("a.csv"), driven_log(torques, 40, 1.0, bend, drag, 1));
    testing::write_text(folder.file("b.csv"), driven_log(torques, 40, 1.0, bend, drag, 2));
    const PredictionDiagnosis result = diagnosis_in(folder);
    const std::string truth = bends ? "curved_gain" : "quadratic_drag";
    const FoundEffect* found = nullptr;
    for (const FoundEffect& effect : result.diagnosis.effects) {
      const std::string& law = result.hypotheses[effect.law.hypothesis].law;
      if (law == "curved_gain" || law == "quadratic_drag") found = &effect;
    }
    ASSERT_NE(found, nullptr) << truth;
    const bool is_found = result.hypotheses[found->law.hypothesis].law == truth;
    const bool is_rival = std::ranges::any_of(found->rivals, [&](const Rival& rival) {
      return result.hypotheses[rival.law.hypothesis].law == truth;
    });
    EXPECT_TRUE(is_found || is_rival) << truth;
    const double value = found->law.parameters[0].value;
    if (is_found) {
      EXPECT_NEAR(value, bends ? -bend : drag, 0.1 * (bends ? bend : drag));
    }
  }
}

// White noise of 13 % of the speed: friction takes a tenth of the squared error, and many samples
// tell it by twenty standard errors.
TEST(SingleMovements, TellDryFrictionAmidWhiteNoise) {
  const testing::TemporaryFolder folder;
  write_axis(folder, 0.01, 0.02, 0.05, true, true);
  for (const unsigned seed : {1U, 2U}) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0.0, 6.0);
    std::uniform_real_distribution<double> torques(-3.0, 3.0);
    std::string text = "torque,motion\n";
    double torque = 0.0, speed = 0.0;
    for (int k = 0; k < 3000; ++k) {
      if (k % 90 == 20) torque = torques(random);
      text += fmt::format("{:.4f},{:.4f}\n", torque, speed + noise(random));
      for (int step = 0; step < 20; ++step) {
        const double friction = 0.025 * speed + 0.15 * std::tanh(speed / 0.05);
        speed += 5e-4 * (torque - friction) / 0.01;
      }
    }
    testing::write_text(folder.file(seed == 1 ? "a.csv" : "b.csv"), text);
  }
  const PredictionDiagnosis result = diagnosis_in(folder);
  ASSERT_EQ(laws_of(result), std::vector<std::string>{"coulomb"});
  const LawParameterEstimate& level = result.diagnosis.effects[0].law.parameters[0];
  EXPECT_NEAR(level.value, 0.15, 3.0 * level.standard_error);
}

// What is on or off shows no curve of its gain.
TEST(SingleMovements, TellNoCurveOfADriveOfTwoLevels) {
  const testing::TemporaryFolder folder;
  write_axis(folder, 0.005, 0.05, 1.0, true, true);
  const std::vector<double> torques{0, 60, 0, 60, 0, 0, 60, 60, 0, 60, 0, 0};
  testing::write_text(folder.file("a.csv"), driven_log(torques, 40, 1.0, 0.0, 0.01, 1));
  testing::write_text(folder.file("b.csv"), driven_log(torques, 40, 1.0, 0.0, 0.01, 2));
  const PredictionDiagnosis result = diagnosis_in(folder);
  for (const FoundEffect& effect : result.diagnosis.effects) {
    EXPECT_NE(result.hypotheses[effect.law.hypothesis].law, "curved_gain");
    for (const Rival& rival : effect.rivals) {
      EXPECT_NE(result.hypotheses[rival.law.hypothesis].law, "curved_gain");
    }
  }
}

// A servo that goes to its goal no faster than a limit: neither a lag nor a delay does that.
TEST(SingleMovements, TellTheGoalThatCantChangeFaster) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder.file("axis.yaml"), R"(format: graybox-lumped/1
sample_time: 0.01
motion: rotation
masses: {axis: 0.002}
elements:
  - {name: bearing, location: {kind: element, mass: axis}, law: viscous,
     parameters: {damping: {value: 0.05, unit: N m s/rad}}}
  - {name: servo, location: {kind: element, mass: axis}, law: stiffness,
     parameters: {stiffness: {value: 1, unit: N m/rad, fixed: true}}}
inputs: [{name: torque, mass: axis}]
outputs: [{name: motion, mass: axis, quantity: position}]
)");
  testing::write_text(folder.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: torque, unit: N m, is: input}
  - {name: motion, unit: rad, is: output}
hold: zero
experiments:
  - {file: a.csv}
  - {file: b.csv, role: validation}
)");
  constexpr double kLimit = 4.0;  // rad/s
  for (const unsigned seed : {1U, 2U}) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0.0, 0.005);
    std::uniform_real_distribution<double> goals(-1.5, 1.5);
    std::string text = "torque,motion\n";
    double goal = 0.0, held = 0.0, q = 0.0, v = 0.0;
    for (int k = 0; k < 1500; ++k) {
      if (k % 100 == 20) goal = goals(random);
      text += fmt::format("{:.6f},{:.6f}\n", goal, q + noise(random));
      for (int step = 0; step < 100; ++step) {
        held += std::clamp(goal - held, -kLimit * 1e-4, kLimit * 1e-4);
        v += 1e-4 * (held - q - 0.08 * v) / 0.001;
        q += 1e-4 * v;
      }
    }
    testing::write_text(folder.file(seed == 1 ? "a.csv" : "b.csv"), text);
  }
  const PredictionDiagnosis result = diagnosis_in(folder);
  const FoundEffect* found = nullptr;
  for (const FoundEffect& effect : result.diagnosis.effects) {
    if (result.hypotheses[effect.law.hypothesis].law == "rate_limit") found = &effect;
  }
  ASSERT_NE(found, nullptr);
  EXPECT_NEAR(found->law.parameters[0].value, kLimit, 0.05 * kLimit);
  EXPECT_EQ(result.diagnosis.effects.size(), 1U);
}

}  // namespace
}  // namespace graybox
