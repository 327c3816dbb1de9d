// First fits of a flexible robot to its own recordings: several starts, one optimum; and the steady
// states that they are made of.
#include "diagnosis/periodic/periodic_fit.hpp"
#include "diagnosis/periodic/gradual_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/periodic/periodic_assessment.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/periodic/place_force_fit.hpp"
#include "diagnosis/periodic/response_starts.hpp"
#include "diagnosis/periodic/telling_recordings.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Recordings of the three-axis robot; what `changes` replace in its file is what the model
// believes. `hidden`: elements of a graybox-physics/1 file, or nothing.
class RecordedArm {
 public:
  RecordedArm(const std::string& level, const std::string& positions,
              const std::vector<std::pair<std::string, std::string>>& changes,
              const std::string& hidden = {}) {
    const std::filesystem::path robot =
        std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems/robot/three_axis.yaml";
    testing::write_text(folder_.file("plan.yaml"),
                        "format: graybox-plan/1\nplant: robot\nlevels: " + level +
                            "\nrealisations: 2\nperiod: 1000\nsettling_periods: 5\nperiods: 2\n"
                            "frequencies: {from: 2, to: 60, count: 20, spacing: log}\npositions: " +
                            positions + "\nnoise: 1e-13\n");
    std::optional<std::filesystem::path> physics;
    if (!hidden.empty()) {
      physics = folder_.file("hidden.yaml");
      testing::write_text(*physics, "format: graybox-physics/1\nelements:\n" + hidden);
    }
    const SimulatedSystem system = load_system(robot, physics);
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), {});
    std::string text = testing::read_text(robot.string());
    for (const auto& [is, believed] : changes) text.replace(text.find(is), is.size(), believed);
    testing::write_text(folder_.file("model.yaml"), text);
    std::filesystem::copy(robot.parent_path() / "three_axis.urdf", folder_.file("three_axis.urdf"));
    family = plant_family(folder_.file("model.yaml"));
    data = read_periodic_data(read_campaign(folder_.file("campaign")), *family, {});
    own = family->start_values();
  }

 private:
  testing::TemporaryFolder folder_;

 public:
  std::unique_ptr<PlantFamily> family;
  PeriodicData data;
  VectorXd own;
};

// The optimum does not depend on which start comes first.
TEST(FirstFits, EndInOneOptimumInWhateverOrderTheyBegin) {
  const RecordedArm arm("[2.0]", "[[20, 30, 40], [-60, 10, -30]]",
                        {{"4.0e4", "4.9e4"}, {"5.0e4", "4.2e4"}, {"1.5e4", "1.2e4"}});
  std::vector<VectorXd> starts = response_starts(*arm.family, arm.data, 1);
  ASSERT_FALSE(starts.empty());
  for (std::size_t i = 1; i < starts.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE((starts[i].array() / starts[j].array() - 1.0).abs().maxCoeff(), 0.05);
    }
  }
  starts.push_back(arm.own);
  const PeriodicFit fit = fit_periodic_gradually(*arm.family, arm.data, starts, {}, {});
  std::ranges::reverse(starts);
  const PeriodicFit other = fit_periodic_gradually(*arm.family, arm.data, starts, {}, {});
  ASSERT_TRUE(fit.converged && other.converged) << fit.trouble << other.trouble;
  EXPECT_NEAR(fit.chi_square / arm.data.numbers_in(arm.data.estimation), 1.0, 0.2);
  const VectorXd errors = standard_errors(fit.information);
  EXPECT_LT(((fit.parameters - other.parameters).array() / errors.array()).abs().maxCoeff(), 0.1);
}

// Three masses on springs; the second, which no sensor sees, rubs.
constexpr const char* kChain = R"(format: graybox-lumped/1
sample_time: 0.001
motion: translation
masses: {first: 1.4, second: 1.1, third: 0.9}
elements:
  - {name: mount, location: {kind: element, mass: first}, law: stiffness,
     parameters: {stiffness: {value: 5.1e3, unit: N/m}}}
  - {name: first link, location: {kind: element, between: [first, second]}, law: stiffness,
     parameters: {stiffness: {value: 5.1e3, unit: N/m}}}
  - {name: second link, location: {kind: element, between: [second, third]}, law: stiffness,
     parameters: {stiffness: {value: 4.9e3, unit: N/m}}}
  - {name: mount damping, location: {kind: element, mass: first}, law: viscous,
     parameters: {damping: {value: 9.6, unit: N s/m}}}
  - {name: first link damping, location: {kind: element, between: [first, second]}, law: viscous,
     parameters: {damping: {value: 7.1, unit: N s/m}}}
  - {name: second link damping, location: {kind: element, between: [second, third]}, law: viscous,
     parameters: {damping: {value: 8.0, unit: N s/m}}}
inputs:
  - {name: force_first, mass: first}
  - {name: force_third, mass: third}
outputs:
  - {name: position_first, mass: first, quantity: position}
  - {name: position_third, mass: third, quantity: position}
noise: {position_first: 4.5e-5, position_third: 2.7e-5}
)";
constexpr const char* kRubbing =
    R"(  - {name: rubbing, location: {kind: element, mass: second}, law: stribeck,
     parameters: {level: {value: 0.0045, unit: N}, static_level: {value: 0.0094, unit: N},
                  stribeck_velocity: {value: 0.063, unit: m/s},
                  transition_velocity: {value: 1e-3, unit: m/s}}}
)";

// Recordings of a chain that `hidden` elements are part of, which its model does not have.
class RecordedChain {
 public:
  RecordedChain(const std::string& model, const std::string& hidden, const std::string& levels) {
    std::string truth = model;
    truth.insert(truth.find("inputs:\n"), hidden);
    testing::write_text(folder_.file("model.yaml"), model);
    testing::write_text(folder_.file("truth.yaml"), truth);
    testing::write_text(folder_.file("plan.yaml"), "format: graybox-plan/1\nlevels: " + levels +
                                                       R"(
realisations: 2
period: 2000
settling_periods: 4
periods: 6
frequencies: {from: 1.5, to: 40, count: 20, spacing: log}
)");
    const SimulatedSystem system = load_system(folder_.file("truth.yaml"), std::nullopt);
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), {});
  }
  [[nodiscard]] std::filesystem::path model() const { return folder_.file("model.yaml"); }
  [[nodiscard]] Campaign campaign() const { return read_campaign(folder_.file("campaign")); }

 private:
  testing::TemporaryFolder folder_;
};

std::vector<ActingLaw> acting(const PlantFamily& family, const std::string& place,
                              const std::string& law, std::vector<double> values) {
  const auto found = std::ranges::find(
      family.places(), place, [](const CandidatePlace& each) { return each.location.name; });
  return {{&*found, find_law(law, false), std::move(values), {}}};
}

// A mass that swings at the end of the band is nearly the mass that carries it: along the valley
// between the two chi-square falls slowly, and the valley bends. Wherever a fit begins, it ends at
// the one optimum.
TEST(PeriodicFit, FollowsAValleyThatBendsToItsEnd) {
  const std::vector<double> swinging{0.004, 38.5, 0.055};
  std::string model = kChain;
  model.replace(model.find("noise: "), std::string::npos,
                "noise: {position_first: 5.9e-6, position_third: 8.8e-6}\n");
  const RecordedChain chain(
      model,
      R"(  - {name: swinging, location: {kind: element, mass: third}, law: mode,
     parameters: {inertia: {value: 0.004, unit: kg}, frequency: {value: 38.5, unit: Hz},
                  damping_ratio: {value: 0.055, unit: "1"}}}
)",
      "[4.0]");
  const auto family = plant_family(chain.model());
  const PeriodicData data = read_periodic_data(chain.campaign(), *family, {});
  std::optional<PeriodicFit> first;
  for (const double inertia : {1.0, 0.7, 1.2}) {
    for (const double frequency : {0.99, 1.01}) {
      const std::vector<double> start{inertia * swinging[0], frequency * swinging[1], 0.08};
      const PeriodicFit fit = fit_periodic(*family, data, {family->start_values()},
                                           acting(*family, "third", "mode", start), {});
      ASSERT_TRUE(fit.converged) << fit.trouble;
      if (!first) first = fit;
      EXPECT_NEAR(fit.chi_square, first->chi_square, 0.5) << inertia << " " << frequency;
    }
  }
  const VectorXd errors = standard_errors(first->information).tail(3);
  for (std::size_t p = 0; p < swinging.size(); ++p) {
    EXPECT_NEAR(first->laws[0].parameters[p], swinging[p], 4.0 * errors(static_cast<Index>(p)));
  }
}

// Laws of many parameters creep. Where one can't come below what another fit has come to it is
// given up, and only there.
TEST(PeriodicFit, IsGivenUpWhereItCannotWin) {
  const RecordedChain chain(kChain, kRubbing, "[1.4, 3.0]");
  const auto family = plant_family(chain.model());
  const PeriodicData data = read_periodic_data(chain.campaign(), *family, {});
  const auto fit_to_beat = [&](const std::string& law, const std::vector<double>& start,
                               double to_beat) {
    PeriodicFitOptions options;
    options.to_beat = to_beat;
    return fit_periodic(*family, data, {family->start_values()},
                        acting(*family, "second", law, start), options);
  };
  const std::vector<double> bristles{100.0, 0.1, 0.1, 0.02, 0.03, 0.3};
  const PeriodicFit whole = fit_to_beat("lugre", bristles, std::numeric_limits<double>::infinity());
  ASSERT_TRUE(whole.converged) << whole.trouble;
  const PeriodicFit given_up = fit_to_beat("lugre", bristles, whole.chi_square - 100.0);
  EXPECT_FALSE(given_up.converged);
  EXPECT_EQ(given_up.trouble, "another fit is better");
  EXPECT_LT(given_up.iterations, whole.iterations);
  EXPECT_GT(given_up.chi_square, whole.chi_square);
  const PeriodicFit winner = fit_to_beat("lugre", bristles, whole.chi_square + 1.0);
  EXPECT_TRUE(winner.converged) << winner.trouble;
  EXPECT_EQ(winner.chi_square, whole.chi_square);
}

// With a transition velocity far below all that is reached friction jumps, and where no motion is
// found under it the recordings are fitted by a force that was taken from them.
TEST(PeriodicFit, HasNotConvergedWhereNoSteadyStateIsFound) {
  const RecordedChain chain(kChain, kRubbing, "[1.4, 3.0]");
  const auto problem = periodic_mismatch_problem(chain.model(), chain.campaign());
  const ExtendedFit alone = problem->fit({}, nullptr);
  const std::span<const Hypothesis> all = problem->hypotheses();
  const auto there = std::ranges::find_if(
      all, [](const Hypothesis& h) { return h.law == "coulomb" && h.place == "second"; });
  ASSERT_NE(there, all.end());
  const auto coulomb = static_cast<std::size_t>(there - all.begin());
  const std::vector<LawStart> smooth{{.hypothesis = coulomb, .parameters = {0.008, 1e-2}}};
  const ExtendedFit optimum = problem->fit(smooth, &alone);
  ASSERT_TRUE(optimum.usable) << optimum.trouble;
  int without = 0;
  for (const double transition : {1e-9, 1e-6, 2e-5, 3e-5, 4e-5, 6e-5, 1e-4, 1e-3}) {
    std::vector<LawStart> start{{.hypothesis = coulomb, .parameters = {0.008, transition}}};
    ExtendedFit fit = problem->fit(start, &alone);
    if (!fit.usable) {
      ++without;
      EXPECT_EQ(fit.trouble, "no steady state under the laws was found");
      start.front().spares = {{0.008, 1e-3}};
      fit = problem->fit(start, &alone);
    }
    EXPECT_TRUE(fit.usable) << transition << ": " << fit.trouble;
    EXPECT_NEAR(fit.deviance, optimum.deviance, 10.0) << transition;
  }
  EXPECT_GE(without, 1);
}

// A motion that is in part the recording's own predicts nothing of that part. Friction with
// transitions ever narrower does ever the same to the motion, also where that is no longer found.
TEST(PeriodicAssessment, CountsWhatIsLeftOfASearchAsError) {
  const RecordedChain chain(kChain, kRubbing, "[1.4, 3.0]");
  const auto family = plant_family(chain.model(), {});
  const PeriodicData data = read_periodic_data(chain.campaign(), *family, {});
  SteadyStateSolver solver(*family, data, {});
  const double numbers = data.numbers_in(data.estimation);
  struct Sums {
    double found = 0.0, left = 0.0, assessed = 0.0;
  };
  const auto sums_at = [&](double transition) {
    const ModelState model =
        evaluate_model(*family, data, family->start_values(),
                       acting(*family, "second", "coulomb", {0.008, transition}), true, 1);
    Sums sums;
    for (const MeasuredRecord& record : data.estimation) {
      const SteadyState& state = solver.solve(model, record, nullptr);
      sums.found += state.chi_square;
      sums.left = std::max(sums.left, state.unsettled);
    }
    const Assessment all = assess_records(*family, data, model, data.estimation, 0, 1);
    sums.assessed = all.chi_square_per_dof() * numbers;
    return sums;
  };
  const Sums settled = sums_at(1e-3);
  ASSERT_LT(settled.left, SteadyStateOptions{}.tolerance);
  EXPECT_NEAR(settled.assessed, settled.found, 1e-9 * settled.found);
  for (const double transition : {1e-4, 5e-5, 3e-5, 1e-5}) {
    const Sums lost = sums_at(transition);
    EXPECT_GT(lost.left, 0.3) << transition;
    EXPECT_LT(lost.found, 0.92 * settled.found) << transition;
    EXPECT_NEAR(lost.assessed, settled.assessed, 0.05 * settled.assessed) << transition;
  }
}

// The three of five positions that have the most information of all choices of three, or nearly;
// all where there are few.
TEST(TellingRecordings, AreOfThePositionsThatTellMost) {
  const RecordedArm arm(
      "[1.0]", "[[20, 30, 40], [21, 30, 40], [22, 31, 40], [-60, 80, -70], [0, -40, 90]]", {});
  const std::vector<std::size_t> telling =
      telling_recordings(*arm.family, arm.data, arm.own, {}, 1);
  EXPECT_EQ(telling, telling_recordings(*arm.family, arm.data, arm.own, {}, 2));
  EXPECT_TRUE(std::ranges::is_sorted(telling));
  std::set<std::size_t> chosen;
  std::map<std::pair<std::size_t, double>, int> kinds;
  for (const std::size_t i : telling) {
    const MeasuredRecord& record = arm.data.estimation[i];
    chosen.insert(record.position);
    ++kinds[{record.position, record.level}];
  }
  ASSERT_EQ(chosen.size(), kTellingPositions);
  EXPECT_EQ(kinds.size(), kTellingPositions);
  // Information of each position by fits that stop where they start: no choice of three has more.
  PeriodicFitOptions at_start;
  at_start.iteration_limit = 0;
  std::vector<Eigen::MatrixXd> information;
  for (std::size_t position = 0; position < 5; ++position) {
    std::vector<std::size_t> records;
    for (std::size_t i = 0; i < arm.data.estimation.size(); ++i) {
      if (arm.data.estimation[i].position == position) records.push_back(i);
    }
    information.push_back(
        fit_periodic(*arm.family, with_records(arm.data, records), {arm.own}, {}, at_start)
            .information);
  }
  double largest = -1e300, of_chosen = 0.0;
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      for (std::size_t k = 0; k < j; ++k) {
        const double value =
            std::log((information[i] + information[j] + information[k]).determinant());
        largest = std::max(largest, value);
        if (chosen == std::set<std::size_t>{i, j, k}) of_chosen = value;
      }
    }
  }
  EXPECT_NEAR(of_chosen, largest, 0.1);

  const RecordedArm few("[1.0]", "[[20, 30, 40], [-60, 80, -70]]", {});
  std::set<std::size_t> positions;
  for (const std::size_t i : telling_recordings(*few.family, few.data, few.own, {}, 1)) {
    positions.insert(few.data.estimation[i].position);
  }
  EXPECT_EQ(positions.size(), 2U);
  std::vector<std::size_t> all(arm.data.estimation.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const std::vector<std::size_t> first = first_of_each_kind(arm.data, all);
  EXPECT_EQ(first.size(), 5U);  // one level, and all inputs move in all experiments
  EXPECT_EQ(first_of_each_kind(arm.data, first), first);
  const PeriodicData kept = with_records(arm.data, telling);
  EXPECT_EQ(kept.estimation.size(), telling.size());
  EXPECT_EQ(kept.estimation.front().name, arm.data.estimation[telling.front()].name);
}

constexpr const char* kHardening =
    "  - name: hidden\n    location: {kind: element, joint: joint_2, axis: gearbox}\n"
    "    law: cubic_spring\n    parameters: {stiffness: {value: 2.0e9, unit: N m/rad^3}}\n";
constexpr double kHardeningStiffness = 2e9;

std::vector<ActingLaw> acting(const RecordedArm& arm, const std::string& place,
                              const std::string& law, std::vector<double> values) {
  return acting(*arm.family, place, law, std::move(values));
}

// A gearbox that hardens so strongly that the model alone fits nowhere, and pulls its parameters
// far off: with its law the fit must not begin there.
TEST(FitsIfNear, FindALawFromTheModelsOwnValues) {
  const RecordedArm arm("[2.0, 6.0]", "[[20, 30, 40]]", {{"4.0e4", "3.6e4"}, {"1.5e4", "1.6e4"}},
                        kHardening);
  const double numbers = arm.data.numbers_in(arm.data.estimation);
  const PeriodicFit alone = fit_periodic_gradually(*arm.family, arm.data, {arm.own}, {}, {});
  EXPECT_GT(alone.chi_square / numbers, 100.0);
  const PeriodicFit fit = fit_periodic_if_near(
      *arm.family, arm.data, {arm.own},
      acting(arm, "joint_2.gearbox", "cubic_spring", {0.5 * kHardeningStiffness}), {});
  ASSERT_TRUE(fit.converged) << fit.trouble;
  EXPECT_NEAR(fit.chi_square / numbers, 1.0, 0.2);
  EXPECT_EQ(fit.start, arm.own);
  const VectorXd errors = standard_errors(fit.information);
  EXPECT_NEAR(fit.laws[0].parameters[0], kHardeningStiffness, 4.0 * errors(errors.size() - 1));
  // Another law comes nowhere near, and is not followed to its end.
  const PeriodicFit other = fit_periodic_if_near(
      *arm.family, arm.data, {arm.own}, acting(arm, "joint_1.gearbox", "viscous", {10.0}), {});
  EXPECT_FALSE(other.converged);
  EXPECT_FALSE(other.trouble.empty());
}

// With any force allowed at its place, the other parameters come out right without a word about the
// law, and then the law from that force; the spring beside it can't be told before. Elsewhere
// nothing comes near.
TEST(FreedFits, FindParametersWithoutTheLawAndTheLawFromItsForce) {
  const RecordedArm arm("[2.0, 6.0]", "[[20, 30, 40], [-60, 10, -30]]",
                        {{"4.0e4", "3.4e4"}, {"5.0e4", "5.9e4"}, {"1.5e4", "1.75e4"}}, kHardening);
  // Factors of the springs of the file; the bearing is right.
  const VectorXd truth{{4.0 / 3.4, 5.0 / 5.9, 1.5 / 1.75, 1.0}};
  std::vector<ActingLaw> laws = acting(arm, "joint_2.gearbox", "cubic_spring", {2e8});
  ASSERT_TRUE(can_free(arm.data, laws[0]));
  std::vector<VectorXd> starts = response_starts(*arm.family, arm.data, 1);
  starts.push_back(arm.own);
  const PeriodicFit freed =
      freed_fit(*arm.family, arm.data, starts, {}, laws[0].place->location, {});
  ASSERT_TRUE(freed.converged);
  ASSERT_EQ(freed.imitated.size(), 4U);
  for (Index p = 0; p < 4; ++p) {
    const bool is_beside =
        arm.family->parameters()[static_cast<std::size_t>(p)].name == laws[0].place->location.name;
    EXPECT_EQ(freed.imitated[static_cast<std::size_t>(p)], is_beside);
    EXPECT_NEAR(freed.parameters(p), is_beside ? freed.start(p) : truth(p), 0.01 * truth(p)) << p;
  }
  const PlaceForceFit force = fit_place_force(*arm.family, arm.data, freed, laws[0]);
  ASSERT_TRUE(force.usable);
  EXPECT_LT(force.left, 0.05);
  EXPECT_LT((force.parameters - truth).cwiseAbs().maxCoeff(), 0.05);
  EXPECT_NEAR(force.law.parameters[0] / kHardeningStiffness, 1.0, 0.05);
  // Friction leaves most of such a force.
  EXPECT_GT(fit_place_force(*arm.family, arm.data, freed,
                            acting(arm, "joint_2.gearbox", "viscous", {10.0})[0])
                .left,
            0.5);

  const PeriodicFit fit = fit_periodic_after_freed(*arm.family, arm.data, freed, laws[0], {});
  ASSERT_TRUE(fit.converged) << fit.trouble;
  EXPECT_NEAR(fit.chi_square / arm.data.numbers_in(arm.data.estimation), 1.0, 0.2);
  EXPECT_LT((fit.parameters - truth).cwiseAbs().maxCoeff(), 5e-4);
  EXPECT_NEAR(fit.laws[0].parameters[0] / kHardeningStiffness, 1.0, 1e-3);

  // Beside another law, which does nothing, and one at the same place, which can't be told from any
  // force there.
  std::vector<ActingLaw> others = acting(arm, "joint_1.gearbox", "viscous", {1.0});
  others.push_back(acting(arm, "joint_2.gearbox", "viscous", {0.0})[0]);
  const PeriodicFit beside =
      freed_fit(*arm.family, arm.data, starts, others, laws[0].place->location, {});
  ASSERT_TRUE(beside.converged);
  EXPECT_EQ(beside.imitated, freed.imitated);
  ASSERT_EQ(beside.laws.size(), 2U);
  EXPECT_NEAR(beside.laws[0].parameters[0], 0.0,
              4.0 * standard_errors(beside.information)(4));  // of raised noise
  EXPECT_EQ(beside.laws[1].parameters[0], 0.0);
  const PeriodicFit all = fit_periodic_after_freed(*arm.family, arm.data, beside, laws[0], {});
  ASSERT_TRUE(all.converged) << all.trouble;
  ASSERT_EQ(all.laws.size(), 3U);
  EXPECT_NEAR(all.laws[2].parameters[0] / kHardeningStiffness, 1.0, 1e-3);

  const PeriodicFit elsewhere =
      freed_fit(*arm.family, arm.data, starts, {},
                acting(arm, "joint_1.gearbox", "viscous", {10.0})[0].place->location, {});
  EXPECT_FALSE(elsewhere.converged);
}

// A spring that yields to the weight moves the rest of the law beside it, and where that is steep
// the law's slope: derivatives know it. Against central differences of the outputs.
TEST(SteadyStates, DerivativesAreThoseOfDifferences) {
  const RecordedArm arm("[4.0]", "[[20, 60, 40]]", {});
  const std::vector<ActingLaw> laws =
      acting(arm, "joint_2.gearbox", "cubic_spring", {4.0 * kHardeningStiffness});
  const SteadyStateOptions precise{.iteration_limit = 60, .tolerance = 1e-6};
  SteadyStateSolver solver(*arm.family, arm.data, precise);
  const MeasuredRecord& record = arm.data.estimation.front();
  const auto residual_at = [&](const VectorXd& parameters, double stiffness) {
    std::vector<ActingLaw> moved = laws;
    moved[0].parameters[0] = stiffness;
    const ModelState model = evaluate_model(*arm.family, arm.data, parameters, moved, true, 1);
    const SteadyState& state = solver.solve(model, record, nullptr);
    EXPECT_LE(state.unsettled, precise.tolerance);
    return Eigen::VectorXcd(state.residual.reshaped());
  };
  const double stiffness = laws[0].parameters[0];
  const ModelState model = evaluate_model(*arm.family, arm.data, arm.own, laws, true, 1);
  solver.solve(model, record, nullptr);
  Eigen::MatrixXcd jacobian;
  solver.differentiate(model, record, true, jacobian);
  constexpr double kStep = 1e-4;
  for (Index p = 0; p < jacobian.cols(); ++p) {
    VectorXd above = arm.own, below = arm.own;
    double stiffer = stiffness, softer = stiffness;
    if (p < arm.own.size()) {
      above(p) *= 1.0 + kStep;
      below(p) *= 1.0 - kStep;
    } else {
      stiffer *= 1.0 + kStep;
      softer *= 1.0 - kStep;
    }
    const double step = p < arm.own.size() ? above(p) - below(p) : stiffer - softer;
    const Eigen::VectorXcd difference =
        (residual_at(below, softer) - residual_at(above, stiffer)) / step;
    // Not to rounding: they leave out how the arm's own forces answer.
    EXPECT_LT((jacobian.col(p) - difference).norm(), 0.03 * difference.norm()) << p;
  }
}

// A motion found from that of slightly other parameters is not that motion still.
TEST(SteadyStates, DoNotDependOnWhereTheyWereSoughtFrom) {
  const RecordedArm arm("[4.0]", "[[20, 60, 40]]", {});
  const MeasuredRecord& record = arm.data.estimation.front();
  SteadyStateSolver solver(*arm.family, arm.data, {});
  const auto state_of = [&](const std::vector<ActingLaw>& laws, const Eigen::MatrixXcd* start) {
    const ModelState model = evaluate_model(*arm.family, arm.data, arm.own, laws, true, 1);
    return SteadyState(solver.solve(model, record, start));
  };
  const auto rms = [](const SteadyState& one, const SteadyState& other) {
    const Eigen::MatrixXcd difference = one.residual - other.residual;
    return difference.norm() / std::sqrt(2.0 * static_cast<double>(difference.size()));
  };
  for (std::vector<ActingLaw> laws :
       {acting(arm, "joint_2.gearbox", "cubic_spring", {kHardeningStiffness}),
        acting(arm, "joint_2.motor", "coulomb", {2e-3, 0.5})}) {
    const double value = laws[0].parameters[0];
    const SteadyState from = state_of(laws, nullptr);
    double change = 1e-3, moved = 1.0;
    for (; change > 1e-9 && moved > 0.5 * SteadyStateOptions{}.tolerance; change *= 0.5) {
      laws[0].parameters[0] = value * (1.0 + change);
      moved = rms(state_of(laws, nullptr), from);
    }
    ASSERT_GT(change, 1e-9);
    const SteadyState anew = state_of(laws, nullptr);
    EXPECT_LT(rms(state_of(laws, &from.forces), anew), 0.2 * moved) << laws[0].entry->name;
  }
}

// By substitution alone this motion, far beyond what the arm's equations of second order are good
// for, does not settle in 25 passes.
TEST(SteadyStates, OfFastMotionSettle) {
  const RecordedArm arm("[120.0]", "[[20, 30, 40]]", {});
  const ModelState model = evaluate_model(*arm.family, arm.data, arm.own, {}, false, 1);
  SteadyStateSolver solver(*arm.family, arm.data, {});
  for (const MeasuredRecord& record : arm.data.estimation) {
    EXPECT_LE(solver.solve(model, record, nullptr).unsettled, SteadyStateOptions{}.tolerance)
        << record.name;
  }
}

}  // namespace
}  // namespace graybox
