// What changes while it is recorded: found where it is, and nowhere else.
#include "diagnosis/free_motion/time_variation.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/free_motion/transients.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/random.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/two_mass_drive.hpp"

namespace graybox {
namespace {

using Eigen::Index;

std::string plan(int periods) {
  return R"(format: graybox-plan/1
levels: [0.1, 0.3]
realisations: 3
validation_realisations: 1
period: 500
settling_periods: 6
periods: )" +
         std::to_string(periods) + R"(
frequencies: {from: 1, to: 60, count: 40, spacing: log}
detection_lines: 4
)";
}

using Course = std::function<double(double time)>;

// f = s(t) z or s(t) z', its clock a state.
class ChangingLaw final : public Law {
 public:
  ChangingLaw(Course course, bool is_damping)
      : course_(std::move(course)), is_damping_(is_damping) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double z, double rate, std::span<const double> state) const override {
    return course_(state[0]) * (is_damping_ ? rate : z);
  }
  void state_rate(double, double, std::span<const double>,
                  std::span<double> state_rate) const override {
    state_rate[0] = 1.0;
  }
  void differentiate(double z, double rate, std::span<const double> state,
                     LawDerivatives& result) const override {
    result.force.value = force(z, rate, state);
    result.force.by_deflection = is_damping_ ? 0.0 : course_(state[0]);
    result.force.by_rate = is_damping_ ? course_(state[0]) : 0.0;
    result.force.by_state[0] = 0.0;
    result.state_rate[0] = {};
    result.state_rate[0].value = 1.0;
  }

 private:
  Course course_;
  bool is_damping_;
};

Element changing(const Eigen::Vector2d& place, Course course, bool is_damping) {
  Element element;
  element.name = "change";
  element.law_name = "change";
  element.location.input = element.location.output = place;
  element.parameters = {1.0};
  element.law = std::make_shared<const ChangingLaw>(std::move(course), is_damping);
  return element;
}

// A drive of two masses whose spring is 10 % stiffer in the model, with something more.
class ChangingDrive {
 public:
  explicit ChangingDrive(std::vector<Element> more, std::uint64_t seed = 1, int periods = 3) {
    testing::write_text(folder_.file("truth.yaml"), testing::two_mass_drive("30", "0.03"));
    testing::write_text(folder_.file("model.yaml"), testing::two_mass_drive("33", "0.03"));
    testing::write_text(folder_.file("plan.yaml"), plan(periods));
    SimulatedSystem system = load_system(folder_.file("truth.yaml"));
    LumpedModel truth = load_lumped_model(folder_.file("truth.yaml"));
    std::ranges::move(more, std::back_inserter(truth.elements));
    system.plant = [truth](SimulatedSystem::PlantKind, const Eigen::VectorXd&) {
      return lumped_plant(truth);
    };
    SimulationOptions options;
    options.seed = seed;
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), options);
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> problem() const {
    return periodic_mismatch_problem(folder_.file("model.yaml"),
                                     read_campaign(folder_.file("campaign")));
  }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const {
    return folder_.file(name);
  }

 private:
  testing::TemporaryFolder folder_;
};

// A drive freed of its free motion by the model as it is.
struct ClearedDrive {
  std::unique_ptr<PlantFamily> family;
  PeriodicData data;
  ModelState model;

  explicit ClearedDrive(const ChangingDrive& drive)
      : family(plant_family(drive.file("model.yaml"))),
        data(read_periodic_data(read_campaign(drive.file("campaign")), *family, {})) {
    const Eigen::VectorXd parameters = family->start_values();
    model = evaluate_model(*family, data, parameters, {}, false, 1);
    clear_transients(*family, model, {}, data);
  }
};

const Eigen::Vector2d kShaft(1.0, -1.0);
const Eigen::Vector2d kLoad(0.0, 1.0);

double turn(double share) { return 2.0 * std::numbers::pi * share; }

TEST(TimeVariation, FindsTheStiffnessThatSwings) {
  const double size = 0.3;  // N m/rad, a hundredth of the shaft's
  const ChangingDrive drive({changing(
      kShaft, [=](double t) { return size * std::sin(turn(t / 2.2)); }, false)});
  const auto problem = drive.problem();
  const Diagnosis diagnosis = diagnose(*problem);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_TRUE(diagnosis.detection.detected);
  ASSERT_TRUE(diagnosis.time_variation);
  const TimeVariation& change = *diagnosis.time_variation;
  EXPECT_EQ(change.place, "motor-load");
  EXPECT_EQ(change.coefficient, "stiffness");
  EXPECT_EQ(change.unit, "N m/rad");
  EXPECT_LT(change.p_value, 1e-10);
  EXPECT_NEAR(change.deviation, size / std::numbers::sqrt2, 0.25 * size);
  EXPECT_DOUBLE_EQ(change.duration, 3.0);
  EXPECT_NEAR(change.frequency, 1.0 / 2.2, 1.0 / 3.0);
}

TEST(TimeVariation, FindsTheFrictionThatWarmsUp) {
  const ChangingDrive drive({changing(
      kLoad, [](double t) { return 0.02 * std::exp(-(t - 6.0) / 1.5); }, true)});
  const auto problem = drive.problem();
  const ExtendedFit fit = problem->fit({}, nullptr);
  const auto change = problem->time_variation(fit, 0.0);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->place, "load");
  EXPECT_EQ(change->coefficient, "damping");
  EXPECT_LT(change->p_value, 1e-6);
  // It falls: the first third lies above the last.
  ASSERT_GT(change->course.size(), 30U);
  double first = 0.0, last = 0.0;
  const std::size_t third = change->course.size() / 3;
  for (std::size_t i = 0; i < third; ++i) {
    first += change->course[i];
    last += change->course[change->course.size() - 1 - i];
  }
  EXPECT_GT(first, last);
}

TEST(TimeVariation, IsNotSeenWhereNothingChanges) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const auto problem = ChangingDrive({}, seed).problem();
    const auto change = problem->time_variation(problem->fit({}, nullptr), 0.0);
    EXPECT_GT(change ? change->p_value : 1.0, 1e-3);
  }
}

// A sensor whose gain changes, made in time: s(t) y(t), y the model's steady state, and its
// discrete Fourier transform term by term.
TEST(TimeVariation, CourseIsThatOfTheChangeMade) {
  for (const int periods : {2, 3, 4}) {
    ClearedDrive cleared{ChangingDrive({}, 1, periods)};
    auto& [family, data, model] = cleared;
    constexpr Index kChannel = 1;
    const Index samples = static_cast<Index>(data.period) * periods;
    std::vector<double> course(static_cast<std::size_t>(samples));
    for (Index n = 0; n < samples; ++n) {
      const double t = static_cast<double>(n) / static_cast<double>(samples);
      double& s = course[static_cast<std::size_t>(n)];
      s = 0.02 * std::cos(turn(t) + 0.4);
      if (periods > 2) s += 0.01 * std::sin(turn(2.0 * t));
      if (periods > 3) s += 0.005 * std::cos(turn(3.0 * t) - 1.0);
    }
    SteadyStateSolver solver(*family, data, {});
    for (auto* list : {&data.estimation, &data.validation}) {
      for (MeasuredRecord& record : *list) {
        const Eigen::MatrixXcd lines = solver.solve(model, record, nullptr).output;
        std::vector<double> changed(static_cast<std::size_t>(samples));
        for (Index n = 0; n < samples; ++n) {
          double y = 0.0;  // up to the scale of a spectrum, the same for all
          for (Index k = 1; k < lines.cols(); ++k) {
            const double angle = turn(static_cast<double>(k * n % static_cast<Index>(data.period)) /
                                      static_cast<double>(data.period));
            y += 2.0 * (lines(kChannel, k) * std::polar(1.0, angle)).real();
          }
          changed[static_cast<std::size_t>(n)] = course[static_cast<std::size_t>(n)] * y;
        }
        record.between_lines.setZero();
        for (Index bin = 1; bin < record.between_lines.cols(); ++bin) {
          std::complex<double> sum = 0.0;
          for (Index n = 0; n < samples; ++n) {
            const double angle =
                turn(static_cast<double>(bin * n % samples) / static_cast<double>(samples));
            sum += changed[static_cast<std::size_t>(n)] * std::polar(1.0, -angle);
          }
          record.between_lines(kChannel, bin) = sum / static_cast<double>(samples);
        }
        data.whitening[record.group].assign(data.whitening[record.group].size(),
                                            1e6 * Eigen::MatrixXcd::Identity(2, 2));
      }
    }
    const auto scores = variation_scores(*family, data, model, 1);
    const auto best = std::ranges::max_element(scores, {}, &VariationScore::statistic);
    ASSERT_NE(best, scores.end());
    EXPECT_EQ(best->place->location.name, "sensor load_speed") << periods;
    EXPECT_EQ(best->coefficient, Coefficient::kGain);
    double power = 0.0;
    for (const double s : course) power += s * s / static_cast<double>(samples);
    EXPECT_NEAR(best->deviation, std::sqrt(power), 0.01 * std::sqrt(power));
    const auto steps = static_cast<Index>(best->course.size()) - 1;
    for (Index i = 0; i < steps; ++i) {
      EXPECT_NEAR(best->course[static_cast<std::size_t>(i)],
                  course[static_cast<std::size_t>(i * samples / steps)], 3e-4);
    }
    EXPECT_DOUBLE_EQ(best->frequency * best->duration, 1.0);
  }
}

// What is left between the lines drawn anew as noise: the statistics are chi-square, correlated or
// not.
TEST(TimeVariation, StatisticsAreChiSquareUnderNoise) {
  const ChangingDrive drive({});
  ClearedDrive cleared(drive);
  auto& [family, data, model] = cleared;
  constexpr int kDraws = 300;
  Random random(5);
  std::vector<int> beyond;
  for (int draw = 0; draw < kDraws; ++draw) {
    for (auto* list : {&data.estimation, &data.validation}) {
      for (MeasuredRecord& record : *list) {
        for (Index bin = 1; bin < record.between_lines.cols(); ++bin) {
          const Index line = (bin + (record.periods - 1) / 2) / record.periods;
          if (line < data.first_line || line > data.last_line) continue;
          Eigen::VectorXcd unit(record.between_lines.rows());
          for (std::complex<double>& value : unit) value = {random.normal(), random.normal()};
          record.between_lines.col(bin) =
              data.whitening[record.group][static_cast<std::size_t>(line)].lu().solve(unit);
        }
      }
    }
    const auto scores = variation_scores(*family, data, model, 1);
    beyond.resize(scores.size());
    for (std::size_t i = 0; i < scores.size(); ++i) {
      // 2 (P - 1) of 6 recordings.
      EXPECT_EQ(scores[i].degrees_of_freedom, 24.0);
      beyond[i] +=
          chi_square_tail(scores[i].statistic, scores[i].degrees_of_freedom) < 0.05 ? 1 : 0;
    }
  }
  const double expected = 0.05 * kDraws, deviation = std::sqrt(expected * 0.95);
  for (const int count : beyond) EXPECT_NEAR(count, expected, 3.5 * deviation);
}

TEST(TimeVariation, DoesNotDependOnTheThreads) {
  const ChangingDrive drive({changing(
      kShaft, [](double t) { return 0.3 * std::sin(turn(t / 2.2)); }, false)});
  ClearedDrive cleared(drive);
  auto& [family, data, model] = cleared;
  const auto one = variation_scores(*family, data, model, 1);
  const auto two = variation_scores(*family, data, model, 2);
  ASSERT_EQ(one.size(), two.size());
  ASSERT_FALSE(one.empty());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].statistic, two[i].statistic);
    EXPECT_EQ(one[i].course, two[i].course);
  }
}

}  // namespace
}  // namespace graybox
