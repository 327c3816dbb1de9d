// Free motion in periodic recordings: taken out exactly where the model is right, whatever its
// damping.
#include "diagnosis/free_motion/transients.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>
#include <vector>

#include "diagnosis/free_motion/sampled_plant.hpp"
#include "diagnosis/free_motion/time_variation.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/base/distributions.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/two_mass_drive.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

LinearPlant two_masses() {
  LinearPlant plant;
  plant.mass = Eigen::Vector2d(0.002, 0.01).asDiagonal();
  plant.stiffness.resize(2, 2);
  plant.stiffness << 31.0, -30.0, -30.0, 33.0;
  plant.damping = 2e-3 * plant.stiffness;
  plant.input = Eigen::MatrixXd::Identity(2, 1);
  plant.position_output = Eigen::Matrix2d{{0.0, 0.0}, {0.0, 1.0}};
  plant.velocity_output = Eigen::Matrix2d{{1.0, 0.0}, {0.0, 0.0}};
  plant.rest = Eigen::Vector2d::Zero();
  return plant;
}

TEST(SampledPlant, RespondsAsThePlantBehindItsHold) {
  const LinearPlant plant = two_masses();
  constexpr double sample_time = 0.001;
  const SampledPlant sampled = sampled_plant(plant, sample_time);
  for (const double w : {5.0, 60.0, 131.0, 900.0}) {
    const Eigen::MatrixXcd series = sampled_response(plant, w, sample_time);
    const Eigen::MatrixXcd exact = sampled.response(std::polar(1.0, w * sample_time));
    EXPECT_LT((exact - series).norm(), 1e-5 * exact.norm()) << w;
  }
}

// sum A^n d z^-(n+1), term by term.
TEST(SampledPlant, StateIsTheTransformOfTheFreeMotion) {
  const LinearPlant plant = two_masses();
  constexpr double sample_time = 0.001;
  const SampledPlant sampled = sampled_plant(plant, sample_time);
  Eigen::Matrix4d state = Eigen::Matrix4d::Zero();
  state.topRightCorner<2, 2>().setIdentity();
  state.bottomLeftCorner<2, 2>() = -plant.mass.inverse() * plant.stiffness;
  state.bottomRightCorner<2, 2>() = -plant.mass.inverse() * plant.damping;
  const Eigen::Matrix4d transition = (sample_time * state).exp();
  const Eigen::Vector4d departure(0.3, -0.2, 5.0, 1.0);
  const Complex z = std::polar(1.0, 0.07);
  Eigen::Vector4cd sum = Eigen::Vector4cd::Zero();
  Eigen::Vector4d free = departure;
  Complex power = 1.0 / z;
  for (int n = 0; n < 60000; ++n) {
    sum += power * free;
    free = transition * free;
    power /= z;
  }
  const Eigen::VectorXcd found = sampled.state(z, sampled.vectors.adjoint() * departure);
  EXPECT_LT((found - sum).norm(), 1e-9 * sum.norm());
  const Eigen::VectorXcd seen = sampled.sight(z) * (sampled.vectors.adjoint() * departure);
  EXPECT_NEAR(std::abs(seen(0) - found(2)), 0.0, 1e-9 * std::abs(seen(0)));
}

constexpr double kNoise = 0.005;

using testing::kRingingDrive;

constexpr const char* kPlan = R"(format: graybox-plan/1
levels: [0.1, 0.3]
realisations: 3
validation_realisations: 1
period: 500
settling_periods: 0
periods: 4
frequencies: {from: 1, to: 60, count: 40, spacing: log}
)";

class UnsettledDrive {
 public:
  explicit UnsettledDrive(const std::string& truth, std::uint64_t seed = 1) {
    testing::write_text(folder_.file("model.yaml"), kRingingDrive);
    testing::write_text(folder_.file("truth.yaml"), truth);
    testing::write_text(folder_.file("plan.yaml"), kPlan);
    const SimulatedSystem system = load_system(folder_.file("truth.yaml"), std::nullopt);
    SimulationOptions options;
    options.seed = seed;
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), options);
  }
  [[nodiscard]] std::filesystem::path model() const { return folder_.file("model.yaml"); }
  [[nodiscard]] Campaign campaign() const { return read_campaign(folder_.file("campaign")); }

 private:
  testing::TemporaryFolder folder_;
};

double chi_square_per_number(const PlantFamily& family, const ModelState& model,
                             const PeriodicData& data) {
  SteadyStateSolver solver(family, data, {});
  double sum = 0.0;
  for (const MeasuredRecord& record : data.estimation) {
    sum += solver.solve(model, record, nullptr).chi_square;
  }
  return sum / data.numbers_in(data.estimation);
}

ActingLaw acting(const PlantFamily& family, const std::string& place, const std::string& law,
                 std::vector<double> values) {
  for (const CandidatePlace& each : family.places()) {
    if (each.location.name == place) return {&each, find_law(law, false), std::move(values), {}};
  }
  throw std::out_of_range(place);
}

TEST(Transients, LeaveNothingButTheNoise) {
  const UnsettledDrive drive(kRingingDrive);
  const auto family = plant_family(drive.model());
  const PeriodicDataOptions options;
  PeriodicData data = read_periodic_data(drive.campaign(), *family, options);
  const Eigen::VectorXd truth = family->start_values();
  const ModelState model = evaluate_model(*family, data, truth, {}, true, 1);
  PeriodicData raw = data;
  for (MeasuredRecord& record : raw.estimation) {
    for (Index k = 1; k <= raw.last_line; ++k) {
      record.output.col(k) = record.output_bins.col(k * record.periods);
      record.input.col(k) = record.input_bins.col(k * record.periods);
    }
  }
  EXPECT_GT(chi_square_per_number(*family, model, raw), 10.0);
  clear_transients(*family, model, options, data);
  EXPECT_NEAR(chi_square_per_number(*family, model, data), 1.0, 0.05);
  // White noise: variance sigma^2 / P of each line, the same in both outputs and at both levels.
  for (const auto& group : data.whitening) {
    double mean = 0.0;
    for (Index k = data.first_line; k <= data.last_line; ++k) {
      const Eigen::MatrixXcd& whitening = group[static_cast<std::size_t>(k)];
      const Eigen::MatrixXcd covariance = 2.0 * (whitening.adjoint() * whitening).inverse();
      mean += covariance.trace().real() / 2.0 / static_cast<double>(data.line_count());
    }
    EXPECT_NEAR(mean / (kNoise * kNoise / 4.0), 1.0, 0.08);
  }
}

// A mode within 0.03 % of an excited line that hardly decays while it is recorded (14 s of damping,
// 2.7 s of record): a small change of what own forces make of both motions is a large one of the
// motion at that line.
TEST(Transients, AgreeWithARobotsOwnForcesAtAResonance) {
  const std::filesystem::path robot =
      std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems/robot/three_axis.yaml";
  testing::TemporaryFolder folder;
  std::string text = testing::read_text(robot.string());
  for (const auto& [damping, less] : {std::pair{"damping: 6.0", "damping: 0.3"},
                                      {"damping: 7.0", "damping: 0.35"},
                                      {"damping: 9.0", "damping: 0.45"},
                                      {"damping: 1.5", "damping: 0.075"}}) {
    ASSERT_NE(text.find(damping), std::string::npos);
    text.replace(text.find(damping), std::string(damping).size(), less);
  }
  testing::write_text(folder.file("model.yaml"), text);
  std::filesystem::copy(robot.parent_path() / "three_axis.urdf", folder.file("three_axis.urdf"));
  testing::write_text(folder.file("plan.yaml"), R"(format: graybox-plan/1
plant: robot
levels: [8.0]
period: 914
settling_periods: 2
periods: 3
frequencies: {from: 2, to: 60, count: 20, spacing: log}
positions: [[73, 16, 27]]
noise: 1e-12
)");
  const SimulatedSystem system = load_system(folder.file("model.yaml"), std::nullopt);
  simulate_campaign(system, read_plan(folder.file("plan.yaml"), system), folder.file("campaign"),
                    {});
  const auto family = plant_family(folder.file("model.yaml"));
  const PeriodicDataOptions options;
  PeriodicData data = read_periodic_data(read_campaign(folder.file("campaign")), *family, options);
  const Eigen::VectorXd truth = Eigen::VectorXd::Ones(4);
  const ModelState model = evaluate_model(*family, data, truth, {}, true, 1);
  clear_transients(*family, model, options, data);
  EXPECT_NEAR(chi_square_per_number(*family, model, data), 1.0, 0.06);
}

// The slope of a hardening shaft changes with the motion: where that meets free motion, both fall
// on the lines. By its mean slope alone chi-square over numbers would be 3 for the softer of these.
// The harder one changes it so much that the two can't be brought to agree: it counts by its mean
// slope.
TEST(Transients, AgreeWithALawThatIsNotLinear) {
  for (const double stiffness : {1e3, 2e4}) {
    const std::string hardening = R"(  - name: hardening
    location: {kind: element, between: [motor, load]}
    law: cubic_spring
    parameters: {stiffness: {value: )" +
                                  std::to_string(stiffness) + ", unit: N m/rad^3}}\n";
    std::string truth = kRingingDrive;
    truth.insert(truth.find("inputs:\n"), hardening);
    const UnsettledDrive drive(truth);
    const auto family = plant_family(drive.model());
    const PeriodicDataOptions options;
    PeriodicData data = read_periodic_data(drive.campaign(), *family, options);
    const Eigen::VectorXd parameters = family->start_values();
    const ModelState model =
        evaluate_model(*family, data, parameters,
                       {acting(*family, "motor-load", "cubic_spring", {stiffness})}, true, 1);
    clear_transients(*family, model, options, data);
    const double chi_square = chi_square_per_number(*family, model, data);
    if (stiffness < 2e3) {
      EXPECT_NEAR(chi_square, 1.0, 0.1);
    } else {
      EXPECT_LT(chi_square, 2.0);
    }
  }
}

struct AddedMass {
  std::string place, law, parameters;
  std::vector<double> values;
};

// Masses more, fixed or on springs: free motion has these, too. By mean stiffness and damping alone
// what is left of it would pass for noise, and chi-square over numbers would be 0.77 with one on a
// spring and 0.90 with a fixed one. Nothing changes with time.
TEST(Transients, AreThoseOfMassesThatLawsAdd) {
  const AddedMass slow{"load",
                       "mode",
                       "{inertia: {value: 0.002, unit: kg m^2}, frequency: {value: 9, unit: Hz}, "
                       "damping_ratio: {value: 0.005, unit: \"1\"}}",
                       {0.002, 9.0, 0.005}};
  const AddedMass fast{"motor",
                       "mode",
                       "{inertia: {value: 3e-4, unit: kg m^2}, frequency: {value: 30, unit: Hz}, "
                       "damping_ratio: {value: 0.01, unit: \"1\"}}",
                       {3e-4, 30.0, 0.01}};
  const AddedMass fixed{"load", "inertia", "{inertia: {value: 0.004, unit: kg m^2}}", {0.004}};
  for (const std::vector<AddedMass>& added :
       {std::vector{slow}, std::vector{fixed}, std::vector{slow, fast, fixed}}) {
    std::string truth = kRingingDrive;
    for (const AddedMass& mass : added) {
      truth.insert(truth.find("inputs:\n"), "  - {name: " + mass.place + " " + mass.law +
                                                ", location: {kind: element, mass: " + mass.place +
                                                "}, law: " + mass.law +
                                                ", parameters: " + mass.parameters + "}\n");
    }
    const UnsettledDrive drive(truth);
    const auto family = plant_family(drive.model());
    PeriodicData data = read_periodic_data(drive.campaign(), *family, {});
    const Eigen::VectorXd own = family->start_values();
    std::vector<ActingLaw> laws;
    for (const AddedMass& mass : added) {
      laws.push_back(acting(*family, mass.place, mass.law, mass.values));
    }
    const ModelState model = evaluate_model(*family, data, own, laws, true, 1);
    clear_transients(*family, model, {}, data);
    const std::string what = std::to_string(added.size()) + " " + added.front().law;
    EXPECT_NEAR(chi_square_per_number(*family, model, data), 1.0, 0.05) << what;
    for (const VariationScore& score : variation_scores(*family, data, model, 1)) {
      EXPECT_GT(chi_square_tail(score.statistic, score.degrees_of_freedom), 1e-3)
          << what << ": " << score.place->location.name;
    }
  }
}

TEST(Transients, AreTakenOutWithAnotherModelThanTheTrueOne) {
  std::string truth = kRingingDrive;
  truth.replace(truth.find("value: 30,"), 10, "value: 27,");
  const UnsettledDrive drive(truth);
  const auto problem = periodic_mismatch_problem(drive.model(), drive.campaign());
  const ExtendedFit fit = problem->fit({}, nullptr);
  ASSERT_TRUE(fit.usable) << fit.trouble;
  EXPECT_NEAR(fit.estimation.chi_square_per_dof(), 1.0, 0.05);
  EXPECT_NEAR(problem->validate(fit)->chi_square_per_dof(), 1.0, 0.1);
  const std::vector<double> values{0.0021, 0.01, 27.0, 0.005, 0.05};
  ASSERT_EQ(fit.model_parameters.size(), values.size());
  for (std::size_t p = 0; p < values.size(); ++p) {
    const LawParameterEstimate& estimate = fit.model_parameters[p];
    EXPECT_NEAR(estimate.value, values[p], 4.0 * estimate.standard_error) << estimate.name;
  }
  const Diagnosis diagnosis = diagnose(*problem, {});
  EXPECT_EQ(diagnosis.verdict, Verdict::kNone);
}

}  // namespace
}  // namespace graybox
