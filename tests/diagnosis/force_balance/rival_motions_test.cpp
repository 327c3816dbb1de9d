// Motions that tell two explanations of a balance of forces apart, against least squares by hand
// and against the experiment itself.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/verdict/next_plan.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "tests/support/carriage_files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMass = 12.0;
constexpr double kFrequency = 1.7;  // rad/s

struct Moment {
  double x = 0.0, v = 0.0, a = 0.0;
};

// There and back at a speed that hardly varies: rounded triangles. Fourier series of
// v = v0 tanh(k sin wt) to the 19th harmonic, so that all three are exact.
Moment triangle(double t) {
  constexpr double kSpeed = 0.4, kSharpness = 6.0;
  constexpr int kPoints = 400;
  static const std::array<double, 10> kHarmonics = [] {
    std::array<double, 10> sines{};
    for (std::size_t n = 0; n < sines.size(); ++n) {
      for (int i = 0; i < kPoints; ++i) {
        const double angle = 2.0 * M_PI * i / kPoints;
        sines[n] += 2.0 / kPoints * kSpeed * std::tanh(kSharpness * std::sin(angle)) *
                    std::sin(static_cast<double>(2 * n + 1) * angle);
      }
    }
    return sines;
  }();
  Moment moment;
  for (std::size_t n = 0; n < kHarmonics.size(); ++n) {
    const double w = static_cast<double>(2 * n + 1) * kFrequency;
    moment.x -= kHarmonics[n] / w * std::cos(w * t);
    moment.v += kHarmonics[n] * std::sin(w * t);
    moment.a += kHarmonics[n] * w * std::cos(w * t);
  }
  return moment;
}

// A carriage whose friction cannot be told from its recordings: dry or viscous, at one speed.
class RivalMotion : public ::testing::Test {
 protected:
  void SetUp() override { std::ofstream(folder_.file("drive.yaml")) << testing::kCarriageModel; }

  // The triangle with this amplitude and speed.
  void record(const std::string& name, double amplitude, double speed, double phase = 0.0) {
    std::ofstream file(folder_.file(name + ".csv"));
    file.precision(12);
    file << "force,x,v,a\n";
    for (int k = 0; k < kSamples; ++k) {
      const Moment moment = triangle(speed * 0.01 * k + phase);
      const double v = amplitude * speed * moment.v, a = amplitude * speed * speed * moment.a;
      file << kMass * a + 8.0 * std::tanh(v / 0.002) + noise_ * random_.normal() << ','
           << amplitude * moment.x << ',' << v << ',' << a << '\n';
    }
    files_.push_back(name);
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> problem() const {
    std::ofstream campaign(folder_.file("campaign.yaml"));
    campaign << testing::kCarriageCampaign;
    for (const std::string& name : files_) {
      campaign << "  - {file: " << name << ".csv"
               << (name.starts_with("kept_out") ? ", role: validation}\n" : "}\n");
    }
    campaign.close();
    return force_balance_problem(
        folder_.file("drive.yaml"),
        read_campaign(fs::path(folder_.file("campaign.yaml")).parent_path()));
  }

  static constexpr int kSamples = 1500;
  testing::TemporaryFolder folder_;
  Random random_{11};
  double noise_ = 0.5;  // N
  std::vector<std::string> files_;
};

std::size_t index_of(const MismatchProblem& problem, const std::string& law) {
  for (std::size_t h = 0; h < problem.hypotheses().size(); ++h) {
    if (problem.hypotheses()[h].law == law) return h;
  }
  return problem.hypotheses().size();
}

// 100 Hz at 0.3 m/s: samples are 3 mm apart, and show waves of 12 mm at the least.
TEST_F(RivalMotion, ARippleThatTheSamplesDoNotShowIsNoLaw) {
  record("run_1", 0.8, 1.0);
  record("kept_out_1", 0.8, 1.0, 0.3);
  const auto balance = problem();
  const auto fitted = [&](double period) {
    const std::vector<LawStart> laws{
        {.hypothesis = index_of(*balance, "ripple"), .parameters = {1.0, period, 0.0}}};
    return balance->fit(laws, nullptr);
  };
  EXPECT_TRUE(fitted(0.2).usable);
  for (const double period : {0.002, 0.005, 0.008}) {
    const ExtendedFit close = fitted(period);
    if (close.usable) {
      EXPECT_GT(close.laws[0].parameters[1].value, 0.01);
    } else {
      EXPECT_EQ(close.trouble, "a ripple is shorter than the samples show");
    }
  }
}

double law_force(const MismatchProblem& problem, const FittedLaw& law, double x, double v) {
  const LawEntry* entry = find_law(problem.hypotheses()[law.hypothesis].law, false);
  return entry->make(law.values())->force(x, v, {});
}

// The least of the mean squares of r - J theta over the recording, and over a motion beside it if
// there is one: y = mass a + damping v by the one explanation, by the other with its own numbers.
class ByHand {
 public:
  ByHand(const MismatchProblem& problem, const ExtendedFit& viscous, const ExtendedFit& dry)
      : problem_(problem), viscous_(viscous), dry_(dry) {
    std::vector<Moment> moments;
    for (int k = 0; k < 1500; ++k) moments.push_back(triangle(0.01 * k));
    add(moments);
  }
  void add(const std::vector<Moment>& moments) {
    const double scale = 1.0 / std::sqrt(static_cast<double>(moments.size()));
    const Index first = rows_.rows(), count = static_cast<Index>(moments.size());
    rows_.conservativeResize(first + count, 3);
    for (Index i = 0; i < count; ++i) {
      const Moment& at = moments[static_cast<std::size_t>(i)];
      const double mass = dry_.model_parameters[0].value - viscous_.model_parameters[0].value;
      const double difference = mass * at.a + law_force(problem_, dry_.laws[0], at.x, at.v) -
                                law_force(problem_, viscous_.laws[0], at.x, at.v);
      rows_.row(first + i) << scale * at.a, scale * at.v, scale * difference;
    }
  }
  [[nodiscard]] double distance() const {
    const MatrixXd columns = rows_.leftCols(2);
    const VectorXd best = columns.colPivHouseholderQr().solve(rows_.col(2));
    return (rows_.col(2) - columns * best).squaredNorm();
  }

 private:
  const MismatchProblem& problem_;
  const ExtendedFit& viscous_;
  const ExtendedFit& dry_;
  MatrixXd rows_;
};

double distance_of(const RivalExperiments& experiments, std::size_t option) {
  const std::size_t d = experiments.information.dimension();
  MatrixXd matrix(static_cast<Index>(d), static_cast<Index>(d));
  unpack(experiments.information.information(option).data(), d, matrix.data());
  const auto last = static_cast<Index>(d) - 1;
  return 1.0 / matrix.inverse()(last, last);
}

TEST_F(RivalMotion, TheDistanceIsWhatLeastSquaresLeave) {
  record("run", 1.0, 1.0);
  const auto data = problem();
  const ExtendedFit viscous = data->fit({{{index_of(*data, "viscous"), {20.0}}}}, nullptr);
  const ExtendedFit dry = data->fit({{{index_of(*data, "coulomb"), {8.0, 0.002}}}}, nullptr);
  ASSERT_TRUE(viscous.usable && dry.usable);
  const auto experiments = data->experiments_between(viscous, dry);
  ASSERT_TRUE(experiments.has_value());
  EXPECT_EQ(experiments->recordings, 1.0);
  ASSERT_GE(experiments->options.size(), 5U);
  const double now = ByHand(*data, viscous, dry).distance();
  for (std::size_t i = 0; i < experiments->options.size(); ++i) {
    const ExperimentOption& option = experiments->options[i];
    std::vector<Moment> moments;
    for (Index t = 0; t < option.motion->time.size(); ++t) {
      const Moment moment = triangle(option.speed * option.motion->time(t));
      moments.push_back({option.amplitude * moment.x, option.amplitude * option.speed * moment.v,
                         option.amplitude * option.speed * option.speed * moment.a});
      EXPECT_NEAR(option.motion->position(t, 0), option.amplitude * moment.x, 2e-3);
    }
    ByHand then(*data, viscous, dry);
    then.add(moments);
    EXPECT_NEAR(distance_of(*experiments, i) / experiments->distance_now, then.distance() / now,
                1e-3 * then.distance() / now)
        << experiment_words(option);
  }
}

// What was recorded bounds what is proposed: position, speed and force.
TEST_F(RivalMotion, NothingIsProposedThatWasNotRecorded) {
  record("slow", 1.0, 0.5);
  record("fast", 0.5, 1.0);
  const auto data = problem();
  const ExtendedFit viscous = data->fit({{{index_of(*data, "viscous"), {20.0}}}}, nullptr);
  const ExtendedFit dry = data->fit({{{index_of(*data, "coulomb"), {8.0, 0.002}}}}, nullptr);
  const auto experiments = data->experiments_between(viscous, dry);
  ASSERT_TRUE(experiments.has_value());
  double range = 0.0, speed = 0.0;
  for (double t = 0.0; t < 10.0; t += 0.001) {
    range = std::max(range, std::abs(triangle(t).x));
    speed = std::max(speed, 0.5 * std::abs(triangle(t).v));
  }
  bool is_any_faster = false;
  for (const ExperimentOption& option : experiments->options) {
    const PlannedMotion& motion = *option.motion;
    EXPECT_LE(motion.position.cwiseAbs().maxCoeff(), range * 1.001);
    for (Index t = 1; t < motion.time.size(); ++t) {
      EXPECT_LE(std::abs(motion.position(t, 0) - motion.position(t - 1, 0)),
                1.001 * speed * (motion.time(t) - motion.time(t - 1)));
    }
    is_any_faster = is_any_faster || option.speed > 1.0;
  }
  EXPECT_TRUE(is_any_faster) << "half the amplitude at twice the speed was recorded, in effect";
}

// What the recordings say against viscous friction where dry friction is true, in the unit of the
// distance: n (1 - SSE of the dry fit / SSE of the viscous one).
double distance_found(const MismatchProblem& problem, const ExtendedFit& viscous,
                      const ExtendedFit& dry) {
  const double samples = problem.sample_count();
  return samples * (1.0 - std::exp(-(viscous.deviance - dry.deviance) / samples));
}

// The motion that is proposed, recorded, tells as much as was promised.
TEST_F(RivalMotion, TheProposedMotionTellsWhatWasPromised) {
  noise_ = 6.0;  // distances are of small departures, linear in their squares
  record("run", 1.0, 1.0);
  const auto data = problem();
  const auto fits = [](const MismatchProblem& asked) {
    return std::pair{asked.fit({{{index_of(asked, "viscous"), {20.0}}}}, nullptr),
                     asked.fit({{{index_of(asked, "coulomb"), {8.0, 0.002}}}}, nullptr)};
  };
  const auto [viscous, dry] = fits(*data);
  const auto experiments = data->experiments_between(viscous, dry);
  ASSERT_TRUE(experiments.has_value());
  const double before = distance_found(*data, viscous, dry);
  EXPECT_NEAR(experiments->distance_now, before, 0.3 * before);
  const std::optional<NextExperiment> next = next_experiment(*experiments);
  ASSERT_TRUE(next.has_value());
  ASSERT_FALSE(next->shares.empty());
  EXPECT_EQ(next_motions(*next).size(), next->shares.size());
  const ExperimentOption& best = next->shares[0].option;
  EXPECT_NE(best.amplitude * best.speed, 1.0) << "another speed tells them apart";
  record("next", best.amplitude, best.speed, 0.4);
  const auto more = problem();
  const auto [viscous_then, dry_then] = fits(*more);
  const double after = distance_found(*more, viscous_then, dry_then);
  EXPECT_GT(after, 1.5 * before);
  EXPECT_NEAR(std::log(after / next->distance_then), 0.0, std::log(2.0));
}

}  // namespace
}  // namespace graybox
