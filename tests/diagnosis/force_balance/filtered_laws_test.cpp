// Laws of torques that went through filters, and sums of plain laws that a richer one imitates: on
// a simulated motor whose friction is known.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/inverse_dynamics/filtered_motion.hpp"
#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "problems/base/random.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr double kLevel = 0.05, kDamping = 0.004, kInertia = 2.1e-3;
constexpr double kSample = 0.002;

// A motor under a held torque, its speed recorded with noise: the drive of
// docs/how_to/fit_lumped.md.
class Motor {
 public:
  explicit Motor(std::uint64_t seed) {
    Random random(seed);
    write("run_1.csv", random);
    write("run_2.csv", random);
    testing::write_text(folder_.file("motor.yaml"), R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints: [{name: motor, alpha: 0, a: 0, d: 0, gear_ratio: 1, rotor_inertia: unknown}]
channels: {torque: [torque], torque_of: motors, position_of: motors, velocity: [speed],
  acceleration: [acc]}
)");
  }

  [[nodiscard]] Campaign campaign(double low_pass) const {
    testing::write_text(folder_.file("campaign.yaml"), fmt::format(R"(format: graybox-campaign/1
sample_time: 0.002
channels: [{{name: speed, unit: rad/s, is: output}}, {{name: torque, unit: N m, is: input}}]
preprocess: [{{kind: low_pass, frequency: {}}}, {{kind: derivative, of: [speed], name: [acc]}},
  {{kind: trim, time: 0.05}}, {{kind: decimate, factor: 5}}]
experiments: [{{file: run_1.csv}}, {{file: run_2.csv, role: validation}}]
)",
                                                                   low_pass));
    return read_campaign(folder_.file("campaign.yaml"));
  }
  [[nodiscard]] std::filesystem::path model() const { return folder_.file("motor.yaml"); }
  [[nodiscard]] const testing::TemporaryFolder& folder() const { return folder_; }

 private:
  void write(const std::string& name, Random& random) {
    constexpr int kLines = 6, kSteps = 40;
    std::vector<double> amplitude, frequency, phase;
    for (int k = 0; k < kLines; ++k) {
      amplitude.push_back(random.uniform(0.03, 0.09));
      frequency.push_back(random.uniform(0.5, 6.0));
      phase.push_back(random.uniform(0.0, 2.0 * std::numbers::pi));
    }
    std::string text = "torque,speed\n";
    double speed = 0.0;
    for (int t = 0; t < 2000; ++t) {
      double torque = 0.0;
      for (int k = 0; k < kLines; ++k) {
        const auto i = static_cast<std::size_t>(k);
        torque +=
            amplitude[i] * std::sin(2.0 * std::numbers::pi * frequency[i] * kSample * t + phase[i]);
      }
      text += fmt::format("{:.6f},{:.5f}\n", torque, speed + 0.05 * random.normal());
      for (int step = 0; step < kSteps; ++step) {
        const double friction = kLevel * std::tanh(speed / 0.3) + kDamping * speed;
        speed += kSample / kSteps * (torque - friction) / kInertia;
      }
    }
    testing::write_text(folder_.file(name), text);
  }

  testing::TemporaryFolder folder_;
};

struct Found {
  Diagnosis diagnosis;
  std::vector<std::string> laws;  // of the effects
  [[nodiscard]] bool has(const std::string& law) const {
    return std::ranges::find(laws, law) != laws.end();
  }
};

Found found_by(const Motor& motor, double low_pass) {
  const auto problem = force_balance_problem(motor.model(), motor.campaign(low_pass));
  Found found{diagnose(*problem), {}};
  for (const FoundEffect& effect : found.diagnosis.effects) {
    found.laws.push_back(problem->hypotheses()[effect.law.hypothesis].law);
  }
  return found;
}

// Finding 2.1.
TEST(FilteredLaws, DryAndViscousFrictionBehindALowPassAreNotSurelyAnotherLaw) {
  int named = 0, cases = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Motor motor(seed);
    for (const double low_pass : {20.0, 30.0, 40.0}) {
      const Found found = found_by(motor, low_pass);
      const std::string where =
          fmt::format("seed {}, low-pass {} Hz: {}", seed, low_pass, fmt::join(found.laws, ", "));
      const bool is_truth = found.laws.size() == 2 && found.has("coulomb") && found.has("viscous");
      ++cases;
      if (is_truth) ++named;
      if (found.diagnosis.verdict == Verdict::kExplained) {
        EXPECT_TRUE(is_truth) << where;
      }
      if (!is_truth) continue;
      for (const FoundEffect& effect : found.diagnosis.effects) {
        const LawParameterEstimate& size = effect.law.parameters.front();
        const double truth = size.name == "level" ? kLevel : kDamping;
        // The speed's noise is inside the laws: it makes both smaller than they are.
        EXPECT_NEAR(size.value, truth, 4.0 * size.standard_error + 0.35 * truth)
            << where << ", " << size.name;
      }
    }
  }
  EXPECT_GE(2 * named, cases);
}

// What a filter makes of a law's force is the filtered force, and of a linear law nothing else than
// of the motion.
TEST(FilteredLaws, AreTheFilteredForceOfTheUnfilteredMotion) {
  constexpr Eigen::Index kFine = 20001, kStride = 50;
  constexpr double kFast = 1e-4, kCutOff = 20.0;
  const Eigen::ArrayXd time = Eigen::ArrayXd::LinSpaced(kFine, 0.0, kFast * (kFine - 1));
  const double w = 2.0 * std::numbers::pi * 1.3;
  Motion fine{time, (w * time).sin() / w, (w * time).cos(), -w * (w * time).sin(), time};
  const auto law = find_law("coulomb", false)->make(std::vector<double>{1.0, 0.01});
  Eigen::VectorXd force(kFine);
  for (Eigen::Index t = 0; t < kFine; ++t) force(t) = law->force(0.0, fine.velocity(t, 0), {});
  const Eigen::VectorXd expected = zero_phase_low_pass(force, kCutOff * kFast, 4);
  const auto kept = Eigen::seq(Eigen::Index{0}, Eigen::last, kStride);
  Motion sampled{fine.time(kept), fine.position(kept, Eigen::all), fine.velocity(kept, Eigen::all),
                 fine.acceleration(kept, Eigen::all), fine.torque(kept, Eigen::all)};
  sampled.filters = {{kCutOff, 4}};
  const FilteredMotion filtered(sampled);
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  const Eigen::VectorXd got = filtered.force(*law, one);
  const Eigen::VectorXd truth = expected(kept);
  ASSERT_EQ(got.size(), truth.size());
  const Eigen::Index edge = 20, inner = got.size() - 2 * edge;
  EXPECT_LT((got - truth).segment(edge, inner).norm(), 0.02 * truth.segment(edge, inner).norm());
  const Eigen::VectorXd plain = force(kept);
  EXPECT_GT((plain - truth).segment(edge, inner).norm(), 0.08 * truth.segment(edge, inner).norm());
  const auto viscous = find_law("viscous", false)->make(std::vector<double>{3.0});
  EXPECT_LT((filtered.force(*viscous, one) - 3.0 * sampled.velocity.col(0)).norm(),
            1e-9 * sampled.velocity.norm());
}

// The fit's columns pass the filters, too: by default, and a level comes out where it is.
TEST(FilteredLaws, AFitOfDryFrictionBehindALowPassFindsItsLevel) {
  const Motor motor(4);
  testing::write_text(motor.folder().file("friction.yaml"), R"(format: graybox-physics/1
elements:
  - {name: bearing, location: {kind: element, joint: motor, axis: motor}, law: viscous,
     parameters: {damping: {value: 0, unit: N m s/rad}}}
  - {name: seal, location: {kind: element, joint: motor, axis: motor}, law: coulomb,
     parameters: {level: {value: 0, unit: N m}, transition_velocity: {value: 0.3, unit: rad/s}}}
)");
  for (const double low_pass : {10.0, 20.0, 40.0}) {
    const Campaign campaign = motor.campaign(low_pass);
    const RigidRobotModel robot =
        load_rigid_robot(motor.model(), {motor.folder().file("friction.yaml")});
    const InverseDynamicsFit fit =
        fit_inverse_dynamics(robot, read_motion_records(robot, campaign), {});
    ASSERT_EQ(fit.parameters.size(), 3U);
    for (const TorqueParameter& each : fit.parameters) {
      const double truth = each.name == "seal.level"        ? kLevel
                           : each.name == "bearing.damping" ? kDamping
                                                            : kInertia;
      EXPECT_NEAR(each.value, truth, std::max(0.02 * truth, 4.0 * each.standard_error))
          << each.name << " at " << low_pass << " Hz";
    }
  }
}

// Speeds are enough for what does not depend on the position, and are refused for what does.
TEST(FilteredLaws, OfSpeedsAloneNeedNoPosition) {
  const Motor motor(5);
  const auto problem = force_balance_problem(motor.model(), motor.campaign(30.0));
  for (const Hypothesis& hypothesis : problem->hypotheses()) {
    EXPECT_NE(hypothesis.law, "stiffness");
    EXPECT_NE(hypothesis.law, "ripple");
  }
  const auto tried = [&](const char* law) {
    return std::ranges::any_of(problem->hypotheses(),
                               [law](const Hypothesis& each) { return each.law == law; });
  };
  EXPECT_TRUE(tried("coulomb"));
  EXPECT_TRUE(tried("dahl"));
  std::string lying = testing::read_text(motor.model().string());
  lying.replace(lying.find("[0, 0, -9.81]"), 13, "[0, -9.81, 0]");
  testing::write_text(motor.folder().file("lying.yaml"), lying);
  testing::expect_refused(
      [&] { (void)force_balance_problem(motor.folder().file("lying.yaml"), motor.campaign(30.0)); },
      "needs 'position'");
}

// What the extended model's header speaks of is in it, and a fit of it comes to the same.
TEST(FilteredLaws, AnExtendedModelHoldsWhatWasEstimatedAndFitsAsTheDiagnosisDid) {
  const Motor motor(6);
  const Campaign campaign = motor.campaign(30.0);
  const auto problem = force_balance_problem(motor.model(), campaign);
  const Diagnosis diagnosis = diagnose(*problem);
  ASSERT_FALSE(diagnosis.after.laws.empty());
  const std::string file = motor.folder().file("extended.yaml");
  testing::write_text(
      file, extended_model_text(motor.model(), file, diagnosis.after, problem->hypotheses()));
  const std::string text = testing::read_text(file);
  ASSERT_FALSE(diagnosis.after.model_parameters.empty());
  for (const LawParameterEstimate& estimate : diagnosis.after.model_parameters) {
    EXPECT_NE(text.find(estimate.name), std::string::npos) << text;
    EXPECT_NE(text.find(fmt::format("{}", estimate.value)), std::string::npos) << text;
  }
  const RigidRobotModel robot = load_rigid_robot(file);
  const InverseDynamicsFit fit =
      fit_inverse_dynamics(robot, read_motion_records(robot, campaign), {});
  for (const LawParameterEstimate& estimate : diagnosis.after.model_parameters) {
    const auto same = std::ranges::find(fit.parameters, estimate.name, &TorqueParameter::name);
    ASSERT_NE(same, fit.parameters.end()) << estimate.name;
    EXPECT_NEAR(same->value, estimate.value, 1e-4 * std::abs(estimate.value));
  }
  EXPECT_NEAR(fit.records.front().total.nrmse, diagnosis.after.estimation.nrmse,
              1e-3 * diagnosis.after.estimation.nrmse);
}

}  // namespace
}  // namespace graybox
