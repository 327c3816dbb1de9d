// Where in time an error sits, and what differs in recordings kept out, against residuals that were
// made with and without such places.
#include "diagnosis/verdict/error_places.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "diagnosis/evidence/kept_out_change.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/random.hpp"
#include "tests/support/carriage_files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr int kSamples = 5000;
constexpr double kSampleTime = 0.002;

// A position that swings, and a residual whose past lasts for a fiftieth of the recording.
ResidualCurve curve_with_past(Random& random, double past_share = 0.02) {
  ResidualCurve curve;
  curve.channel = "position";
  curve.unit = "m";
  curve.experiment = "run.csv";
  curve.over_time = true;
  const double memory = std::exp(-1.0 / (past_share * kSamples));
  double rest = random.normal();
  for (int k = 0; k < kSamples; ++k) {
    const double t = k * kSampleTime;
    rest = memory * rest + std::sqrt(1.0 - memory * memory) * random.normal();
    curve.axis.push_back(t);
    curve.measured.push_back(std::sin(3.0 * t) + 0.4 * std::sin(8.1 * t));
    curve.residual.push_back(0.1 * rest);
  }
  return curve;
}

TEST(ErrorPlaces, chance_tells_a_place_in_few_recordings) {
  Random random(5);
  int told = 0;
  for (int draw = 0; draw < 500; ++draw) {
    const std::vector<ResidualCurve> curves{curve_with_past(random)};
    told += static_cast<int>(error_places(curves).size());
  }
  EXPECT_LE(told, 8);  // 1 % is 5; 8 with a probability of 93 % at 1 %
}

TEST(ErrorPlaces, a_spell_is_told_with_its_time_and_where_the_channel_went) {
  Random random(6);
  std::vector<ResidualCurve> curves{curve_with_past(random)};
  for (int k = 2000; k < 2100; ++k) {
    curves[0].residual[static_cast<std::size_t>(k)] += 1.5;
    curves[0].measured[static_cast<std::size_t>(k)] += 2.0;  // once as far as that
  }
  const std::vector<ErrorPlace> places = error_places(curves);
  ASSERT_EQ(places.size(), 1U);
  EXPECT_EQ(places[0].kind, ErrorPlace::Kind::kSpell);
  EXPECT_NEAR(places[0].from, 4.0, 0.21);
  EXPECT_NEAR(places[0].to, 4.2, 0.21);
  EXPECT_TRUE(places[0].is_new);
  EXPECT_GT(places[0].share, 0.5);
}

TEST(ErrorPlaces, an_onset_is_told_and_a_drift_is_not) {
  Random random(7);
  std::vector<ResidualCurve> curves{curve_with_past(random)};
  std::vector<ResidualCurve> drifting = curves;
  for (int k = 0; k < kSamples; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (k >= 3000) curves[0].residual[at] *= 8.0;
    drifting[0].residual[at] *= 0.2 + 8.0 * k / kSamples;
  }
  const std::vector<ErrorPlace> places = error_places(curves);
  ASSERT_EQ(places.size(), 1U);
  EXPECT_EQ(places[0].kind, ErrorPlace::Kind::kOnset);
  EXPECT_NEAR(places[0].from, 6.0, 0.21);
  EXPECT_GT(places[0].ratio, 4.0);
  EXPECT_TRUE(error_places(drifting).empty());
}

TEST(ErrorPlaces, an_error_that_comes_with_the_motion_is_no_place) {
  Random random(8);
  std::vector<ResidualCurve> curves{curve_with_past(random)};
  for (int k = 0; k < kSamples; ++k) {  // moves for 5 % of the time only
    const auto at = static_cast<std::size_t>(k);
    const bool moves = k >= 2000 && k < 2250;
    curves[0].measured[at] = moves ? std::sin(0.02 * (k - 2000)) : 0.0;
    curves[0].residual[at] *= moves ? 1.0 : 0.01;
  }
  EXPECT_TRUE(error_places(curves).empty());
}

TEST(ErrorPlaces, samples_that_are_not_predicted_do_not_count) {
  Random random(9);
  std::vector<ResidualCurve> curves{curve_with_past(random)};
  for (int k = 0; k < 400; ++k) {
    curves[0].residual[static_cast<std::size_t>(k)] = std::nan("");
  }
  EXPECT_TRUE(error_places(curves).empty());
  for (double& residual : curves[0].residual) residual = std::nan("");
  EXPECT_TRUE(error_places(curves).empty());
}

// A carriage whose load and dry friction differ in the recording kept out.
class KeptOutChanges : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_.file("drive.yaml")) << testing::kCarriageModel;
    std::ofstream(folder_.file("campaign.yaml"))
        << testing::kCarriageCampaign << R"(  - {file: first.csv}
  - {file: second.csv, role: validation}
)";
  }

  void record(const std::string& name, double mass, double level) {
    std::ofstream file(folder_.file(name + ".csv"));
    file.precision(12);
    file << "force,x,v,a\n";
    for (int k = 0; k < 2000; ++k) {
      const double t = 0.01 * k;
      double x = 0.0, v = 0.0, a = 0.0;
      for (const auto& [amplitude, w] : {std::pair{0.2, 1.7}, {0.05, 4.1}, {0.01, 9.7}}) {
        x -= amplitude * std::cos(w * t);
        v += amplitude * w * std::sin(w * t);
        a += amplitude * w * w * std::cos(w * t);
      }
      file << mass * a + level * std::tanh(v / 0.002) + 0.3 * random_.normal() << ',' << x << ','
           << v << ',' << a << '\n';
    }
  }

  [[nodiscard]] Diagnosis diagnosis(std::vector<std::string>& words) const {
    const auto problem = force_balance_problem(
        folder_.file("drive.yaml"),
        read_campaign(std::filesystem::path(folder_.file("campaign.yaml")).parent_path()));
    Diagnosis result = diagnose(*problem);
    words = verdict_words(result, problem->hypotheses());
    return result;
  }

  testing::TemporaryFolder folder_;
  Random random_{12};
};

TEST_F(KeptOutChanges, another_load_is_told_with_both_sizes) {
  record("first", 12.0, 8.0);
  record("second", 17.0, 8.0);
  std::vector<std::string> words;
  const Diagnosis found = diagnosis(words);
  EXPECT_NE(found.verdict, Verdict::kExplained);
  ASSERT_TRUE(found.kept_out_change);
  const KeptOutChange& change = *found.kept_out_change;
  EXPECT_LT(change.error_fitted, 0.3 * change.error_predicted);
  ASSERT_EQ(change.sizes.size(), 1U);
  EXPECT_FALSE(change.sizes[0].law);
  EXPECT_NEAR(change.sizes[0].in_fit.value, 12.0, 4.0 * change.sizes[0].in_fit.standard_error);
  EXPECT_NEAR(change.sizes[0].kept_out.value, 17.0, 4.0 * change.sizes[0].kept_out.standard_error);
  const auto tells = [](const std::string& line) { return line.starts_with("Kept out, other"); };
  EXPECT_EQ(std::ranges::count_if(words, tells), 1);
}

TEST_F(KeptOutChanges, the_same_machine_is_not_told_to_have_changed) {
  record("first", 12.0, 8.0);
  record("second", 12.0, 8.0);
  std::vector<std::string> words;
  EXPECT_FALSE(diagnosis(words).kept_out_change);
}

}  // namespace
}  // namespace graybox
