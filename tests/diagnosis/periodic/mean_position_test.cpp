// Where masses that no spring holds stand on average, which no line of a recording shows, and laws
// that follow it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

const std::string kBearing = R"(  - name: bearing
    location: {kind: element, mass: rotor}
    law: viscous
    parameters: {damping: {value: 0.02, unit: N m s/rad}}
)";
const std::string kSpeedControl = R"(noise: {seen: 0.01}
controller: {kind: pi, proportional: [0.3], integral_time: [0.1]}
)";

// `driven` by a torque and seen by the one sensor; on the bearing sits the rotor.
std::string model_of(const std::string& masses, const std::string& elements,
                     const std::string& driven, const std::string& quantity,
                     const std::string& noise_and_control) {
  return "format: graybox-lumped/1\nsample_time: 0.002\nmotion: rotation\nmasses: " + masses +
         "\nelements:\n" + elements + kBearing + "inputs:\n  - {name: torque, mass: " + driven +
         "}\noutputs:\n  - {name: seen, mass: " + driven + ", quantity: " + quantity + "}\n" +
         noise_and_control;
}

const std::string kControlled = model_of("{rotor: 0.005}", "", "rotor", "velocity", kSpeedControl);
const std::string kWithEncoder =
    model_of("{rotor: 0.005}", "", "rotor", "position", "noise: {seen: 0.001}\n");

// A motor that turns a load through what `coupling` says.
std::string drive(const std::string& coupling) {
  const std::string between = "    location: {kind: element, between: [motor, rotor]}\n";
  return model_of("{motor: 0.002, rotor: 0.004}",
                  "  - name: coupling\n" + between + coupling + "\n  - name: coupling damping\n" +
                      between +
                      "    law: viscous\n    parameters: {damping: {value: 0.03, unit: N m "
                      "s/rad}}\n",
                  "motor", "velocity", kSpeedControl);
}

const std::string kWithShaft =
    drive("    law: stiffness\n    parameters: {stiffness: {value: 20, unit: N m/rad}}");
const std::string kWithRubber =
    drive("    law: cubic_spring\n    parameters: {stiffness: {value: 4000, unit: N m/rad^3}}");

constexpr const char* kNothing = "format: graybox-physics/1\nelements: []\n";

constexpr const char* kBalancer = R"(format: graybox-physics/1
elements:
  - name: hidden
    location: {kind: element, mass: rotor}
    law: balancer
    parameters:
      stiffness: {value: 6, unit: N/m}
      free_length: {value: 0.2, unit: m}
      anchor_distance: {value: 0.5, unit: m}
      lever_length: {value: 0.3, unit: m}
      anchor_angle: {value: 0.8, unit: rad}
)";

// A pendulum that hangs at -0.7 rad.
constexpr const char* kPendulum = R"(format: graybox-physics/1
elements:
  - name: hidden
    location: {kind: element, mass: rotor}
    law: ripple
    parameters:
      amplitude: {value: 0.4, unit: N m}
      period: {value: 6.283185307, unit: rad}
      phase: {value: 0.7, unit: rad}
)";

class RecordedRotor {
 public:
  RecordedRotor(const std::string& model, const std::string& physics, const std::string& levels,
                int settling_periods = 3) {
    testing::write_text(folder_.file("model.yaml"), model);
    testing::write_text(folder_.file("physics.yaml"), physics);
    testing::write_text(folder_.file("plan.yaml"), "format: graybox-plan/1\nlevels: " + levels + R"(
realisations: 3
period: 1000
periods: 4
frequencies: {from: 0.5, to: 20, count: 15, spacing: log}
settling_periods: )" + std::to_string(settling_periods) +
                                                       "\n");
    const SimulatedSystem system = load_system(model_file(), folder_.file("physics.yaml"));
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), {});
  }
  [[nodiscard]] std::filesystem::path model_file() const { return folder_.file("model.yaml"); }
  [[nodiscard]] Campaign campaign() const { return read_campaign(folder_.file("campaign")); }
  [[nodiscard]] Campaign campaign_without_references() const {
    std::ifstream file(folder_.file("campaign/campaign.yaml"));
    std::string text, line;
    while (std::getline(file, line)) {
      if (line.find("is: reference") == std::string::npos) text += line + "\n";
    }
    testing::write_text(folder_.file("campaign/blind.yaml"), text);
    return read_campaign(folder_.file("campaign/blind.yaml"));
  }
  [[nodiscard]] std::unique_ptr<MismatchProblem> problem() const {
    return periodic_mismatch_problem(model_file(), campaign(), {});
  }
  // What the sensor recorded in one experiment.
  [[nodiscard]] Eigen::VectorXd seen(std::size_t experiment) const {
    const ExperimentRecording recording = load_experiment(campaign(), experiment);
    return recording.data.pieces.front().values.col(recording.index_of("seen"));
  }

 private:
  testing::TemporaryFolder folder_;
};

LawStart start_of(const MismatchProblem& problem, const ExtendedFit& before,
                  const std::string& law) {
  const auto hypotheses = problem.hypotheses();
  const auto found = std::ranges::find_if(
      hypotheses, [&](const Hypothesis& h) { return h.law == law && h.place == "rotor"; });
  if (found == hypotheses.end()) throw std::out_of_range(law);
  const std::vector<std::size_t> asked{static_cast<std::size_t>(found - hypotheses.begin())};
  return problem.scores(before, asked, 0, 1).scores.front().start;
}

// The fit of a law at the rotor, from its best start.
ExtendedFit fitted_with(const MismatchProblem& problem, const std::string& law) {
  const ExtendedFit before = problem.fit({}, nullptr);
  EXPECT_GT(before.estimation.chi_square_per_dof(), 2.0);
  return problem.fit(std::vector<LawStart>{start_of(problem, before, law)}, &before);
}

// Of the balancer's torque over the recorded angles, beside its largest.
double error_of_balancer(const FittedLaw& law) {
  std::vector<double> values;
  for (const LawParameterEstimate& each : law.parameters) values.push_back(each.value);
  const LawEntry* entry = find_law("balancer", false);
  const auto found = entry->make(values);
  const auto truth = entry->make(std::vector<double>{6.0, 0.2, 0.5, 0.3, 0.8});
  double largest = 0.0, error = 0.0;
  for (double z = -0.8; z <= 0.8; z += 0.05) {
    largest = std::max(largest, std::abs(truth->force(z, 0.0, {})));
    error = std::max(error, std::abs(found->force(z, 0.0, {}) - truth->force(z, 0.0, {})));
  }
  return error / largest;
}

// The controller's integral knows. The truth: the recorded speed from rest, summed up.
TEST(MeanPosition, IsThatWhichTheControllerHolds) {
  const RecordedRotor settled(kControlled, kBalancer, "[1, 3]", 1);
  const RecordedRotor from_rest(kControlled, kBalancer, "[1, 3]", 0);
  const auto family = plant_family(settled.model_file());
  const PeriodicData data = read_periodic_data(settled.campaign(), *family, {});
  constexpr double kSampleTime = 0.002;
  constexpr Eigen::Index kPeriod = 1000;
  double least = 1e9, most = -1e9;
  for (std::size_t e = 0; e < data.estimation.size(); ++e) {
    const Eigen::VectorXd speed = from_rest.seen(e);
    Eigen::VectorXd angle = Eigen::VectorXd::Zero(2 * kPeriod);
    for (Eigen::Index t = 1; t < angle.size(); ++t) {
      angle(t) = angle(t - 1) + 0.5 * kSampleTime * (speed(t - 1) + speed(t));
    }
    ASSERT_EQ(data.estimation[e].mean_offset.size(), 1);
    const double offset = data.estimation[e].mean_offset(0);
    // Noise summed up, in both: 0.01 rad/s x 0.002 s x 2000^(1/2).
    EXPECT_NEAR(offset, angle.tail(kPeriod).mean(), 6e-3) << e;
    least = std::min(least, offset);
    most = std::max(most, offset);
  }
  EXPECT_GT(most - least, 0.2);  // recordings differ by what they would be wrong by without it
}

// A balancer's torque turns with the rotor: it fits only where each recording stands where it
// stood.
TEST(MeanPosition, TellsABalancerWhereItsRotorStands) {
  const RecordedRotor rotor(kControlled, kBalancer, "[1, 3]");
  const auto problem = rotor.problem();
  const ExtendedFit fit = fitted_with(*problem, "balancer");
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  EXPECT_LT(error_of_balancer(fit.laws.front()), 0.03);
  // Lengths and the stiffness are known for a given anchor alone: four parameters, the rotor's two.
  EXPECT_EQ(fit.parameter_count, 6U);
  const std::vector<LawParameterEstimate>& found_parameters = fit.laws.front().parameters;
  EXPECT_TRUE(found_parameters[2].sets_scale);
  const double anchor = found_parameters[2].value / 0.5;  // of the true one
  const std::vector<double> scaled{6.0 / (anchor * anchor), 0.2 * anchor, 0.5 * anchor,
                                   0.3 * anchor};
  for (const std::size_t p : {0U, 1U, 3U}) {
    const LawParameterEstimate& each = found_parameters[p];
    EXPECT_TRUE(std::isnan(each.standard_error)) << each.name;
    EXPECT_NEAR(each.value, scaled[p], 4.0 * each.conditional_error) << each.name;
    EXPECT_LT(each.conditional_error, 0.1 * each.value) << each.name;
  }
  EXPECT_LT(fit.laws.front().parameters[4].standard_error, 0.05);
}

// The rotor hangs on the motor that the control holds, and follows it.
TEST(MeanPosition, OfALoadIsThatOfTheMotorThatHoldsIt) {
  const RecordedRotor rotor(kWithShaft, kBalancer, "[1, 3]");
  const auto problem = rotor.problem();
  const ExtendedFit fit = fitted_with(*problem, "balancer");
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  EXPECT_LT(error_of_balancer(fit.laws.front()), 0.03);
}

// Nothing but a law of the model joins the two: the one must not stay behind.
TEST(MeanPosition, OfALoadBehindALawIsThatOfTheMotor) {
  const RecordedRotor rotor(kWithRubber, kNothing, "[0.3, 1]");
  const auto problem = rotor.problem();
  const ExtendedFit fit = problem->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
}

// Without references the controller's errors are not known; on a spring nothing has to be.
TEST(MeanPosition, IsLeftToTheSpringOrUnknownElse) {
  const RecordedRotor rotor(kControlled, kNothing, "[1]");
  const auto family = plant_family(rotor.model_file());
  const PeriodicData blind = read_periodic_data(rotor.campaign_without_references(), *family, {});
  EXPECT_EQ(blind.estimation.front().mean_offset.size(), 0);
  std::string sprung = kControlled;
  sprung.insert(sprung.find("inputs:"),
                "  - name: spring\n    location: {kind: element, mass: rotor}\n    law: stiffness\n"
                "    parameters: {stiffness: {value: 2, unit: N m/rad}}\n");
  const RecordedRotor on_spring(sprung, kNothing, "[1]");
  const auto grounded = plant_family(on_spring.model_file());
  const PeriodicData data = read_periodic_data(on_spring.campaign(), *grounded, {});
  EXPECT_EQ(data.estimation.front().mean_offset.size(), 0);
}

// Each start in a valley of its own: another angle of the anchor.
TEST(MeanPosition, BalancersBeginAtSeveralAngles) {
  const RecordedRotor rotor(kControlled, kBalancer, "[1, 3]");
  const auto problem = rotor.problem();
  const LawStart start = start_of(*problem, problem->fit({}, nullptr), "balancer");
  std::vector<double> angles{start.parameters.back()};
  for (const std::vector<double>& other : start.others) angles.push_back(other.back());
  EXPECT_GT(angles.size(), 3U);
  std::ranges::sort(angles);
  EXPECT_EQ(std::ranges::adjacent_find(angles), angles.end());
}

// An encoder shows it. Without it the phase would be that of a pendulum which hangs at zero.
TEST(MeanPosition, IsThatOfTheEncoderWhereNothingHoldsTheMass) {
  const RecordedRotor rotor(kWithEncoder, kPendulum, "[0.1, 0.25]");
  const auto family = plant_family(rotor.model_file());
  const PeriodicData data = read_periodic_data(rotor.campaign(), *family, {});
  for (std::size_t e = 0; e < data.estimation.size(); ++e) {
    ASSERT_EQ(data.estimation[e].mean_offset.size(), 1);
    EXPECT_NEAR(data.estimation[e].mean_offset(0), rotor.seen(e).tail(1000).mean(), 1e-12);
  }
  const auto problem = rotor.problem();
  const ExtendedFit fit = fitted_with(*problem, "ripple");
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.1);
  const std::vector<double> truth{0.4, 2.0 * std::numbers::pi, 0.7};
  for (std::size_t p = 0; p < truth.size(); ++p) {
    const LawParameterEstimate& estimate = fit.laws.front().parameters[p];
    EXPECT_NEAR(estimate.value, truth[p], 4.0 * estimate.standard_error) << estimate.name;
    EXPECT_LT(estimate.standard_error, 0.1 * truth[p]) << estimate.name;
  }
}

}  // namespace
}  // namespace graybox
