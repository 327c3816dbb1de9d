// Reading recordings: campaign files, data files, time axes, faults of signals, preprocessing; and
// `graybox recordings` as users get it.
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/recordings/signal_checks.hpp"
#include "diagnosis/signal_faults/time_axis.hpp"
#include "diagnosis/signals/band_limited_derivative.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::write_text;

constexpr double kPi = std::numbers::pi;

const std::string kCampaign = R"(format: graybox-campaign/1
sample_time: 0.001
channels:
  - {name: u, unit: A, gain: {value: 0.5, unit: N m/A}, is: input}
  - {name: y, unit: rpm, is: output}
experiments:
  - {file: a.csv}
  - {file: b.csv, role: validation}
)";

// Rows of t, u, y at 1 kHz.
std::string rows(int count, double phase) {
  std::string text = "time,u,y\n";
  for (int k = 0; k < count; ++k) {
    text += std::to_string(0.001 * k) + "," + std::to_string(std::sin(0.1 * k + phase)) + "," +
            std::to_string(60.0 * std::cos(0.07 * k + phase)) + "\n";
  }
  return text;
}

class Recordings : public testing::CommandRunner {
 protected:
  Recordings() {
    write_text(folder_.file("campaign.yaml"), kCampaign);
    write_text(folder_.file("a.csv"), rows(200, 0.0));
    write_text(folder_.file("b.csv"), rows(300, 1.0));
  }

  // kCampaign with one text replaced.
  void write_campaign(const std::string& from, const std::string& to) {
    std::string text = kCampaign;
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_text(folder_.file("campaign.yaml"), text.replace(at, from.size(), to));
  }
  ExperimentRecording examined() { return examine_experiment(read_campaign(folder_.file("")), 0); }
  // One finding of this check and severity, whose message holds the text.
  void expect_finding(Severity severity, const std::string& check, const std::string& text) {
    const ExperimentRecording recording = examined();
    EXPECT_TRUE(std::ranges::any_of(recording.findings,
                                    [&](const Finding& finding) {
                                      return finding.severity == severity &&
                                             finding.check == check &&
                                             finding.message.find(text) != std::string::npos;
                                    }))
        << check << ": " << text << ", but "
        << (recording.findings.empty() ? "nothing found" : recording.findings.front().message);
    EXPECT_EQ(recording.sound(), severity == Severity::kWarning);
    EXPECT_EQ(recording.data.pieces.empty(), severity == Severity::kError);
  }
};

// ---- the campaign file --------------------------------------------------------------------------

TEST_F(Recordings, AreReadAndConverted) {
  const Campaign campaign = read_campaign(folder_.file(""));
  const ExperimentRecording run = load_experiment(campaign, 0);
  EXPECT_TRUE(run.findings.empty());
  ASSERT_EQ(run.data.pieces.size(), 1U);
  const SignalPiece& piece = run.data.pieces.front();
  ASSERT_EQ(piece.values.rows(), 200);
  EXPECT_EQ(run.data.signals[0].unit, "N m");
  EXPECT_EQ(run.data.signals[1].unit, "rad/s");
  for (Eigen::Index k = 0; k < 200; ++k) {
    const auto t = static_cast<double>(k);
    EXPECT_NEAR(piece.values(k, run.index_of("u")), 0.5 * std::sin(0.1 * t), 1e-6);
    EXPECT_NEAR(piece.values(k, run.index_of("y")), 2.0 * kPi * std::cos(0.07 * t), 1e-6);
    EXPECT_NEAR(piece.time(k), 0.001 * t, 1e-12);
  }
  EXPECT_EQ(campaign.experiments[1].role, ExperimentRole::kValidation);
}

TEST_F(Recordings, WrongCampaignFilesAreRefusedInOneLine) {
  const std::vector<std::pair<std::pair<std::string, std::string>, std::string>> cases = {
      {{"format: graybox-campaign/1", "format: graybox-plan/1"}, "must be one of"},
      {{"sample_time: 0.001", "sample_time: 0.001\nholding: zero"}, "holding: unknown field"},
      {{"sample_time: 0.001", "sample_time: -1"}, "sample_time: must be positive"},
      {{"sample_time: 0.001\n", ""}, "'sample_time' is missing"},
      {{"unit: rpm", "unit: foot"}, "unknown unit 'foot'"},
      {{"unit: N m/A", "unit: N m/V"}, "recorded in A"},
      {{"unit: N m/A", "unit: foot/A"}, "unknown unit 'foot'"},
      {{"value: 0.5", "value: 0"}, "must not be zero"},
      {{"is: output", "is: sensor"}, "must be one of input, output"},
      {{"name: y", "name: u"}, "given twice"},
      {{"unit: rpm", "unit: rpm, column: u"}, "read twice"},
      {{"unit: rpm", "unit: rpm, range: [5, 5]"}, "lowest, highest"},
      {{"unit: rpm", "unit: rpm, file: angles"}, "wants file 'angles'"},
      {{"file: a.csv", "file: missing.csv"}, "there is no file"},
      {{"file: a.csv", "file: '${GRAYBOX_NO_SUCH_FOLDER}/a.csv'"}, "is not set"},
      {{"file: a.csv", "level: 1"}, "needs either file or files"},
      {{"file: a.csv", "file: a.csv, segments: [[5, 5]]"}, "must come after"},
      {{"file: a.csv", "file: a.csv, segments: [[0.5, 5]]"}, "whole number"},
      {{"file: a.csv", "file: a.csv, excitation: {period: 10, periods: 2, lines: [6]}"},
       "above half the period"},
      {{"file: a.csv", "file: a.csv, role: test"}, "must be one of estimation, validation"},
      {{"sample_time: 0.001", "sample_time: 0.001\ntime: {column: t, unit: m}"}, "unit of time"},
      {{"experiments:", "noise: {z: 1}\nexperiments:"}, "no such channel"},
      {{"experiments:", "preprocess: [{kind: smooth}]\nexperiments:"}, "must be one of low_pass"},
      {{"experiments:", "preprocess: [{kind: trim, time: -1}]\nexperiments:"}, "time"},
      {{"experiments:",
        "preprocess: [{kind: low_pass, frequency: 5, channels: [z]}]\nexperiments:"},
       "no such channel"},
      {{"experiments:", "preprocess: [{kind: derivative, of: [y], name: [u]}]\nexperiments:"},
       "'u' is a channel already"},
      {{"experiments:",
        "preprocess: [{kind: transmission, towards: arm, of: [y], name: [q], gear_ratios: [0]}]\n"
        "experiments:"},
       "can't be inverted"},
      {{"experiments:",
        "preprocess: [{kind: transmission, towards: arm, of: [y], name: [q], matrix: [[1, 2]]}]\n"
        "experiments:"},
       "must hold 1 numbers"},
  };
  for (const auto& [edit, message] : cases) {
    write_campaign(edit.first, edit.second);
    const auto read = [&] { (void)read_campaign(folder_.file("")); };
    testing::expect_refused(read, message);
    testing::expect_refused(read, "campaign.yaml");
  }
}

TEST_F(Recordings, FilesAreFoundThroughTheEnvironment) {
  ASSERT_EQ(setenv("GRAYBOX_TEST_DATA", folder_.file("").c_str(), 1), 0);
  write_text(logs_.file("elsewhere.yaml"),
             R"(format: graybox-campaign/1
sample_time: 0.001
channels: [{name: u, unit: A, is: input}]
experiments: [{file: "${GRAYBOX_TEST_DATA}/a.csv"}]
)");
  EXPECT_EQ(load_experiment(read_campaign(logs_.file("elsewhere.yaml")), 0).samples, 200U);
}

// ---- faults of the data -------------------------------------------------------------------------

TEST_F(Recordings, WrongColumnNamesAreNamedWithThoseThereAre) {
  write_campaign("unit: rpm", "unit: rpm, column: speed");
  expect_refused("recordings .", "there is no column 'speed'; there are: time, u, y");
}

TEST_F(Recordings, FaultsOfSignalsAreNamed) {
  std::string text = rows(200, 0.0);
  const auto line = text.find("0.005000,");
  write_text(folder_.file("a.csv"),
             text.substr(0, line) + "0.005,nan,\n" + text.substr(text.find('\n', line) + 1));
  expect_finding(Severity::kError, "not a number", "u: 1 of 200 samples");
  expect_finding(Severity::kError, "not a number", "y: 1 of 200 samples");
  expect_finding(Severity::kError, "not a number", "the first is sample 5");
  write_campaign("file: a.csv", "file: a.csv, segments: [[6, 199]]");
  EXPECT_TRUE(examined().sound());
  write_campaign("file: a.csv", "file: a.csv, segments: [[6, 200]]");
  expect_finding(Severity::kError, "segment", "beyond the last sample, 199");
}

TEST_F(Recordings, StatedRangesAndConstantsAreChecked) {
  write_campaign("unit: rpm", "unit: rpm, range: [-59, 59]");
  expect_finding(Severity::kWarning, "clipped", "at or beyond the range [-59, 59]");
  write_text(folder_.file("a.csv"), "u,y\n1,2\n1,3\n1,2.5\n");
  expect_finding(Severity::kWarning, "constant", "u: is 1 throughout");
}

TEST_F(Recordings, PeriodsMustFit) {
  const std::string periodic = "file: a.csv, excitation: {period: 100, periods: ";
  write_campaign("file: a.csv", periodic + "2, lines: [1]}");
  EXPECT_TRUE(examined().findings.empty());
  write_campaign("file: a.csv", periodic + "3, lines: [1]}");
  expect_finding(Severity::kError, "period", "3 periods of 100 need 300");
  write_campaign("file: a.csv", periodic + "1, lines: [1]}");
  expect_finding(Severity::kWarning, "period", "100 samples beyond");
}

TEST_F(Recordings, AnUnknownSampleTimeCountsInSamplesAndSaysSo) {
  write_campaign("sample_time: 0.001", "sample_time: unknown");
  const Campaign campaign = read_campaign(folder_.file(""));
  const std::vector<Finding> findings = examine_campaign(campaign);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_NE(findings[0].message.find("counts as 1 s"), std::string::npos);
  const ExperimentRecording recording = examined();
  EXPECT_TRUE(recording.sound());
  EXPECT_DOUBLE_EQ(recording.duration, 200.0);
  write_campaign("sample_time: 0.001", "sample_time: unknown\ntime: {column: time, unit: s}");
  testing::expect_refused([&] { (void)read_campaign(folder_.file("")); },
                          "leaves no use for times");
}

TEST_F(Recordings, UnitsInTheFileMustBeThoseOfTheCampaign) {
  write_text(folder_.file("a.csv"), "u [A],y (rad/s)\n1,2\n1.5,3\n");
  expect_finding(Severity::kError, "unit", "y is in rad/s, but the campaign says rpm");
}

TEST_F(Recordings, SwappedColumnsAndUnlikelyUnitsAreNamed) {
  write_campaign("unit: rpm", "unit: rpm, column: u");
  std::string text = testing::read_text(folder_.file("campaign.yaml"));
  write_text(folder_.file("campaign.yaml"),
             text.replace(text.find("unit: A,"), 8, "unit: A, column: y,"));
  const auto swapped = examine_campaign(read_campaign(folder_.file("")));
  ASSERT_EQ(swapped.size(), 1U);
  EXPECT_NE(swapped[0].message.find("u and y read each other's"), std::string::npos);
  write_campaign("unit: rpm", "unit: rad, column: angle_deg");
  const auto unlikely = examine_campaign(read_campaign(folder_.file("")));
  ASSERT_EQ(unlikely.size(), 1U);
  EXPECT_NE(unlikely[0].message.find("sounds like deg"), std::string::npos);
}

TEST_F(Recordings, DamagedTablesAreRefusedWithTheirLine) {
  const auto refused = [&](const std::string& text, const std::string& message) {
    write_text(folder_.file("a.csv"), text);
    expect_refused("recordings .", message);
  };
  refused("u,y\n1,2\n1,two\n", "line 3, column 'y': 'two' is no number");
  refused("u,y\n1,2\n1\n", "line 3: 1 fields, but there are 2 columns");
  // Between thousands or decimal: a table has one of the two.
  refused("u;y\n1.5;2.5\n1,5;2,5\n", "write a decimal point");
  refused("u;y\n1,000,000;2\n", "write a decimal point");
  refused("u;y\n1.000,5;2\n", "write a decimal point");
  refused("u,u\n1,2\n", "two columns are called 'u'");
  // Neither a message nor a name is as long as what a damaged file holds.
  const std::string endless(5000, 'u');
  refused("t," + endless + "\n1,2\n", "has 5000 characters, 400 at most");
  refused("# t " + endless + "\n1 2\n3 4\n", "has 5000 characters, 400 at most");
  refused(endless + "," + endless + "\n1,2\n", "characters) ... u");
  refused("u,y\n", "no numbers");
  refused("", "empty");
}

TEST_F(Recordings, TablesHaveManyForms) {
  const auto values = [&](const std::string& text, const std::string& column) {
    write_text(folder_.file("t.csv"), text);
    return read_recording_file(folder_.file("t.csv")).at(column).values;
  };
  const Eigen::Vector2d expected(2.0, 4.0);
  EXPECT_EQ(values("a,b\n1,2\n3,4\n", "b"), expected);
  EXPECT_EQ(values("\xEF\xBB\xBF# note\na;b [deg]\r\n1;2\r\n3;4\r\n", "b"), expected);
  EXPECT_EQ(values("a;b\n1,25;2,0\n3;+0,4e1\n", "b"), expected);
  EXPECT_EQ(values("Zeit [s]\tb\n0,1\t2,000\n0,2\t4\n", "b"), expected);
  EXPECT_EQ(values("a;b\n-1,25;2\n-1,5;4\n", "a"), Eigen::Vector2d(-1.25, -1.5));
  EXPECT_EQ(values("1 2\n3   4\n", "2"), expected);
  EXPECT_EQ(values("\"a\"\t\"b c\"\n1\t2\n3\t4\n", "b c"), expected);
}

TEST_F(Recordings, SeveralFilesMakeOneExperiment) {
  write_text(folder_.file("current.csv"), "time,u\n0,1\n0.001,2\n0.002,3\n");
  write_text(folder_.file("speed.csv"), "time,y\n0,4\n0.001,5\n0.002,6.5\n");
  const auto write = [&] {
    write_campaign("file: a.csv", "files: {c: current.csv, s: speed.csv}");
    std::string text = testing::read_text(folder_.file("campaign.yaml"));
    text.replace(text.find("unit: A,"), 8, "unit: A, file: c,");
    text.replace(text.find("unit: rpm"), 9, "unit: rpm, file: s");
    text.erase(text.find("  - {file: b.csv"));
    write_text(folder_.file("campaign.yaml"), text);
  };
  write();
  EXPECT_EQ(examined().data.pieces.at(0).values(2, 0), 1.5);
  write_text(folder_.file("speed.csv"), "y\n4\n5\n6\n7\n8\n9\n");
  expect_finding(Severity::kError, "length", "share one sample rate");
  write_text(folder_.file("speed.csv"), "time,y\n0.0005,4\n0.0015,5\n0.0025,6.5\n");
  expect_finding(Severity::kError, "time", "at other times");
}

TEST_F(Recordings, TheSegmentThatAFindingIsOfIsNamed) {
  std::string text = rows(100, 0.0);
  for (int k = 100; k < 200; ++k)
    text += std::to_string(0.001 * k) + ",1," + std::to_string(k) + "\n";
  write_text(folder_.file("a.csv"), text);
  write_campaign("file: a.csv", "file: a.csv, segments: [[0, 99], [100, 199]]");
  expect_finding(Severity::kWarning, "constant", "a.csv (samples 100 to 199): u: is 1 throughout");
}

TEST_F(Recordings, ValidationOnSamplesOfTheFitIsNamed) {
  write_campaign("file: b.csv", "file: a.csv, segments: [[100, 199]]");
  const auto shared = examine_campaign(read_campaign(folder_.file("")));
  ASSERT_EQ(shared.size(), 1U);
  EXPECT_NE(shared[0].message.find("a.csv (samples 100 to 199): validation uses samples"),
            std::string::npos);
  write_campaign("- {file: a.csv}\n  - {file: b.csv",
                 "- {file: a.csv, segments: [[0, 99]]}\n  - {file: a.csv, segments: [[100, 199]]");
  EXPECT_TRUE(examine_campaign(read_campaign(folder_.file(""))).empty());
}

TEST_F(Recordings, TimesAreUsedOrIgnoredAsTheCampaignSays) {
  write_text(folder_.file("a.csv"), "time,u,y\n0,1,2\n0.4,2,3\n0.5,4,5\n1.7,5,7\n");
  expect_finding(Severity::kError, "time", "if they are rounded, time: ignore");
  write_campaign("sample_time: 0.001", "sample_time: 0.001\ntime: ignore");
  EXPECT_TRUE(examined().findings.empty());
  EXPECT_EQ(examined().data.pieces.at(0).time(3), 0.003);
  write_campaign("sample_time: 0.001", "sample_time: irregular");
  EXPECT_EQ(examined().data.pieces.at(0).time, Eigen::Vector4d(0.0, 0.4, 0.5, 1.7));
  write_campaign("sample_time: 0.001", "sample_time: irregular\ntime: ignore");
  expect_refused("recordings .", "irregular samples need their times");
  write_campaign("sample_time: 0.001", "sample_time: irregular\ntime: {column: t, unit: s}");
  expect_refused("recordings .", "there is no column 't'; there are: time, u, y");
}

// ---- time axes ----------------------------------------------------------------------------------

Eigen::VectorXd even_times(Eigen::Index count) {
  return Eigen::VectorXd::LinSpaced(count, 0.0, 0.001 * static_cast<double>(count - 1));
}

TEST(TimeAxis, TellsEvenFromJitteredFromGapsFromTwoRates) {
  using Kind = TimeAxis::Kind;
  Eigen::VectorXd times = even_times(2000);
  EXPECT_EQ(examine_times(times).kind, Kind::kEven);
  EXPECT_EQ(examine_times(times.cast<float>().cast<double>()).kind, Kind::kEven);
  for (Eigen::Index k = 0; k < 2000; ++k) times(k) += 2e-4 * std::sin(1.7 * static_cast<double>(k));
  const TimeAxis jittered = examine_times(times);
  EXPECT_EQ(jittered.kind, Kind::kJittered);
  EXPECT_GT(jittered.jitter, 0.2);
  // A clock 1 % fast at first and 1 % slow at last is off by five samples in the middle.
  times = even_times(2000);
  times += 5.0 * (times.array() * (times.array() - 1.999)).matrix() * 1e-3;
  EXPECT_EQ(examine_times(times).kind, Kind::kJittered);
  EXPECT_GT(examine_times(times).jitter, 2.0);
  times = even_times(2000);
  times.tail(1500).array() += 0.25;
  const TimeAxis gaps = examine_times(times);
  EXPECT_EQ(gaps.kind, Kind::kGaps);
  EXPECT_EQ(gaps.count, 1U);
  EXPECT_EQ(gaps.first, 499U);
  EXPECT_NEAR(gaps.longest, 0.251, 1e-9);
  times = even_times(2000);
  for (Eigen::Index k = 1500; k < 2000; ++k) times(k) = times(k - 1) + 0.002;
  const TimeAxis mixed = examine_times(times);
  EXPECT_EQ(mixed.kind, Kind::kMixedRates);
  EXPECT_NEAR(mixed.other_step, 0.002, 1e-9);
  EXPECT_EQ(mixed.first, 1499U);
  times = even_times(2000);
  std::swap(times(700), times(701));
  EXPECT_EQ(examine_times(times).kind, Kind::kUnordered);
  times = even_times(2000).array().square();
  EXPECT_EQ(examine_times(times.tail(1999)).kind, Kind::kIrregular);
}

TEST(TimeAxis, ContradictionsWithTheSampleTimeAreErrors) {
  const auto found = [](const Eigen::VectorXd& times, std::optional<double> sample_time) {
    std::vector<Finding> findings;
    check_times("file", times, sample_time, 0, findings);
    return findings;
  };
  EXPECT_TRUE(found(even_times(2000), 0.001).empty());
  ASSERT_EQ(found(even_times(2000), 0.0005).size(), 1U);
  EXPECT_NE(found(even_times(2000), 0.0005)[0].message.find("correct sample_time"),
            std::string::npos);
  EXPECT_EQ(found(1000.0 * even_times(2000), 0.001)[0].severity, Severity::kError);  // ms
  Eigen::VectorXd times = even_times(2000);
  for (Eigen::Index k = 0; k < 2000; ++k) times(k) += 2e-5 * std::sin(1.7 * static_cast<double>(k));
  EXPECT_EQ(found(times, 0.001).at(0).severity, Severity::kWarning);
  times = even_times(2000);
  times.tail(100).array() += 0.25;
  EXPECT_EQ(found(times, 0.001).at(0).severity, Severity::kError);
  EXPECT_EQ(found(times, std::nullopt).at(0).severity, Severity::kWarning);
  times(5) = std::nan("");
  EXPECT_EQ(found(times, std::nullopt).at(0).severity, Severity::kError);
}

// ---- clipping -----------------------------------------------------------------------------------

TEST(ClippedSamples, AreFoundAndQuantisedOrSwitchingSignalsAreNot) {
  const Eigen::ArrayXd t = Eigen::ArrayXd::LinSpaced(2000, 0.0, 40.0);
  const Eigen::VectorXd sine = t.sin();
  EXPECT_EQ(clipped_samples(sine), 0U);
  const Eigen::VectorXd clipped = sine.cwiseMin(0.8);
  EXPECT_EQ(clipped_samples(clipped), static_cast<std::size_t>((clipped.array() == 0.8).count()));
  EXPECT_EQ(clipped_samples(((50.0 * sine).array().round() / 50.0).matrix()), 0U);
  EXPECT_EQ(clipped_samples(sine.array().sign().matrix()), 0U);
  EXPECT_EQ(clipped_samples(Eigen::VectorXd::Constant(100, 3.0)), 0U);
}

// ---- preprocessing ------------------------------------------------------------------------------

Eigen::VectorXd cosine(double frequency, Eigen::Index count) {
  const auto last = static_cast<double>(count - 1);
  return (2.0 * kPi * frequency * Eigen::ArrayXd::LinSpaced(count, 0.0, last)).cos();
}

TEST(ZeroPhaseLowPass, HasTheMagnitudeOfItsFormulaAndNoPhase) {
  for (const int order : {1, 2, 3, 4, 7}) {
    for (const double frequency : {0.002, 0.02, 0.05, 0.1}) {
      const double cut_off = 0.05;
      const double ratio = std::tan(kPi * frequency) / std::tan(kPi * cut_off);
      const double gain = 1.0 / (1.0 + std::pow(ratio, 2 * order));
      const Eigen::VectorXd wave = cosine(frequency, 4000);
      const Eigen::VectorXd filtered = zero_phase_low_pass(wave, cut_off, order);
      EXPECT_LT((filtered - gain * wave).segment(1500, 1000).cwiseAbs().maxCoeff(), 1e-6)
          << order << " " << frequency;
    }
  }
}

TEST(ZeroPhaseLowPass, KeepsStraightLinesToTheEnds) {
  const Eigen::VectorXd line = Eigen::VectorXd::LinSpaced(300, -1.0, 5.0);
  EXPECT_LT((zero_phase_low_pass(line, 0.05, 4) - line).cwiseAbs().maxCoeff(), 1e-2);
  const Eigen::VectorXd constant = Eigen::VectorXd::Constant(50, 2.0);
  EXPECT_LT((zero_phase_low_pass(constant, 0.01, 4) - constant).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(TimeDerivative, IsExactForParabolasAtUnevenTimes) {
  Eigen::VectorXd time(6);
  time << 0.0, 0.1, 0.5, 0.6, 1.0, 1.7;
  const Eigen::VectorXd values = 3.0 * time.array().square() - 2.0 * time.array() + 1.0;
  const Eigen::VectorXd slope = 6.0 * time.array() - 2.0;
  EXPECT_LT((time_derivative(time, values) - slope).cwiseAbs().maxCoeff(), 1e-12);
}

// A whole number of half periods from end to end: a sum of sines, and so the derivative is exact,
// on a line, too.
TEST(BandLimitedDerivative, IsExactForSinesOnALine) {
  constexpr Eigen::Index kSize = 241;
  constexpr double kStep = 0.01;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(kSize, 0.0, kStep * (kSize - 1));
  const double rate = std::numbers::pi / time(kSize - 1);
  const Eigen::VectorXd values = 2.0 - 0.7 * time.array() + (5.0 * rate * time).array().sin() +
                                 0.3 * (180.0 * rate * time).array().sin();
  const Eigen::VectorXd slope = -0.7 + 5.0 * rate * (5.0 * rate * time).array().cos() +
                                0.3 * 180.0 * rate * (180.0 * rate * time).array().cos();
  EXPECT_LT((band_limited_derivative(kStep, values) - slope).cwiseAbs().maxCoeff(),
            1e-10 * slope.cwiseAbs().maxCoeff());
  // At three quarters of the Nyquist frequency neighbours know next to nothing.
  EXPECT_GT((time_derivative(time, values) - slope).norm(), 0.5 * slope.norm());
}

// Two derivatives of any phase, away from the ends; the error there falls with the distance.
TEST(BandLimitedDerivative, HoldsForAnyPhaseAwayFromTheEnds) {
  constexpr Eigen::Index kSize = 4000;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(kSize, 0.0, kSize - 1.0);
  const double rate = 2.0 * std::numbers::pi * 0.33;  // rad a sample
  const Eigen::VectorXd values = (rate * time.array() + 0.4).sin();
  const Eigen::VectorXd second = band_limited_derivative(1.0, band_limited_derivative(1.0, values));
  const Eigen::VectorXd error = (second + rate * rate * values).cwiseAbs() / (rate * rate);
  EXPECT_LT(error.segment(1000, 2000).maxCoeff(), 2e-3);
  EXPECT_LT(error.segment(1000, 2000).maxCoeff(), 0.2 * error.segment(50, 100).maxCoeff());
}

// Three signals on 400 even samples.
Signals some_signals(const std::string& unit) {
  Signals data;
  for (const char* name : {"a", "b", "c"})
    data.signals.push_back({name, unit, ChannelRole::kOutput});
  data.sample_time = 0.001;
  SignalPiece piece{.first_sample = 0, .time = even_times(400), .values = {}};
  piece.values.resize(400, 3);
  for (Eigen::Index k = 0; k < 3; ++k) {
    piece.values.col(k) = cosine(0.003 * static_cast<double>(k + 1), 400);
  }
  data.pieces.push_back(piece);
  return data;
}

// Coupled axes and a negative ratio: power is the same on both sides, and back is back.
TEST(Transmission, KeepsPowerAndReturns) {
  Eigen::Matrix3d matrix;
  matrix << -48.0, 0.0, 0.0, 0.0, 45.0, 0.0, 0.0, 32.0, 32.0;
  const std::vector<std::string> from{"a", "b", "c"};
  const std::vector<std::string> arm{"arm_a", "arm_b", "arm_c"};
  const std::vector<std::string> back{"back_a", "back_b", "back_c"};
  Signals speed = some_signals("rad/s");
  preprocess(
      "test",
      {Transmission{matrix, true, from, arm, {}}, Transmission{matrix, false, arm, back, {}}},
      speed);
  Signals torque = some_signals("N m");
  torque.pieces[0].values.col(1).array() += 0.7;
  preprocess(
      "test",
      {Transmission{matrix, true, from, arm, {}}, Transmission{matrix, false, arm, back, {}}},
      torque);
  const Eigen::MatrixXd& q = speed.pieces[0].values;
  const Eigen::MatrixXd& t = torque.pieces[0].values;
  EXPECT_LT((q.leftCols(3) - q.middleCols(3, 3) * matrix.transpose()).norm(), 1e-12);
  EXPECT_LT((q.leftCols(3) - q.rightCols(3)).norm(), 1e-12);
  EXPECT_LT((t.leftCols(3) - t.rightCols(3)).norm(), 1e-11);
  const Eigen::VectorXd motor_power =
      (q.leftCols(3).array() * t.leftCols(3).array()).rowwise().sum();
  const Eigen::VectorXd arm_power =
      (q.middleCols(3, 3).array() * t.middleCols(3, 3).array()).rowwise().sum();
  EXPECT_LT((motor_power - arm_power).cwiseAbs().maxCoeff(), 1e-12);
  // As the TX40's sheet says: torque on its axis 5 is 45 t5 + 32 t6.
  EXPECT_LT((t.col(4) - 45.0 * t.col(1) - 32.0 * t.col(2)).norm(), 1e-10);
}

TEST(Preprocess, DecimatesWhatWasFilteredAndRefusesTheRest) {
  const auto refused = [](Signals data, const std::vector<PreprocessStep>& steps,
                          const std::string& message) {
    testing::expect_refused([&] { preprocess("test", steps, data); }, message);
  };
  const Signals data = some_signals("rad");
  refused(data, {Decimate{4}}, "put a low_pass below it");
  refused(data, {LowPass{50.0, 4, {"a"}}, Decimate{4}}, "folds what b has above 125 Hz");
  refused(data, {LowPass{500.0, 4, {}}}, "not below the Nyquist frequency");
  Signals irregular = data;
  irregular.sample_time.reset();
  refused(irregular, {LowPass{50.0, 4, {}}}, "sample_time is irregular");
  refused(irregular, {Derivative{{"a"}, {"da"}, {}, true}}, "sample_time is irregular");
  Signals periodic = data;
  periodic.excitation = {.period = 100, .periods = 4, .lines = {1, 20}};
  refused(periodic, {LowPass{50.0, 4, {}}, Decimate{3}}, "doesn't divide");
  refused(periodic, {LowPass{50.0, 4, {}}, Decimate{5}}, "folds the excited line 20");
  // A channel combined from a filtered and an unfiltered one is unfiltered.
  const PreprocessStep couple =
      Transmission{Eigen::MatrixXd::Ones(2, 2) + Eigen::MatrixXd::Identity(2, 2),
                   true,
                   {"a", "b"},
                   {"d", "e"},
                   {}};
  refused(data, {LowPass{50.0, 4, {"a"}}, couple, LowPass{50.0, 4, {"b", "c"}}, Decimate{4}},
          "folds what d has above 125 Hz");
  Signals mixed = some_signals("rad");
  mixed.signals[1].unit = "rad/s";
  refused(mixed, {couple}, "all must be of one unit");
  refused(some_signals("N"),
          {Transmission{Eigen::MatrixXd::Identity(1, 1), true, {"a"}, {"d"}, {}}},
          "go through a transmission");

  Signals kept = data;
  preprocess("test", {LowPass{50.0, 4, {}}}, kept);
  Signals decimated = data;
  preprocess("test", {LowPass{50.0, 4, {}}, Decimate{4}, Derivative{{"a"}, {"da"}, {}}}, decimated);
  EXPECT_EQ(decimated.sample_time, 0.004);
  EXPECT_EQ(decimated.signals[3].unit, "rad/s");
  ASSERT_EQ(decimated.pieces[0].values.rows(), 100);
  for (Eigen::Index k = 0; k < 100; ++k) {
    EXPECT_EQ(decimated.pieces[0].values(k, 1), kept.pieces[0].values(4 * k, 1));
    EXPECT_EQ(decimated.pieces[0].time(k), kept.pieces[0].time(4 * k));
  }
}

TEST(Preprocess, TrimsBothEndsOfEachPiece) {
  const Signals data = some_signals("rad");
  Signals trimmed = data;
  preprocess("test", {Trim{0.0105}}, trimmed);
  const Eigen::Index before = data.pieces[0].values.rows();
  ASSERT_EQ(trimmed.pieces[0].values.rows(), before - 22);
  EXPECT_EQ(trimmed.pieces[0].first_sample, data.pieces[0].first_sample + 11);
  EXPECT_EQ(trimmed.pieces[0].time(0), data.pieces[0].time(11));
  EXPECT_EQ(trimmed.pieces[0].values, data.pieces[0].values.middleRows(11, before - 22));
  Signals periodic = data;
  periodic.excitation = {.period = 100, .periods = 4, .lines = {1, 20}};
  testing::expect_refused([&] { preprocess("test", {Trim{0.01}}, periodic); }, "would cut");
  testing::expect_refused([&] { preprocess("test", {Trim{0.2}}, trimmed); }, "leaves nothing");
}

TEST(Units, AreConsistent) {
  for (const Unit& unit : known_units()) {
    const Unit* base = find_unit(unit.base);
    ASSERT_NE(base, nullptr) << unit.name;
    EXPECT_EQ(base->factor, 1.0) << unit.name;
    EXPECT_GT(unit.factor, 0.0);
  }
  EXPECT_NEAR(find_unit("rpm")->factor * 60.0, find_unit("turn")->factor, 1e-12);
  EXPECT_EQ(find_unit("furlong"), nullptr);
}

// ---- the command --------------------------------------------------------------------------------

TEST_F(Recordings, CommandSummarisesAndTellsUsableFromUnusable) {
  const Outcome good = graybox("recordings . -o summary.json");
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_NE(good.out.find("2 experiments, samples every 0.001 s"), std::string::npos) << good.out;
  EXPECT_NE(good.out.find("u [N m]"), std::string::npos) << good.out;
  EXPECT_NE(good.out.find("b.csv (validation): 300 of 300 samples"), std::string::npos) << good.out;
  EXPECT_NE(testing::read_text(folder_.file("summary.json")).find("\"errors\": 0"),
            std::string::npos);
  write_campaign("sample_time: 0.001", "sample_time: 0.002");
  const Outcome bad = graybox("recordings campaign.yaml --json");
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_EQ(std::ranges::count(bad.out, '\n'), 1);
  EXPECT_NE(bad.out.find("\"errors\":2"), std::string::npos) << bad.out;
  expect_refused("recordings nowhere.yaml", "no such file");
}

TEST_F(Recordings, OfASimulatedDriveAreSound) {
  const std::string example = GRAYBOX_SOURCE_DIR "/docs/examples/simulate/";
  write_text(folder_.file("plan.yaml"), R"(format: graybox-plan/1
levels: [2.0]
realisations: 2
validation_realisations: 1
period: 1000
settling_periods: 1
periods: 2
frequencies: {from: 1, to: 80, count: 10, spacing: log}
)");
  const std::string simulate = "simulate " + example + "drive.yaml plan.yaml -o ";
  ASSERT_EQ(graybox(simulate + "drive").exit_code, 0);
  const Outcome outcome = graybox("recordings drive --json");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_NE(outcome.out.find("\"errors\":0"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("\"warnings\":0"), std::string::npos) << outcome.out;
  const Campaign campaign = read_campaign(folder_.file("drive"));
  ASSERT_EQ(campaign.experiments.size(), 2U);
  const ExperimentRecording run = load_experiment(campaign, 1);
  EXPECT_EQ(campaign.experiments[1].role, ExperimentRole::kValidation);
  EXPECT_EQ(campaign.experiments[1].realisation, 2U);
  EXPECT_EQ(run.samples, 2000U);
  ASSERT_TRUE(run.data.excitation.has_value());
  EXPECT_EQ(run.data.excitation->period, 1000U);
  EXPECT_EQ(run.data.signals[static_cast<std::size_t>(run.index_of("speed"))].unit, "rad/s");
  EXPECT_NEAR(campaign.channels.at(1).noise, 0.005, 1e-12);
}

}  // namespace
}  // namespace graybox
