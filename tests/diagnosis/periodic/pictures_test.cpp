// Pictures and words of a diagnosis show what was measured, and agree with each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/law_figure.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/random.hpp"
#include "tests/support/recorded_systems.hpp"

namespace graybox {
namespace {

using testing::HiddenPhysics;

const std::string kMotor = "{kind: element, mass: motor}";

// Refits with the law that was hidden, from its values.
ForcePicture picture_with(const HiddenPhysics& hidden, const std::string& law,
                          const std::vector<double>& parameters) {
  const ExtendedFit before = hidden->fit({}, nullptr);
  const ExtendedFit after =
      hidden->fit(std::vector<LawStart>{{hidden.index_of("motor", law), parameters}}, &before);
  EXPECT_TRUE(after.usable) << after.trouble;
  return hidden->force_pictures(after).front();
}

double mean_square_of_rest(const ForcePicture& picture) {
  double square = 0.0;
  for (std::size_t t = 0; t < picture.force.size(); ++t) {
    square += std::pow(picture.force[t] - picture.law_force[t], 2);
  }
  return square / static_cast<double>(picture.force.size());
}

// Finding B1. Where a law explains all, what is left of the recordings' force is their noise, and
// the picture shows it: as much as the fit states.
TEST(LawPictures, RecordedForcesScatterAboutTheTrueLawByTheNoiseThatTheFitStates) {
  double ratio = 0.0;
  constexpr int kSeeds = 4;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const HiddenPhysics hidden(testing::element(kMotor, "coulomb",
                                                "level: {value: 0.02, unit: N m}, "
                                                "transition_velocity: {value: 0.3, unit: rad/s}"),
                               seed);
    const ForcePicture picture = picture_with(hidden, "coulomb", {0.02, 0.3});
    ASSERT_FALSE(picture.force.empty());
    ASSERT_GT(picture.force_deviation, 0.0);
    ratio += mean_square_of_rest(picture) / std::pow(picture.force_deviation, 2) / kSeeds;
    std::size_t equal = 0;
    for (std::size_t t = 0; t < picture.force.size(); ++t) {
      if (std::abs(picture.force[t] - picture.law_force[t]) < 0.01 * picture.force_deviation) {
        ++equal;
      }
    }
    EXPECT_LT(equal, picture.force.size() / 20);
  }
  EXPECT_GT(ratio, 0.75);
  EXPECT_LT(ratio, 1.3);
}

ForcePicture made_picture(std::uint64_t seed, double noise) {
  Random random(seed);
  ForcePicture picture;
  picture.deflection_unit = "rad";
  picture.rate_unit = "rad/s";
  picture.force_unit = "N m";
  for (int t = 0; t < 1200; ++t) {
    const double z = std::sin(0.05 * t), rate = 0.05 * std::cos(0.05 * t);
    picture.deflection.push_back(z);
    picture.rate.push_back(rate);
    picture.law_force.push_back(3.0 * std::tanh(rate / 0.02));
    picture.force.push_back(picture.law_force.back() + noise * random.normal());
  }
  picture.force_deviation = noise;
  return picture;
}

// Finding 2.2.
TEST(LawPictures, ALawIsALineWithABandOverItsOwnVariableAndRecordedForcesArePoints) {
  const ForcePicture picture = made_picture(1, 0.4);
  const Chart over_rate = law_chart(picture, "friction", true);
  ASSERT_EQ(over_rate.series.size(), 2U);
  EXPECT_TRUE(over_rate.series[0].points);
  const ChartSeries& law = over_rate.series[1];
  EXPECT_FALSE(law.points);
  EXPECT_TRUE(std::ranges::is_sorted(law.x));
  ASSERT_EQ(law.band.size(), law.y.size());
  // The band is the noise that was put in.
  double square = 0.0;
  for (const double half : law.band) square += half * half / static_cast<double>(law.band.size());
  EXPECT_NEAR(std::sqrt(square), 0.4, 0.03);
  EXPECT_TRUE(is_function_of_axis(picture, true));
  EXPECT_FALSE(is_function_of_axis(picture, false));
  const Chart over_deflection = law_chart(picture, "friction", false);
  EXPECT_TRUE(over_deflection.series.back().points);
}

TEST(LawPictures, AnOutlierDoesNotSetTheScale) {
  ForcePicture picture = made_picture(2, 0.4);
  picture.force[100] = 1e4;
  const Chart chart = law_chart(picture, "friction", true);
  for (const double force : chart.series[0].y) {
    if (!std::isfinite(force)) continue;
    EXPECT_LT(std::abs(force), 10.0);
  }
}

TEST(LawPictures, OfForcesThatRecordingsDoNotSayShowTheLawAlone) {
  ForcePicture picture = made_picture(3, 0.4);
  picture.force.clear();
  const Chart chart = law_chart(picture, "friction", true);
  ASSERT_EQ(chart.series.size(), 1U);
  EXPECT_EQ(chart.series[0].name, "fitted law");
}

MismatchCell cell(double from, double statistic) {
  MismatchCell result;
  result.channel = "speed";
  result.from = from;
  result.to = 2.0 * from;
  result.statistic = statistic;
  result.degrees_of_freedom = 100.0;
  return result;
}

Diagnosis verified_diagnosis(double largest) {
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kExplained;
  diagnosis.noise_is_known = true;
  diagnosis.verified = true;
  diagnosis.detection.detected = true;
  diagnosis.rest_test.p_value = 0.61;
  diagnosis.mismatch_after = {cell(0.75, largest), cell(2.0, 101.0), cell(6.0, 97.0)};
  return diagnosis;
}

bool says(const std::vector<std::string>& words, const std::string& text) {
  return std::ranges::any_of(
      words, [&text](const std::string& line) { return line.find(text) != std::string::npos; });
}

// Finding B2.
TEST(ReportWords, SayWhyAFramedCellAndARestLikeNoiseCanBothBeTrue) {
  const Diagnosis framed = verified_diagnosis(190.0);
  EXPECT_TRUE(says(verdict_words(framed, {}), "What is left is no more than noise"));
  EXPECT_TRUE(says(verdict_words(framed, {}), "can both be true"));
  EXPECT_NE(report_page(framed, {}, {}).find("1 of 3 cells"), std::string::npos);
  const Diagnosis plain = verified_diagnosis(103.0);
  EXPECT_TRUE(map_words(plain).empty());
  EXPECT_FALSE(says(verdict_words(plain, {}), "both be true"));
}

// Finding 2.6.
TEST(ReportPage, SaysOnceThatARecordingWasKeptOut) {
  Diagnosis diagnosis = verified_diagnosis(100.0);
  ResidualCurve curve;
  curve.channel = "force of carriage";
  curve.unit = "N";
  curve.experiment = "run_2.csv";
  curve.over_time = true;
  curve.held_out = true;
  curve.axis = curve.measured = curve.residual = {0.0, 1.0};
  diagnosis.curves_before = {curve};
  const std::vector<ReportFigure> figures = report_figures(diagnosis, {});
  ASSERT_FALSE(figures.empty());
  ASSERT_EQ(figures.front().name, "trace_1");
  const std::string svg = figures.front().svg.substr(figures.front().svg.find('>'));
  const std::size_t first = svg.find("kept out");
  ASSERT_NE(first, std::string::npos);
  EXPECT_EQ(svg.find("kept out", first + 1), std::string::npos);
}

}  // namespace
}  // namespace graybox
