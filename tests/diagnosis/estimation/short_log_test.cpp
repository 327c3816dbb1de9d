// Diagnosis by prediction error of logs of some hundred samples: what shows in a few moments of
// them, and what stands still.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <random>
#include <regex>
#include <string>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/force_balance_data/measured_drive.hpp"
#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "diagnosis/second_looks/reversed_drive.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr double kSampleTime = 0.02;

// A wheel as its maker states it, with what its sensor reads, and the logs to fit and to keep out.
void write_wheel(const testing::TemporaryFolder& folder, const std::string& quantity,
                 const std::vector<std::string>& kept_out) {
  const std::string unit = quantity == "position" ? "rad" : "rad/s";
  testing::write_text(
      folder.file("wheel.yaml"),
      "format: graybox-lumped/1\nsample_time: 0.02\nmotion: rotation\nmasses: {axis: 0.01}\n"
      "elements:\n  - {name: bearing, location: {kind: element, mass: axis}, law: viscous, "
      "parameters: {damping: {value: 0.05, unit: N m s/rad}}}\ninputs:\n"
      "  - {name: torque, mass: axis}\noutputs:\n  - {name: y, mass: axis, quantity: " +
          quantity + "}\n");
  std::string experiments;
  for (const std::string log : {"a", "b"}) {
    const bool is_kept_out = std::ranges::count(kept_out, log) > 0;
    experiments +=
        fmt::format("  - {{file: {}.csv{}}}\n", log, is_kept_out ? ", role: validation" : "");
  }
  testing::write_text(folder.file("campaign.yaml"),
                      "format: graybox-campaign/1\nsample_time: 0.02\nhold: zero\nchannels:\n"
                      "  - {name: torque, unit: N m, is: input}\n  - {name: y, unit: " +
                          unit + ", is: output}\nexperiments:\n" + experiments);
}

struct Wheel {
  double inertia, damping;
  double friction = 0.0;  // dry
  int late = 0;           // samples between drive and motion
};

// Simulated in steps of a thousandth of a sample.
void write_log(const testing::TemporaryFolder& folder, const std::string& name, const Wheel& wheel,
               const std::vector<double>& torques, const std::string& quantity, double noise,
               unsigned seed) {
  constexpr int kSteps = 1000;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  std::string text = "torque,y\n";
  double angle = 0.0, speed = 0.0;
  std::deque<double> waiting(static_cast<std::size_t>(wheel.late), 0.0);
  for (const double torque : torques) {
    const double y = quantity == "position" ? angle : speed;
    text += fmt::format("{},{}\n", torque, y + error(random));
    waiting.push_back(torque);
    const double acts = waiting.front();
    waiting.pop_front();
    for (int step = 0; step < kSteps; ++step) {
      if (speed == 0.0 && std::abs(acts) <= wheel.friction) continue;
      const double direction = speed != 0.0 ? std::copysign(1.0, speed) : std::copysign(1.0, acts);
      const double force = acts - wheel.damping * speed - direction * wheel.friction;
      const double next = speed + kSampleTime / kSteps * force / wheel.inertia;
      speed = speed * next < 0.0 ? 0.0 : next;
      angle += kSampleTime / kSteps * speed;
    }
  }
  testing::write_text(folder.file(name + ".csv"), text);
}

std::vector<double> steps(const std::vector<double>& levels, int samples) {
  std::vector<double> torques;
  for (int k = 0; k < samples; ++k) {
    torques.push_back(
        levels[static_cast<std::size_t>(k) * levels.size() / static_cast<std::size_t>(samples)]);
  }
  return torques;
}

// Friction of 0.5 N m beside torques up to 1.5; the second log is kept out.
void write_wheel_with_friction(const testing::TemporaryFolder& folder) {
  const Wheel wheel{.inertia = 0.003, .damping = 0.02, .friction = 0.5};
  const std::vector<double> levels{0.0, 0.45, 1.0, 0.0, -0.45, -1.2, 0.0, 1.5};
  write_wheel(folder, "position", {"b"});
  write_log(folder, "a", wheel, steps(levels, 240), "position", 1e-3, 1U);
  write_log(folder, "b", wheel, steps({0.0, -1.0, 0.0, 1.3}, 160), "position", 1e-3, 2U);
}

PredictionDiagnosis diagnosed(const testing::TemporaryFolder& folder) {
  return diagnose_by_prediction(folder.file("wheel.yaml"),
                                read_campaign(folder.file("campaign.yaml")), {}, 1);
}

std::vector<std::string> names_of(const PredictionDiagnosis& result) {
  std::vector<std::string> names;
  for (const FoundEffect& effect : result.diagnosis.effects) {
    const Hypothesis& hypothesis = result.hypotheses[effect.law.hypothesis];
    names.push_back(hypothesis.law + " at " + hypothesis.place);
  }
  return names;
}

// What is guessed decides nothing: of one mass alone every fit starts from what the log suggests.
TEST(ShortLogs, AreAnsweredAlikeWhateverIsGuessed) {
  const testing::TemporaryFolder folder;
  write_wheel_with_friction(folder);
  const std::string text = testing::read_text(folder.file("wheel.yaml"));
  std::optional<Diagnosis> first;
  for (const std::string guess : {"{axis: 0.01}", "{axis: 3e-5}", "{axis: 20}"}) {
    testing::write_text(folder.file("wheel.yaml"),
                        std::regex_replace(text, std::regex(R"(\{axis: [^}]*\})"), guess));
    const PredictionDiagnosis result = diagnosed(folder);
    ASSERT_EQ(names_of(result), std::vector<std::string>{"coulomb at axis"}) << guess;
    if (!first) first = result.diagnosis;
    EXPECT_EQ(result.diagnosis.after.model_parameters[0].value,
              first->after.model_parameters[0].value)
        << guess;
    EXPECT_EQ(result.diagnosis.verdict, first->verdict);
  }
  EXPECT_NEAR(first->effects[0].law.parameters[0].value, 0.5, 0.05);
  EXPECT_NEAR(first->after.model_parameters[0].value, 0.003, 3e-4);
  ASSERT_TRUE(first->checked.standing);
  EXPECT_LE(first->checked.standing->drive.held(), 0.5);
  EXPECT_GT(first->checked.standing->drive.held(), 0.2);
}

// A constant would be foretold by a friction of its size.
TEST(ShortLogs, OfAConstantDriveHaveNoBalance) {
  const testing::TemporaryFolder folder;
  const Wheel wheel{.inertia = 0.003, .damping = 0.02, .friction = 0.5};
  write_wheel(folder, "position", {"b"});
  write_log(folder, "b", wheel, steps({0.0, -1.0}, 160), "position", 1e-3, 2U);
  const auto balance = [&] {
    const LumpedModel model = load_lumped_model(folder.file("wheel.yaml"));
    (void)drive_balance_problem(*measured_drive(model),
                                read_campaign(folder.file("campaign.yaml")));
  };
  write_log(folder, "a", wheel, steps({1.2}, 240), "position", 1e-3, 1U);
  testing::expect_refused(balance, "the drive is about 1.2 throughout");
  write_log(folder, "a", wheel, steps({1.2, 0.0}, 240), "position", 1e-3, 1U);
  EXPECT_NO_THROW(balance());
}

// Friction that takes nearly all of a drive, which is counted the other way.
TEST(ShortLogs, TellADriveOfTheWrongSignByPrediction) {
  const testing::TemporaryFolder folder;
  write_wheel_with_friction(folder);
  DiagnosisRequest request;
  request.model = folder.file("wheel.yaml");
  Diagnosis first;  // that left more force than ever acted
  first.reasons.emplace_back();
  first.reasons.back().test = std::string(kForceTest) + " axis, % of the forces that act";
  first.reasons.back().value = 150.0;
  Campaign campaign = read_campaign(folder.file("campaign.yaml"));
  EXPECT_FALSE(look_at_reversed_prediction(request, campaign, first).fault.has_value());
  campaign.channels.front().factor = -1.0;
  const ReversedLook look = look_at_reversed_prediction(request, campaign, first);
  ASSERT_TRUE(look.fault.has_value());
  EXPECT_EQ(look.fault->channels, std::vector<std::string>{"torque"});
  EXPECT_EQ(look.fault->dissimilarity_before, 1.5);
  EXPECT_LT(look.fault->dissimilarity_after, 0.5);
}

// A step at the beginning of a log is all that it tells of a motor that follows in three samples:
// what comes in the first samples counts, and dead time acts in them alone.
TEST(ShortLogs, TellTheDeadTimeOfOneStep) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const testing::TemporaryFolder folder;
    const Wheel wheel{.inertia = 0.0009, .damping = 0.0196, .late = 4};
    write_wheel(folder, "velocity", {});
    for (const std::string log : {"a", "b"}) {
      std::vector<double> torques(82, log == "a" ? 7.0 : -7.0);
      torques[0] = 0.0;
      write_log(folder, log, wheel, torques, "velocity", 0.5, seed);
    }
    const PredictionDiagnosis result = diagnosed(folder);
    ASSERT_EQ(names_of(result).size(), 1U) << seed;
    EXPECT_TRUE(names_of(result)[0].starts_with("delay at ")) << names_of(result)[0];
    const LawParameterEstimate& time = result.diagnosis.effects[0].law.parameters[0];
    EXPECT_NEAR(time.value, 0.08, 0.01) << seed;
    EXPECT_NE(result.diagnosis.verdict, Verdict::kNone);
  }
}

// One level of drive tells dry friction and damping apart as little as a log that stands: together
// they tell that there is friction.
TEST(ShortLogs, TellFrictionOfAWheelThatStandsUnderItsDrive) {
  const testing::TemporaryFolder folder;
  const Wheel wheel{.inertia = 0.0035, .damping = 0.035, .friction = 0.5};
  write_wheel(folder, "position", {});
  std::vector<double> runs(128, 1.0), stands(128, 0.3);
  std::fill_n(runs.begin(), 15, 0.0);
  std::fill_n(stands.begin(), 15, 0.0);
  write_log(folder, "a", wheel, runs, "position", 0.002, 1);
  write_log(folder, "b", wheel, stands, "position", 0.002, 2);
  const PredictionDiagnosis result = diagnosed(folder);
  ASSERT_EQ(names_of(result), std::vector<std::string>{"coulomb at axis"});
  // A law that is a little smooth creeps under what it holds.
  EXPECT_GT(result.diagnosis.effects[0].law.parameters[0].value, 0.999 * 0.3);
}

// What stands still has no signal of its own to compare an error with.
TEST(ShortLogs, ErrorsOfWhatStandsAreThoseOfTheFitsSignal) {
  const testing::TemporaryFolder folder;
  const Wheel wheel{.inertia = 0.0035, .damping = 0.035};
  write_wheel(folder, "position", {"b"});
  write_log(folder, "a", wheel, steps({1.0, -0.5, 0.7, -1.0}, 160), "position", 0.002, 3);
  write_log(folder, "b", wheel, std::vector<double>(100, 0.0), "position", 0.0, 4);
  const PredictionDiagnosis result = diagnosed(folder);
  ASSERT_TRUE(result.diagnosis.validation_after.has_value());
  EXPECT_LT(result.diagnosis.validation_after->nrmse, 5.0);
}

bool says(const PredictionDiagnosis& result, const std::string& words) {
  return std::ranges::any_of(result.diagnosis.assumptions, [&](const std::string& sentence) {
    return sentence.find(words) != std::string::npos;
  });
}

// At one speed damping, dry friction and a constant force are one thing.
TEST(ShortLogs, SayThatOneSpeedTellsNoKindOfFriction) {
  for (const bool is_one : {true, false}) {
    const testing::TemporaryFolder folder;
    const Wheel wheel{.inertia = 0.0035, .damping = 0.035, .friction = 0.2};
    write_wheel(folder, "position", {});
    const std::vector<double> torques =
        is_one ? std::vector<double>(200, 0.6) : steps({0.6, 0.3, -0.6, -0.4, 0.8}, 200);
    write_log(folder, "a", wheel, torques, "position", 0.0005, 5);
    write_log(folder, "b", wheel, torques, "position", 0.0005, 6);
    EXPECT_EQ(says(diagnosed(folder), "moves at about one speed"), is_one);
  }
}

// An axis that one force accelerates evenly: a weight or dry friction beside it would change what
// the fit says of its damping. Steps both ways leave no such doubt.
TEST(ShortLogs, SayWhichSizesHoldOnlyWithoutAnotherForce) {
  for (const bool is_even : {true, false}) {
    const testing::TemporaryFolder folder;
    const Wheel wheel{.inertia = 2.0, .damping = is_even ? 0.05 : 1.0};
    write_wheel(folder, "position", {});
    for (const std::string log : {"a", "b"}) {
      const double level = log == "a" ? -3.0 : -2.97;
      const std::vector<double> torques =
          is_even ? std::vector<double>(140, level) : steps({level, 3.0, -1.0, 2.0, -2.0}, 140);
      write_log(folder, log, wheel, torques, "position", 0.01, 7);
    }
    const PredictionDiagnosis result = diagnosed(folder);
    EXPECT_EQ(says(result, " only if axis "), is_even)
        << fmt::format("{}", fmt::join(result.diagnosis.assumptions, "\n"));
  }
}

// A sensor that reads noise alone tells no model: an error of all of the signal is no `none`,
// however much of it passes for noise that nobody has stated.
TEST(ShortLogs, NoiseAloneIsNotAModelThatLacksNothing) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const testing::TemporaryFolder folder;
    const Wheel wheel{.inertia = 2.0, .damping = 5.0};
    write_wheel(folder, "velocity", {"b"});
    for (const std::string log : {"a", "b"}) {
      write_log(folder, log, wheel, steps({1.0, -0.5, 0.7, -1.0}, 160), "velocity", 1.0, seed);
    }
    EXPECT_EQ(diagnosed(folder).diagnosis.verdict, Verdict::kUnknown) << seed;
  }
}

}  // namespace
}  // namespace graybox
