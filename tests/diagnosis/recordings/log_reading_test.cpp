// Logs as they come: steps that mend and derive channels, JSON records and gzip, and channels of
// one motion that are late, reversed or scaled.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/time_stamp.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/recordings/late_signal.hpp"
#include "diagnosis/recordings/motion_pairs.hpp"
#include "diagnosis/recordings/sample_interpolation.hpp"
#include "diagnosis/signal_faults/wrong_stamp.hpp"
#include "tests/support/recorded_channels.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// ---- preprocessing ------------------------------------------------------------------------------

const std::string kHead = R"(format: graybox-campaign/1
sample_time: 0.001
channels:
  - {name: q, unit: deg, is: output}
  - {name: v, unit: rad/s, is: output}
  - {name: u, unit: V, is: input}
  - {name: state, unit: counts, is: other}
)";

class LogReading : public ::testing::Test {
 protected:
  LogReading() {
    write(400, [](Index) { return 3; });
  }

  // Columns t, q (degrees within one turn), v, u, state.
  void write(Index count, const std::function<int(Index)>& state, double jitter = 0.0) {
    std::string text = "time,q,v,u,state\n";
    for (Index k = 0; k < count; ++k) {
      const double t = 0.001 * (static_cast<double>(k) + jitter * std::sin(2.3 * double(k)));
      const double angle = angle_at(t) * 180.0 / std::numbers::pi;
      const double within = angle - 360.0 * std::floor(angle / 360.0);
      for (const double value : {t, within, rate_at(t), 12.0 + std::sin(31.0 * t)}) {
        text += std::to_string(value) + ",";
      }
      text += std::to_string(state(k)) + "\n";
    }
    testing::write_text(folder_.file("a.csv"), text);
  }
  static double angle_at(double t) { return 20.0 * t + std::sin(9.0 * t); }
  static double rate_at(double t) { return 20.0 + 9.0 * std::cos(9.0 * t); }

  ExperimentRecording read(const std::string& steps, const std::string& sample_time = "0.001") {
    std::string text = kHead;
    text.replace(text.find("0.001"), 5, sample_time);
    testing::write_text(folder_.file("campaign.yaml"),
                        text + "preprocess: " + steps + "\nexperiments: [{file: a.csv}]\n");
    return load_experiment(read_campaign(folder_.file("campaign.yaml")), 0);
  }
  void refused(const std::string& steps, const std::string& message) {
    testing::expect_refused([&] { (void)read(steps); }, message);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(LogReading, UnwrapsAngles) {
  const ExperimentRecording run = read("[{kind: unwrap, of: [q]}]");
  const SignalPiece& piece = run.data.pieces.at(0);
  for (Index k = 0; k < piece.time.size(); ++k) {
    EXPECT_NEAR(piece.values(k, 0), angle_at(piece.time(k)), 1e-6);
  }
  EXPECT_TRUE(std::ranges::any_of(run.findings, [](const Finding& finding) {
    return finding.message.find("q: 1 jumps") != std::string::npos;
  }));
  EXPECT_TRUE(std::ranges::none_of(run.findings,
                                   [](const Finding& finding) { return finding.check == "wrap"; }));
  const ExperimentRecording raw = read("[]");
  EXPECT_TRUE(std::ranges::any_of(raw.findings, [](const Finding& finding) {
    return finding.check == "wrap" && finding.mend == "preprocess: [{kind: unwrap, of: [q]}]" &&
           finding.channel == "q";
  }));
}

// A sample before a gap is left out by resampling, and the gap is no time that was recorded.
TEST_F(LogReading, AGapIsNoTimeThatSamplesCover) {
  std::string text = "time,q,v,u,state\n0,7.5575,0.2103,11.83,3\n";
  for (int k = 0; k < 400; ++k) {
    const double t = 0.4 + 0.001 * (k + 0.2 * std::sin(2.3 * k));
    text += fmt::format("{:.7f},{:.7f},{:.7f},{:.7f},3\n", t, 20.0 * t + std::sin(9.0 * t),
                        0.3 + 0.1 * std::cos(9.0 * t), 12.0 + std::sin(31.0 * t));
  }
  testing::write_text(folder_.file("a.csv"), text);
  const ExperimentRecording run = read("[{kind: resample, sample_time: 0.001}]", "irregular");
  ASSERT_EQ(run.data.pieces.size(), 1U);
  EXPECT_EQ(run.samples, 401U);
  EXPECT_NEAR(run.duration, 0.4, 0.003);
}

TEST_F(LogReading, APositionInFewLevelsIsCoarse) {
  std::string text = "time,q,v,u,state\n";
  for (int k = 0; k < 800; ++k) {
    const double t = 0.001 * k, level = std::round(4.0 - 4.0 * std::cos(17.0 * t));
    text += fmt::format("{:.3f},{:g},{:.7f},{:g},3\n", t, 20.0 * level, std::sin(17.0 * t), level);
  }
  testing::write_text(folder_.file("a.csv"), text);
  const ExperimentRecording run = read("[]");
  const auto is_coarse = [&](const std::string& channel) {
    return std::ranges::any_of(run.findings, [&](const Finding& finding) {
      return finding.check == "quantisation" && finding.channel == channel;
    });
  };
  EXPECT_TRUE(is_coarse("q"));
  EXPECT_FALSE(is_coarse("u")) << "a drive may switch";
}

TEST_F(LogReading, SamplesThatAreNotValidCutPieces) {
  const auto by_state = [&](const std::string& step, Index first, Index second) {
    const ExperimentRecording run = read(step);
    ASSERT_EQ(run.data.pieces.size(), 2U);
    EXPECT_EQ(run.data.pieces[0].time.size(), first);
    EXPECT_EQ(run.data.pieces[1].time.size(), second);
    EXPECT_EQ(run.data.pieces[1].first_sample, 250U);
  };
  write(400, [](Index k) { return k >= 100 && k < 250 ? 0 : 3; });
  by_state("[{kind: rows, by: state, equals: 3}]", 100, 150);
  by_state("[{kind: valid, of: [state], range: [1, 5]}]", 100, 150);
  refused("[{kind: rows, by: state, equals: 9}]", "no 20 samples in a row");
}

TEST_F(LogReading, MissingNumbersAreMissing) {
  std::string text = "time,q,v,u,state\n";
  for (int k = 0; k < 100; ++k) {
    text +=
        std::to_string(0.001 * k) + "," + (k == 40 ? "" : std::to_string(0.1 * k)) + ",1.5,2,3\n";
  }
  testing::write_text(folder_.file("a.csv"), text);
  refused("[]", "1 of 100 samples are not finite");
  const ExperimentRecording run = read("[{kind: valid, of: [q]}]");
  ASSERT_EQ(run.data.pieces.size(), 2U);
  EXPECT_EQ(run.data.pieces[1].first_sample, 41U);
}

TEST_F(LogReading, DerivesChannels) {
  const ExperimentRecording run = read(
      "[{kind: sign, of: [v]}, {kind: scale, of: [u], factor: 2},\n"
      "  {kind: integral, of: [v], name: [angle]},\n"
      "  {kind: product, of: [u, v], name: power, unit: '1', is: other},\n"
      "  {kind: sum, of: [q, angle], weights: [1, -2], name: both},\n"
      "  {kind: motor_torque, voltage: u, speed: v, torque_constant: 0.1, back_emf: 0.2,\n"
      "   resistance: 4, name: torque}]");
  const SignalPiece& piece = run.data.pieces.at(0);
  const auto value = [&](Index k, const std::string& name) {
    return piece.values(k, run.index_of(name));
  };
  for (const Index k : {0, 17, 399}) {
    const double t = piece.time(k), u = 2.0 * (12.0 + std::sin(31.0 * t)), v = -rate_at(t);
    EXPECT_NEAR(value(k, "v"), v, 1e-5);
    EXPECT_NEAR(value(k, "angle"), -(angle_at(t) - angle_at(0.0)), 1e-4);
    EXPECT_NEAR(value(k, "power"), u * v, 1e-3);
    EXPECT_NEAR(value(k, "both"), value(k, "q") - 2.0 * value(k, "angle"), 1e-9);
    EXPECT_NEAR(value(k, "torque"), 0.1 / 4.0 * (u - 0.2 * v), 1e-5);
  }
  EXPECT_EQ(run.data.signals.at(static_cast<std::size_t>(run.index_of("angle"))).unit, "rad");
  EXPECT_EQ(run.data.signals.at(static_cast<std::size_t>(run.index_of("torque"))).unit, "N m");
  EXPECT_EQ(run.data.signals.at(static_cast<std::size_t>(run.index_of("torque"))).role,
            ChannelRole::kInput);
}

TEST_F(LogReading, ResamplesUnevenTimesAndStatesTheError) {
  write(
      2000, [](Index) { return 3; }, 0.3);
  const ExperimentRecording run =
      read("[{kind: unwrap, of: [q]}, {kind: resample, sample_time: 0.001}]", "irregular");
  ASSERT_TRUE(run.data.sample_time);
  const SignalPiece& piece = run.data.pieces.at(0);
  double worst = 0.0;
  for (Index k = 0; k < piece.time.size(); ++k) {
    EXPECT_NEAR(piece.time(k), piece.time(0) + 0.001 * static_cast<double>(k), 1e-9);
    worst = std::max(worst, std::abs(piece.values(k, 1) - rate_at(piece.time(k))));
  }
  EXPECT_LT(worst, 1e-4);
  EXPECT_TRUE(std::ranges::any_of(run.findings, [](const Finding& finding) {
    return finding.message.find("was resampled: what interpolation is wrong by") !=
               std::string::npos &&
           finding.message.find(", v ") != std::string::npos;
  }));
  testing::expect_refused([&] { (void)read("[{kind: resample, sample_time: 0.01}]", "irregular"); },
                          "would fold");
  write(400, [](Index) { return 3; });
  refused("[{kind: resample, sample_time: 0.001}]", "is for irregular samples");
}

// A microcontroller writes seven samples and then sends them: its pauses are no gaps. A pause that
// comes once is one.
TEST_F(LogReading, BurstsOfSamplesAreOneRecording) {
  for (const bool is_often : {true, false}) {
    std::string text = "time,q,v,u,state\n";
    double t = 0.0;
    for (int k = 0; k < 400; ++k) {
      text += std::to_string(t) + ",0," + std::to_string(rate_at(t)) + ",12,3\n";
      const bool pauses = is_often ? k % 7 == 6 : k == 200;
      t += pauses ? 0.012 : 0.002;
    }
    testing::write_text(folder_.file("a.csv"), text);
    const ExperimentRecording run = read("[{kind: resample, sample_time: 0.002}]", "irregular");
    ASSERT_EQ(run.data.pieces.size(), is_often ? 1U : 2U);
    const SignalPiece& piece = run.data.pieces.front();
    for (Index k = 0; k < piece.time.size(); ++k) {
      EXPECT_NEAR(piece.values(k, 1), rate_at(piece.time(k)), 2e-3);
    }
  }
  testing::expect_refused([&] { (void)read("[{kind: resample, sample_time: 0.02}]", "irregular"); },
                          "would fold");
}

// The stated error is that of a signal whose values between samples are known, within a factor.
TEST(SampleInterpolation, StatesItsError) {
  for (const double frequency : {0.3, 0.6, 1.0}) {  // rad a sample
    const VectorXd time = VectorXd::LinSpaced(500, 0.0, 499.0);
    const VectorXd values = (frequency * time.array()).sin();
    const VectorXd at = VectorXd::LinSpaced(4900, 5.0, 494.0);
    const VectorXd error = interpolated(time, values, at).array() - (frequency * at.array()).sin();
    const double rms = std::sqrt(error.squaredNorm() / 4900.0);
    const double stated = interpolation_error(time, values);
    EXPECT_GT(stated, 0.7 * rms) << frequency;
    EXPECT_LT(stated, 2.0 * rms) << frequency;
  }
}

// A logger that writes four rows at once, then pauses: a cubic through a burst would leave all
// bounds in the pause.
TEST(SampleInterpolation, StaysWithinTheSamplesBesideABurst) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> noise(-1.0, 1.0);
  VectorXd time(80), values(80);
  for (Index k = 0; k < 80; ++k) {
    time(k) = 0.05 * static_cast<double>(k / 4) + 0.001 * static_cast<double>(k % 4);
    values(k) = noise(random);
  }
  const VectorXd at = VectorXd::LinSpaced(2000, time(0), time(79));
  EXPECT_LE(interpolated(time, values, at).cwiseAbs().maxCoeff(), 1.5);
  EXPECT_GT(interpolation_error(time, values), 0.15) << "of noise nothing is known between samples";
}

TEST_F(LogReading, PartsOfOneFileAreToldApart) {
  const std::string channels = "channels: [{name: q, unit: rad, is: output}]\n";
  testing::write_text(folder_.file("q.csv"), "q\n1\n2\n4\n7\n11\n16\n");
  std::filesystem::create_directory(folder_.file("more"));
  testing::write_text(folder_.file("more/q.csv"), "q\n1\n2\n4\n7\n11\n16\n");
  const auto names = [&](const std::string& experiments) {
    testing::write_text(folder_.file("parts.yaml"),
                        "format: graybox-campaign/1\nsample_time: 0.1\n" + channels +
                            "experiments:\n" + experiments);
    std::vector<std::string> list;
    for (const Experiment& each : read_campaign(folder_.file("parts.yaml")).experiments) {
      list.push_back(each.name);
    }
    return list;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names("  - {file: q.csv, segments: [[0, 2]]}\n"), Names{"q.csv"});
  EXPECT_EQ(names("  - {file: q.csv, segments: [[0, 2]]}\n"
                  "  - {file: q.csv, segments: [[3, 5]], role: validation}\n"),
            (Names{"q.csv (samples 0 to 2)", "q.csv (samples 3 to 5)"}));
  EXPECT_EQ(names("  - {file: q.csv}\n  - {file: more/q.csv, segments: [[0, 1], [3, 4]]}\n"),
            (Names{"q.csv", "more/q.csv (samples 0 to 1 and 3 to 4)"}));
}

TEST_F(LogReading, WrongStepsAreRefusedInOneLine) {
  refused("[{kind: low_pass, frequency: 10}, {kind: unwrap, of: [q]}]", "put it before all other");
  refused("[{kind: unwrap, of: [u]}]", "which has no turns");
  refused("[{kind: unwrap, of: [q], bits: 12}]", "must be 8, 16 or 32");
  refused("[{kind: unwrap, of: [q], bits: 8, period: 360}]", "either bits or period");
  refused("[{kind: rows, by: state}]", "needs either equals");
  refused("[{kind: rows, by: mode, equals: 1}]", "no such channel");
  refused("[{kind: valid, of: [q], range: [2, 1]}]", "[lowest, highest]");
  refused("[{kind: scale, of: [q], factor: 0}]", "must not be zero");
  refused("[{kind: integral, of: [u], name: [x]}]", "u is in V");
  refused("[{kind: sum, of: [q, v], name: x}]", "v is in rad/s, but must be in rad");
  refused("[{kind: sum, of: [q], name: x}]", "at least two channels");
  refused("[{kind: product, of: [q, v], name: x, unit: deg}]", "a unit without a factor");
  refused(
      "[{kind: motor_torque, voltage: q, speed: v, torque_constant: 1, back_emf: 1,\n"
      "  resistance: 1, name: x}]",
      "q is in rad, but must be in V");
  refused(
      "[{kind: motor_torque, voltage: u, speed: v, torque_constant: 1, back_emf: 1,\n"
      "  resistance: 0, name: x}]",
      "resistance: must be positive");
  refused("[{kind: advance, of: [q], time: 100}]", "longer than a piece");
}

// ---- JSON records and gzip ----------------------------------------------------------------------

void write_gzip(const std::string& path, const std::string& text) {
  gzFile file = gzopen(path.c_str(), "wb");
  ASSERT_NE(file, nullptr);
  ASSERT_EQ(gzwrite(file, text.data(), static_cast<unsigned>(text.size())),
            static_cast<int>(text.size()));
  ASSERT_EQ(gzclose(file), Z_OK);
}

const std::string kLines =
    "{\"t\": 0, \"joint\": {\"q\": [1, 2]}, \"on\": true, \"mode\": \"run\"}\n\n"
    "{\"t\": 0.1, \"joint\": {\"q\": [3, null]}, \"on\": false, \"mode\": \"run\"}\n"
    "{\"t\": 0.2, \"on\": false, \"late\": 7}\n";

void expect_records(const RecordingFile& file) {
  ASSERT_EQ(file.columns.size(), 5U);
  EXPECT_EQ(file.at("t").values, Eigen::Vector3d(0.0, 0.1, 0.2));
  EXPECT_EQ(file.at("joint.q[1]").values.head(2), Eigen::Vector2d(1.0, 3.0));
  EXPECT_TRUE(std::isnan(file.at("joint.q[1]").values(2)));
  EXPECT_TRUE(std::isnan(file.at("joint.q[2]").values(1)));
  EXPECT_EQ(file.at("on").values, Eigen::Vector3d(1.0, 0.0, 0.0));
  EXPECT_TRUE(std::isnan(file.at("late").values(0)));
  EXPECT_EQ(file.at("late").values(2), 7.0);
}

TEST_F(LogReading, JsonRecordsAreColumns) {
  testing::write_text(folder_.file("a.jsonl"), kLines);
  expect_records(read_recording_file(folder_.file("a.jsonl")));
  std::string array = "[" + kLines + "]";
  for (std::size_t at = 0; (at = array.find("}\n", at)) != std::string::npos; at += 2) {
    if (array.find('{', at) != std::string::npos) array.replace(at, 2, "},");
  }
  testing::write_text(folder_.file("a.json"), array);
  expect_records(read_recording_file(folder_.file("a.json")));
  const auto fails = [&](const std::string& text, const std::string& message) {
    testing::write_text(folder_.file("b.jsonl"), text);
    testing::expect_refused([&] { (void)read_recording_file(folder_.file("b.jsonl")); }, message);
  };
  fails("{\"a\": 1}\n{\"a\": 2\n", "line 2: not valid JSON");
  fails("{\"a\": 1}\n[2]\n", "record 2: is no object");
  fails("{\"a\": 1}\n{\"a\": \"x\"}\n", "record 2: 'a' holds text");
  fails("{\"mode\": \"run\"}\n", "no columns of numbers");
  std::string deep;
  for (int k = 0; k < 40; ++k) deep += "{\"a\":";
  fails(deep + "1" + std::string(40, '}') + "\n", "nested too deep");
}

TEST_F(LogReading, GzippedTextsAreReadAsTheyAre) {
  const std::string table = "a,b [deg]\n1,2\n3,4\n";
  write_gzip(folder_.file("t.csv.gz"), table);
  const RecordingFile file = read_recording_file(folder_.file("t.csv.gz"));
  EXPECT_EQ(file.at("b").values, Eigen::Vector2d(2.0, 4.0));
  EXPECT_EQ(file.at("b").unit, "deg");
  write_gzip(folder_.file("t.jsonl.gz"), kLines);
  expect_records(read_recording_file(folder_.file("t.jsonl.gz")));
  // Two members are one text.
  const std::string packed = testing::read_text(folder_.file("t.csv.gz"));
  write_gzip(folder_.file("more.gz"), "5,6\n");
  testing::write_text(folder_.file("two.csv.gz"),
                      packed + testing::read_text(folder_.file("more.gz")));
  EXPECT_EQ(read_recording_file(folder_.file("two.csv.gz")).at("a").values,
            Eigen::Vector3d(1.0, 3.0, 5.0));
  const auto fails = [&](const std::string& name, const std::string& bytes,
                         const std::string& message) {
    testing::write_text(folder_.file(name), bytes);
    testing::expect_refused([&] { (void)read_recording_file(folder_.file(name)); }, message);
  };
  fails("cut.csv.gz", packed.substr(0, packed.size() - 9), "ends early");
  fails("no.csv.gz", table, "is no gzip file");
  fails("x.mat.gz", packed, "unknown ending '.mat.gz'");
}

// ---- times --------------------------------------------------------------------------------------

struct StampCase {
  const char* text;
  std::int64_t day;
  double seconds;
};

// Days by `date -d 2024-05-01 +%s`, over 86400.
TEST(TimeStamps, AreReadAsPeopleWriteThem) {
  constexpr std::int64_t kFirstOfMay = 19844;
  for (const StampCase& each :
       std::vector<StampCase>{{"2024-05-01 12:00:00.010", kFirstOfMay, 43200.01},
                              {"2024-05-01T12:00:00.010", kFirstOfMay, 43200.01},
                              {"2024-05-01T12:00:00Z", kFirstOfMay, 43200.0},
                              {"2024-05-01T12:00:00.5+02:00", kFirstOfMay, 36000.5},
                              {"2024-05-01T01:00:00+0200", kFirstOfMay - 1, 82800.0},
                              {"2024-05-01 23:30:00-01", kFirstOfMay + 1, 1800.0},
                              {"2024/05/01 00:00:01", kFirstOfMay, 1.0},
                              {"01.05.2024 12:00:00,25", kFirstOfMay, 43200.25},
                              {"2024-05-01", kFirstOfMay, 0.0},
                              {"12:00:00.010", 0, 43200.01},
                              {"7:05:09", 0, 25509.0},
                              {"12:00:00:250", 0, 43200.25},
                              {"12:00:01 AM", 0, 1.0},
                              {"1:00:00.5 PM", 0, 46800.5},
                              {"1970-01-02 00:00:00.123456789", 1, 0.123456789}}) {
    const auto stamp = parse_time_stamp(each.text);
    ASSERT_TRUE(stamp) << each.text;
    EXPECT_EQ(stamp->day, each.day) << each.text;
    EXPECT_NEAR(stamp->seconds, each.seconds, 1e-10) << each.text;
  }
  for (const char* none :
       {"2024-13-01 12:00:00", "2023-02-29", "12:60:00", "24:00:01", "12:00", "1,5", "357,702", "",
        "2024-05-01 12:00:00 o'clock", "2024-05-01 12:00:00.", "13:00:00 PM", "two", "1.5.3",
        "2024-05-01T12:00:00+99:00", "-1:00:00.0", "192.168.10.12"}) {
    EXPECT_FALSE(parse_time_stamp(none)) << none;
  }
}

// The column named `time` of a table with these stamps every 10 ms, from half a second before `at`.
VectorXd times_of(const RecordingFile& file, const std::string& name) {
  const RecordedColumn& column = file.at(name);
  EXPECT_EQ(column.unit, "s");
  EXPECT_FALSE(column.origin.empty());
  return column.values;
}

TEST_F(LogReading, TimeStampsAreSeconds) {
  const auto table = [&](const std::string& head, const std::vector<std::string>& stamps,
                         const std::string& sign) {
    std::string text = head + "\n";
    for (std::size_t k = 0; k < stamps.size(); ++k) {
      text += stamps[k] + sign + std::to_string(k) + sign + "0.5\n";
    }
    testing::write_text(folder_.file("s.csv"), text);
    return read_recording_file(folder_.file("s.csv"));
  };
  const auto expect = [&](const VectorXd& times, const std::vector<double>& seconds) {
    ASSERT_EQ(times.size(), static_cast<Index>(seconds.size()));
    for (std::size_t k = 0; k < seconds.size(); ++k) {
      EXPECT_NEAR(times(static_cast<Index>(k)), seconds[k], 1e-10);
    }
  };
  const RecordingFile iso =
      table("Timestamp,q,u", {"2024-05-01 12:00:00.000", "2024-05-01 12:00:00.010"}, ",");
  expect(times_of(iso, "Timestamp"), {43200.0, 43200.01});
  EXPECT_NE(iso.at("Timestamp").origin.find("2024-05-01 12:00:00.000, to 1 ms"), std::string::npos);
  EXPECT_EQ(iso.at("q").values(1), 1.0);
  expect(times_of(table("Uhrzeit;q;u", {"12:00:00,500", "12:00:00,510"}, ";"), "Uhrzeit"),
         {43200.5, 43200.51});
  // Over midnight, by the clock alone and with the day in the stamp or beside it.
  const std::vector<double> over{86399.99, 86400.0, 86400.01};
  expect(times_of(table("t,q,u", {"23:59:59.99", "00:00:00.00", "00:00:00.01"}, ","), "t"), over);
  expect(
      times_of(table("t,q,u",
                     {"2024-02-28 23:59:59.99", "2024-02-29 00:00:00.00", "2024-02-29 00:00:00.01"},
                     ","),
               "t"),
      over);
  for (const char* head : {"Date,Time,q,u", "Date Time q u", "Timestamp q u"}) {
    const std::string sign = std::string(head).find(',') == std::string::npos ? " " : ",";
    const RecordingFile apart =
        table(head,
              {"2024-02-28" + sign + "23:59:59.99", "2024-02-29" + sign + "00:00:00.00",
               "2024-02-29" + sign + "00:00:00.01"},
              sign);
    ASSERT_EQ(apart.columns.size(), 3U) << head;
    expect(times_of(apart, apart.columns[0].name), over);
    EXPECT_EQ(apart.at("q").values(2), 2.0) << head;
  }
  // A run that begins again falls; a number or a word among stamps is refused.
  expect(times_of(table("t,q,u", {"12:00:05.0", "12:00:00.0"}, ","), "t"), {43205.0, 43200.0});
  for (const char* bad : {"12.5", "noon", "2024-05-01 12:00:00"}) {
    testing::expect_refused(
        [&] {
          table("t,q,u", {"12:00:00.0", bad}, ",");
        },
        "is no time stamp like the first, 12:00:00.0");
  }
  testing::expect_refused([&] { table("t,q,u", {"12.5", "12:00:00.0"}, ","); }, "is no number");
}

// A column of states, or of hexadecimal flags, is none of samples; a word among numbers is damage.
TEST_F(LogReading, ColumnsOfWordsAreLeftOutAndWordsAmongNumbersRefused) {
  testing::write_text(folder_.file("s.csv"),
                      "t,state,q,flags\n0,RUNNING,1,0x0000\n1,STOPPED,2,0x0001\n2,,3,7\n");
  const RecordingFile file = read_recording_file(folder_.file("s.csv"));
  ASSERT_EQ(file.columns.size(), 2U);
  EXPECT_EQ(file.at("q").values, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(file.left_out, (std::vector<std::string>{"state", "flags"}));
  ASSERT_EQ(file.remarks.size(), 2U);
  EXPECT_NE(file.remarks[0].find("'state' holds words as 'RUNNING'"), std::string::npos);
  testing::write_text(folder_.file("s.csv"), "t,q\n0,1\n1,ERROR\n2,ERROR\n3,4\n");
  testing::expect_refused([&] { (void)read_recording_file(folder_.file("s.csv")); },
                          "line 3, column 'q': 'ERROR' is no number");
  // Commas of a list are no decimal ones.
  testing::write_text(folder_.file("s.csv"), "t,q\n0,\"[-0.0038, 1]\"\n1,\"[-0.0039, 2]\"\n");
  testing::expect_refused([&] { (void)read_recording_file(folder_.file("s.csv")); },
                          "is no number but a list in one cell; give each of its values a column");
  testing::write_text(folder_.file("s.csv"), "t,q\nON,A\nOFF,B\n");
  testing::expect_refused([&] { (void)read_recording_file(folder_.file("s.csv")); }, "s.csv: ");
}

TEST_F(LogReading, ADayAboveTheHeaderIsATitleAndRecordsMayHoldStamps) {
  testing::write_text(folder_.file("s.csv"), "Log\n2024-05-01\nt,q\n0,1\n1,2\n");
  EXPECT_EQ(read_recording_file(folder_.file("s.csv")).at("q").values, Eigen::Vector2d(1.0, 2.0));
  testing::write_text(folder_.file("s.jsonl"),
                      "{\"t\": \"2024-05-01T12:00:00Z\", \"q\": 1}\n"
                      "{\"t\": \"2024-05-01T12:00:00.5Z\", \"q\": 2}\n");
  EXPECT_EQ(times_of(read_recording_file(folder_.file("s.jsonl")), "t"),
            Eigen::Vector2d(43200.0, 43200.5));
}

// Channels of a recorder above, the signals that they held below.
TEST_F(LogReading, TwoLinesOfTitlesAreOneTitle) {
  testing::write_text(folder_.file("s.csv"),
                      "Axis1\nSampling time interval(ms),0.667\nTime,Analog 1,Analog 2\n"
                      "ms,Servo motor speed,Torque\n0,1,2\n1,3,4\n");
  const RecordingFile file = read_recording_file(folder_.file("s.csv"));
  ASSERT_EQ(file.columns.size(), 3U);
  EXPECT_EQ(file.columns[0].unit, "ms");
  EXPECT_EQ(file.columns[1].name, "Analog 1 Servo motor speed");
  EXPECT_EQ(file.at("Analog 2 Torque").values, Eigen::Vector2d(2.0, 4.0));
  // Units that graybox does not know are units all the same.
  testing::write_text(folder_.file("s.csv"), "t,q,u\ns,lsb,ticks\n0,1,2\n1,3,4\n");
  EXPECT_EQ(read_recording_file(folder_.file("s.csv")).at("q").unit, "lsb");
}

// A campaign reads stamps as the time of its samples, and a unit by what it means.
TEST_F(LogReading, ACampaignTakesStampsAndUnitsAsWritten) {
  std::string text = "Clock,q,u\nhh:mm:ss,Nm,V\n";
  for (int k = 0; k < 200; ++k) {
    const int stamp = 59900 + k;  // ms behind 12:00
    text += "12:0" + std::to_string(stamp / 60000) + ":" +
            std::to_string(100 + stamp / 1000 % 60).substr(1) + "." +
            std::to_string(1000 + stamp % 1000).substr(1) + "," +
            std::to_string(std::sin(0.1 * k)) + ",1\n";
  }
  testing::write_text(folder_.file("a.csv"), text);
  const auto loaded = [&](const std::string& unit) {
    testing::write_text(folder_.file("campaign.yaml"),
                        "format: graybox-campaign/1\nsample_time: irregular\n"
                        "time: {column: Clock, unit: s}\nchannels:\n  - {name: q, unit: " +
                            unit +
                            ", is: output}\n  - {name: u, unit: V, is: input}\n"
                            "experiments: [{file: a.csv}]\n");
    return load_experiment(read_campaign(folder_.file("campaign.yaml")), 0);
  };
  for (const char* unit : {"N m", "Nm"}) {
    const ExperimentRecording run = loaded(unit);
    const VectorXd& time = run.data.pieces.at(0).time;
    ASSERT_EQ(time.size(), 200);
    EXPECT_NEAR(time(199) - time(0), 0.199, 1e-9);
    EXPECT_NEAR(time(0), 43259.9, 1e-9);
  }
  testing::expect_refused([&] { loaded("mN m"); }, "q is in Nm, but the campaign says mN m");
}

TEST_F(LogReading, SecondsAndNanosecondsAreOneTime) {
  const auto read = [&](const std::string& text) {
    testing::write_text(folder_.file("r.csv"), text);
    return read_recording_file(folder_.file("r.csv"));
  };
  // 1714521600 is a midnight.
  for (const auto& [whole, rest, name] :
       {std::tuple{"header.stamp.sec", "header.stamp.nanosec", "header.stamp"},
        {"field.header.stamp.secs", "field.header.stamp.nsecs", "field.header.stamp"},
        {"header_stamp_sec", "header_stamp_nsec", "header_stamp"},
        {"sec", "nanosec", "time"}}) {
    const std::string head = std::string(whole) + "," + rest + ",q\n";
    const RecordingFile file = read(head + "1714521607,999999999,1\n1714521608,1,2\n");
    ASSERT_EQ(file.columns.size(), 2U) << whole;
    const VectorXd times = times_of(file, name);
    EXPECT_NEAR(times(0), 7.999999999, 1e-14);
    EXPECT_NEAR(times(1), 8.000000001, 1e-14);
  }
  // No rest of a second, or none that belongs to it.
  EXPECT_EQ(read("t.sec,t.nanosec,q\n0,0,1\n1,1000000000,2\n").columns.size(), 3U);
  EXPECT_EQ(read("t.sec,t.nanosec,q\n0,0,1\n0.5,1,2\n").columns.size(), 3U);
  EXPECT_EQ(read("a.sec,b.nanosec,q\n0,0,1\n1,1,2\n").columns.size(), 3U);
  EXPECT_EQ(read("t.sec,t.nanosec,t\n0,0,1\n1,1,2\n").columns.size(), 3U);
}

// Thousands of them, half without a rest: the search took minutes of a file of 75 kB.
TEST_F(LogReading, ThousandsOfTimesInTwoColumnsAreJoinedInOneLook) {
  constexpr std::size_t kTimes = 1500;
  std::string head, row;
  for (std::size_t k = 0; k < kTimes; ++k) {
    head += fmt::format("a{}.sec,", k);
    row += "1,";
  }
  for (std::size_t k = 0; k < kTimes; ++k) {
    head += fmt::format("b{0}.nanosec,b{0}.sec,", k);
    row += "500000000,2,";
  }
  testing::write_text(folder_.file("r.csv"), head + "q\n" + row + "3\n" + row + "3\n");
  const RecordingFile file = read_recording_file(folder_.file("r.csv"));
  EXPECT_EQ(file.columns.size(), 2 * kTimes + 1);
  EXPECT_EQ(file.at("a7.sec").values(0), 1.0);
  EXPECT_EQ(file.at("b7").values(0), 2.5);
  EXPECT_EQ(file.at("b7").origin, "'b7.sec' and 'b7.nanosec'");
  EXPECT_EQ(file.columns.back().name, "q");
}

// ---- pairs of one motion ------------------------------------------------------------------------

struct Motion {
  VectorXd time, position, velocity;
};

double smooth(double t) {
  return std::sin(7.0 * t) + 0.5 * std::sin(31.0 * t + 1.0) + 0.2 * std::sin(90.0 * t);
}
double smooth_rate(double t) {
  return 7.0 * std::cos(7.0 * t) + 15.5 * std::cos(31.0 * t + 1.0) + 18.0 * std::cos(90.0 * t);
}

// The velocity late by a delay; noise of a thousandth.
Motion motion(Index count, double delay, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  Motion result{VectorXd(count), VectorXd(count), VectorXd(count)};
  for (Index k = 0; k < count; ++k) {
    const double t = 0.001 * static_cast<double>(k);
    result.time(k) = t;
    result.position(k) = smooth(t) + 1e-5 * noise(random);
    result.velocity(k) = smooth_rate(t - delay) + 0.02 * noise(random);
  }
  return result;
}

VectorXd lagged(const VectorXd& values, double lag) {
  VectorXd result = values;
  for (Index k = 1; k < values.size(); ++k) {
    const double decay = std::exp(-1.0 / lag);
    result(k) = decay * result(k - 1) + (1.0 - decay) * 0.5 * (values(k) + values(k - 1));
  }
  return result;
}

TEST(LateSignals, DelayAndLagAreToldApartWithTheirErrors) {
  const Motion late = motion(5000, 0.0034, 1);
  const VectorXd rate = time_derivative(late.time, late.position);
  const LateComparison delay = compare_late(rate, -2.0 * late.velocity, 0.001);
  EXPECT_NEAR(delay.best().late, 0.0034, 5e-5);
  EXPECT_LT(delay.best().late_error, 5e-5);
  EXPECT_NEAR(delay.best().gain, -2.0, 0.01);
  EXPECT_TRUE(delay.tells_delay_from_lag());
  EXPECT_LT(delay.delayed.misfit, delay.lagged.misfit);
  const Motion now = motion(5000, 0.0, 2);
  const LateComparison lag =
      compare_late(time_derivative(now.time, now.position), lagged(now.velocity, 6.0), 0.001);
  EXPECT_NEAR(lag.best().late, 0.006, 2e-4);
  EXPECT_LT(lag.lagged.misfit, 0.5 * lag.delayed.misfit);
  EXPECT_LE(lag.both.misfit, 1.0001 * lag.lagged.misfit);
}

// In 95 of 100 draws and more the true delay lies within three of the stated errors.
TEST(LateSignals, ErrorsAreThoseOfRepetitions) {
  int inside = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Motion late = motion(2000, 0.0012, 100 + seed);
    const LateComparison fit =
        compare_late(time_derivative(late.time, late.position), late.velocity, 0.001);
    if (std::abs(fit.delayed.late - 0.0012) < 3.0 * fit.delayed.late_error) ++inside;
  }
  EXPECT_GE(inside, 36);
}

std::vector<Finding> findings_of(const Motion& motion, const VectorXd& velocity) {
  Signals data;
  data.sample_time = 0.001;
  data.signals = {{"q", "rad", ChannelRole::kOutput}, {"v", "rad/s", ChannelRole::kOutput}};
  Eigen::MatrixXd values(motion.time.size(), 2);
  values << motion.position, velocity;
  data.pieces.push_back({0, motion.time, values});
  std::vector<Finding> findings;
  find_late_channels("run.csv", data, findings);
  return findings;
}

TEST(MotionPairs, FaultsOfAVelocityAreNamedAndASoundOneIsNot) {
  const Motion sound = motion(4000, 0.0, 3), late = motion(4000, 0.005, 4);
  EXPECT_TRUE(findings_of(sound, sound.velocity).empty());
  const auto found = findings_of(late, late.velocity);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].check, "late channel");
  EXPECT_NE(found[0].message.find("v is late by 5"), std::string::npos) << found[0].message;
  EXPECT_NE(found[0].message.find("a delay rather than a lag"), std::string::npos);
  EXPECT_NE(found[0].mend.find("{kind: advance, of: [v], time: 0.00"), std::string::npos);
  const auto reversed = findings_of(sound, -sound.velocity);
  ASSERT_EQ(reversed.size(), 1U);
  EXPECT_EQ(reversed[0].check, "sign");
  const auto scaled = findings_of(sound, 1.1 * sound.velocity);
  ASSERT_EQ(scaled.size(), 1U);
  EXPECT_EQ(scaled[0].check, "gain");
  EXPECT_NE(scaled[0].mend.find("factor: 0.90"), std::string::npos) << scaled[0].mend;
  const VectorXd another =
      9.0 * (13.0 * sound.time).array().sin() + (47.0 * sound.time).array().sin();
  const auto other = findings_of(sound, another);
  ASSERT_EQ(other.size(), 1U);
  EXPECT_EQ(other[0].check, "rate");
}

// Joints that move in step are no encoders of one axis.
TEST(MotionPairs, JointsThatMoveInStepAreNotCompared) {
  Motion joints = motion(4000, 0.0, 6);
  Signals data;
  data.sample_time = 0.001;
  data.signals = {{"q_1", "rad", ChannelRole::kOutput}, {"q_2", "rad", ChannelRole::kOutput}};
  Eigen::MatrixXd values(4000, 2);
  values << joints.position, -0.6 * joints.position;
  data.pieces.push_back({0, joints.time, values});
  std::vector<Finding> findings;
  find_late_channels("run.csv", data, findings);
  EXPECT_TRUE(findings.empty());
}

const testing::RecordedChannel* recorded(const std::string& file, const std::string& column) {
  const auto& channels = testing::recorded_channels();
  const auto found = std::ranges::find_if(channels, [&](const testing::RecordedChannel& channel) {
    return channel.file == file && channel.column == column;
  });
  return found == channels.end() ? nullptr : &*found;
}

// The encoders behind the gears of KR300 are 3 ms later than those of the motors.
TEST(MotionPairs, SkewOfRealEncodersIsMeasured) {
  if (testing::recorded_channels().empty()) GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set";
  for (const char* file : {"rec_A.mat", "rec_B.mat", "rec_C.mat"}) {
    for (const char* axis : {"1", "2", "3"}) {
      const auto* motor = recorded(file, std::string("rec.act_pos_mot_deg[") + axis + "]");
      const auto* arm = recorded(file, std::string("rec.act_pos_se_deg[") + axis + "]");
      ASSERT_TRUE(motor != nullptr && arm != nullptr);
      const LateFit fit = compare_late(motor->values, arm->values, 0.004).best();
      EXPECT_NEAR(fit.late, 0.003, 0.0002) << file << " " << axis;
      EXPECT_LT(fit.late_error, 0.0002);
    }
  }
}

// A swing of 9 Hz with little else: late by 20 ms, not by that and a period.
TEST(LateSignals, ASwingIsLateByLessThanHalfItsPeriod) {
  constexpr Index kCount = 1200;
  constexpr double kRate = 9.2, kDelay = 0.02, kSampling = 0.005;
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0.0, 0.3);
  VectorXd rate(kCount), velocity(kCount);
  const auto swing = [&](double t) {
    // The amplitude wanders, so that a period more fits now and then as well.
    return (1.0 + 0.3 * std::sin(0.9 * t)) * std::sin(2.0 * std::numbers::pi * kRate * t);
  };
  for (Index k = 0; k < kCount; ++k) {
    const double t = kSampling * static_cast<double>(k);
    rate(k) = swing(t) + noise(random);
    velocity(k) = swing(t - kDelay);
  }
  const LateComparison fit = compare_late(rate, velocity, kSampling);
  EXPECT_NEAR(fit.delayed.late, kDelay, 0.004);
  // All periods of a pure swing are alike.
  for (Index k = 0; k < kCount; ++k) {
    const double t = kSampling * static_cast<double>(k);
    rate(k) = std::sin(2.0 * std::numbers::pi * 20.0 * t);
    velocity(k) = std::sin(2.0 * std::numbers::pi * 20.0 * (t - 0.01));
  }
  EXPECT_NEAR(compare_late(rate, velocity, kSampling).delayed.late, 0.01, 0.001);
}

TEST(WrongStamps, SingleOnesAreMendedAndNothingElse) {
  const auto times_of = [](double step) {
    return VectorXd(VectorXd::LinSpaced(500, 0.0, 499.0 * step));
  };
  VectorXd times = times_of(0.01);
  const VectorXd truth = times;
  EXPECT_TRUE(mend_stamps(times).empty());
  times(200) -= 1.0;
  times(201) -= 1.0;
  times(300) += 60.0;
  const std::vector<WrongStamp> wrong = mend_stamps(times);
  ASSERT_EQ(wrong.size(), 3U);
  EXPECT_EQ(wrong[1].sample, 201);
  EXPECT_LT((times - truth).cwiseAbs().maxCoeff(), 1e-9);
  // By no whole unit: between its neighbours.
  times(100) = 0.3717;
  ASSERT_EQ(mend_stamps(times).size(), 1U);
  EXPECT_NEAR(times(100), truth(100), 1e-9);
  // A clock that begins anew, rows in another order, a pause.
  VectorXd anew = truth;
  anew.tail(200).array() -= anew(300);
  EXPECT_TRUE(mend_stamps(anew).empty());
  VectorXd swapped = truth;
  std::swap(swapped(50), swapped(51));
  EXPECT_TRUE(mend_stamps(swapped).empty());
  VectorXd pause = truth;
  pause.tail(200).array() += 7.0;
  EXPECT_TRUE(mend_stamps(pause).empty());
}

}  // namespace
}  // namespace graybox
