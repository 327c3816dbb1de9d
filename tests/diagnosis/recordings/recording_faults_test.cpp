// Faults that data show by themselves: each detector on signals made here, and on all channels of
// the real recordings (GRAYBOX_RECORDINGS): as they are for false alarms, with a fault put in at
// random for hits. The rates in docs/how_to/faulty_data.md are those of the calibration below.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/data_faults.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/recordings/fault_mending.hpp"
#include "diagnosis/recordings/sample_interpolation.hpp"
#include "diagnosis/recordings/signal_checks.hpp"
#include "diagnosis/signal_faults/arrival_times.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/held_values.hpp"
#include "diagnosis/signal_faults/lost_samples.hpp"
#include "diagnosis/signal_faults/lost_sign.hpp"
#include "diagnosis/signal_faults/quantisation.hpp"
#include "diagnosis/signal_faults/recording_copies.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "diagnosis/signal_faults/speed_impact.hpp"
#include "diagnosis/signal_faults/spike.hpp"
#include "diagnosis/signal_faults/stuck_sensor.hpp"
#include "tests/support/recorded_channels.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using testing::RecordedChannel;

constexpr double kSampleTime = 0.001;

// A smooth motion with some noise.
VectorXd motion(Index count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1e-3);
  VectorXd values(count);
  for (Index k = 0; k < count; ++k) {
    const double t = kSampleTime * static_cast<double>(k);
    values(k) = std::sin(5.0 * t) + 0.3 * std::sin(23.0 * t + 1.0) + noise(random);
  }
  return values;
}

VectorXd times(Index count) {
  return VectorXd::LinSpaced(count, 0.0, kSampleTime * static_cast<double>(count - 1));
}

double deviation_of(const VectorXd& values) {
  return std::sqrt((values.array() - values.mean()).square().mean());
}

// ---- each by itself -----------------------------------------------------------------------------

TEST(SampleStatistics, MediansAndQuantilesAreThoseOfTheSortedValues) {
  const std::vector<double> numbers = {3, 1, 2, 9, 5, 4, 8};
  const Eigen::Map<const VectorXd> values(numbers.data(), 7);
  EXPECT_EQ(quantile(values, 0.5), 4.0);
  EXPECT_EQ(quantile(values, 1.0), 9.0);
  const VectorXd medians = running_median(values);
  EXPECT_EQ(medians(2), 3.0);
  EXPECT_EQ(medians(0), medians(2));
  EXPECT_EQ(medians(4), 5.0);
}

TEST(Spikes, AreFoundWhereTheyAreAndNowhereElse) {
  VectorXd values = motion(4000, 1);
  EXPECT_TRUE(find_spikes(values).empty());
  values(1234) += 0.2;
  values(2500) -= 5.0;
  const std::vector<Spike> spikes = find_spikes(values);
  ASSERT_EQ(spikes.size(), 2U);
  EXPECT_EQ(spikes[0].sample, 1234);
  EXPECT_EQ(spikes[1].sample, 2500);
  EXPECT_GT(spikes[1].strength, 10.0 * spikes[0].strength);
}

// The steps of a fast sine are larger than a small spike, which its cubic tells all the same.
TEST(Spikes, StandOutOfAFastSine) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 1e-3);
  VectorXd values(2000);
  for (Index k = 0; k < values.size(); ++k) {
    values(k) =
        std::sin(2.0 * std::numbers::pi * 18.0 * 1e-3 * static_cast<double>(k)) + noise(random);
  }
  EXPECT_TRUE(find_spikes(values).empty());
  values(777) += 0.3;
  const std::vector<Spike> spikes = find_spikes(values);
  ASSERT_EQ(spikes.size(), 1U);
  EXPECT_EQ(spikes[0].sample, 777);
  // A jump is no spike, nor is a stroke that begins abruptly.
  values(777) -= 0.3;
  values.tail(1000).array() += 0.3;
  EXPECT_TRUE(find_spikes(values).empty());
  values.tail(400).setLinSpaced(values(1600), values(1600) + 20.0);
  EXPECT_TRUE(find_spikes(values).empty());
}

// A controller that is switched on may kick.
TEST(Spikes, AreNotAskedInTheFirstSamples) {
  for (const auto& [row, count] : {std::pair<Index, std::size_t>{0, 0}, {2, 0}, {3, 1}}) {
    VectorXd values = motion(4000, 1);
    values(row) += 5.0;
    EXPECT_EQ(find_spikes(values).size(), count) << row;
  }
}

// A bouncing arm: the speed turns round at its stop, and what is slow is none.
TEST(SpeedImpacts, AreTurnsBetweenTwoSamples) {
  VectorXd velocity(600), slow(600);
  double q = 0.0, v = 0.0;
  for (Index k = 0; k < 600; ++k) {
    velocity(k) = v;
    v -= 0.05;
    q += 0.01 * v;
    if (q < -2.0) v = -0.6 * v;
    slow(k) = std::sin(0.05 * static_cast<double>(k));
  }
  const auto impacts = find_speed_impacts(velocity);
  ASSERT_TRUE(impacts);
  EXPECT_GE(impacts->count, 2U);
  EXPECT_LT(velocity(impacts->first - 1), 0.0);
  EXPECT_GT(velocity(impacts->first), 0.0);
  EXPECT_FALSE(find_speed_impacts(slow));
  VectorXd spiky = motion(600, 3);
  spiky(300) = -5.0 * spiky(299);
  EXPECT_FALSE(find_speed_impacts(spiky));
}

TEST(StuckSensors, HoldInFullMotion) {
  VectorXd values = motion(4000, 2);
  EXPECT_FALSE(find_stuck_run(values, 50));
  values.segment(1500, 200).setConstant(values(1499));
  const auto run = find_stuck_run(values, 50);
  ASSERT_TRUE(run);
  EXPECT_EQ(run->first, 1499);
  EXPECT_EQ(run->last, 1699);
  EXPECT_FALSE(find_stuck_run(values, 300));
}

// A speed that trembles, and then does not, stands for no motor.
TEST(StuckSensors, HoldInNoise) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> noise(0.0, 3.0);
  VectorXd values(1000);
  for (double& value : values) value = 200.0 + noise(random);
  EXPECT_FALSE(find_stuck_run(values, 30));
  values.segment(400, 60).setConstant(values(400));
  const auto run = find_stuck_run(values, 30);
  ASSERT_TRUE(run);
  EXPECT_EQ(run->first, 400);
  EXPECT_EQ(run->last, 459);
  values.array() -= 200.0;
  EXPECT_TRUE(find_stuck_run(values, 30));
  values.segment(400, 60).setZero();
  EXPECT_FALSE(find_stuck_run(values, 30)) << "at rest";
}

// A drive that slows down, stands and starts again stands for good.
TEST(StuckSensors, AreNotAxesThatStand) {
  VectorXd values(4000);
  for (Index k = 0; k < 4000; ++k) {
    const double t = std::clamp(static_cast<double>(k), 0.0, 4000.0) / 4000.0;
    const double phase = 6.0 * std::numbers::pi * t;
    values(k) = std::round(1e4 * (phase - std::sin(phase)));  // rests at whole turns
  }
  EXPECT_FALSE(find_stuck_run(values, 50));
}

// A sensor with two poles comes round twice in a turn; one jump tells it.
TEST(CounterWraps, OfHalfATurnAreTold) {
  VectorXd degrees = VectorXd::LinSpaced(400, -60.0, 70.0);
  for (Index k = 0; k < 400; ++k) degrees(k) += 3.0 * std::sin(0.05 * static_cast<double>(k));
  for (double& value : degrees) value -= 180.0 * std::floor(value / 180.0);
  const auto wrap = find_wrap(degrees, 360.0);
  ASSERT_TRUE(wrap);
  EXPECT_EQ(wrap->period, 180.0);
  EXPECT_FALSE(find_wrap(degrees, 0.0));
  // A step of another size is no wrap.
  for (double& value : degrees) value *= value > 90.0 ? 0.7 : 1.0;
  EXPECT_FALSE(find_wrap(degrees, 360.0));
}

TEST(CounterWraps, OfCountersAndOfAnglesAreTold) {
  const VectorXd turns = 3.0 * motion(4000, 3).array() * 8192.0;
  VectorXd counts = turns.array().round();
  EXPECT_FALSE(find_wrap(counts, 0.0));
  for (double& value : counts) value -= 65536.0 * std::floor(value / 65536.0);
  const auto wrap = find_wrap(counts, 0.0);
  ASSERT_TRUE(wrap);
  EXPECT_EQ(wrap->period, 65536.0);
  const VectorXd mended = unwrapped(counts, 65536.0);
  EXPECT_LT(((mended - turns).array() - (mended - turns).mean()).abs().maxCoeff(), 1.0);
  VectorXd degrees = turns / 8192.0 * 360.0;
  for (double& value : degrees) value -= 360.0 * std::floor(value / 360.0);
  EXPECT_FALSE(find_wrap(degrees, 0.0));
  const auto turn = find_wrap(degrees, 360.0);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->period, 360.0);
}

// Steps of a command are large, and whole numbers, too.
TEST(CounterWraps, AreNotSteps) {
  VectorXd command(2000);
  for (Index k = 0; k < 2000; ++k) command(k) = (k / 100) % 2 == 0 ? 20.0 : 220.0 + double(k % 7);
  EXPECT_FALSE(find_wrap(command, 0.0));
}

// A drive that reverses once or twice, in a short log, kept as a number without sign.
TEST(CounterWraps, OfSignedNumbersReadAsUnsignedAreTold) {
  for (const double period : {256.0, 65536.0, 4294967296.0}) {
    VectorXd drive(60);
    for (Index k = 0; k < 60; ++k) {
      drive(k) = std::round(25.0 * std::cos(0.06 * static_cast<double>(k)));
    }
    EXPECT_FALSE(find_wrap(drive, 0.0));
    VectorXd recorded = drive;
    for (double& value : recorded) value += value < 0.0 ? period : 0.0;
    const auto wrap = find_wrap(recorded, 0.0);
    ASSERT_TRUE(wrap) << period;
    EXPECT_EQ(wrap->period, period);
    EXPECT_TRUE(wrap->is_signed);
    EXPECT_TRUE(unwrapped(recorded, period).isApprox(drive));
  }
}

// Switches rest at both ends, and jump between them; marks of missing data are one number.
TEST(CounterWraps, AreNotSwitchesOrMarks) {
  VectorXd on_and_off(200), noisy(200), marked(200);
  for (Index k = 0; k < 200; ++k) {
    const bool is_on = (k / 25) % 2 == 1;
    on_and_off(k) = is_on ? 65535.0 : 0.0;
    noisy(k) = (is_on ? 64000.0 : 900.0) + static_cast<double>(k % 5);
    marked(k) = k % 50 == 49 ? 65535.0 : 500.0 + static_cast<double>(k % 5);
  }
  EXPECT_FALSE(find_wrap(on_and_off, 0.0));
  EXPECT_FALSE(find_wrap(noisy, 0.0));
  EXPECT_FALSE(find_wrap(marked, 0.0));
}

TEST(LostSamples, AreNoOldValuesInTheFirstRows) {
  VectorXd values = motion(400, 4);
  EXPECT_FALSE(find_stale_start(values));
  values(0) += 1.0;
  ASSERT_TRUE(find_stale_start(values));
  EXPECT_EQ(find_stale_start(values)->samples, 1);
  values(1) = values(0);
  EXPECT_EQ(find_stale_start(values)->samples, 2);
  values(2) = values(0);
  EXPECT_FALSE(find_stale_start(values)) << "three rows are a part of the recording";
  // A step that decays within a row is the fastest motion that rows can show.
  VectorXd response(400);
  for (Index k = 0; k < 400; ++k) response(k) = std::exp(-1.0 * static_cast<double>(k));
  EXPECT_FALSE(find_stale_start(response));
}

// 0, 342, 630, 654 rpm, read twice a second: the one row that shows how fast it sets off.
TEST(LostSamples, AreNotASpeedThatSetsOff) {
  VectorXd speed(100);
  for (Index k = 0; k < 100; ++k) speed(k) = 654.0 - 0.5 * static_cast<double>(k % 50);
  speed(0) = 342.0;
  auto start = find_stale_start(speed);
  ASSERT_TRUE(start);
  EXPECT_TRUE(may_have_set_off(speed, *start));
  for (const double old : {1200.0, -300.0}) {
    speed(0) = old;
    start = find_stale_start(speed);
    ASSERT_TRUE(start);
    EXPECT_FALSE(may_have_set_off(speed, *start)) << old;
  }
}

TEST(LostSamples, LeaveAJumpInThePosition) {
  const VectorXd whole = motion(4000, 4);
  EXPECT_FALSE(find_lost_samples(times(4000), whole));
  VectorXd cut(3800);
  cut << whole.head(2000), whole.tail(1800);
  const auto lost = find_lost_samples(times(3800), cut);
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->after, std::vector<Index>{2000});
  // With the times cut, too, nothing is hidden: the rate goes on.
  VectorXd cut_times(3800);
  cut_times << times(4000).head(2000), times(4000).tail(1800);
  EXPECT_FALSE(find_lost_samples(cut_times, cut));
  VectorXd spiked = whole;
  spiked(1000) += 1.0;
  EXPECT_FALSE(find_lost_samples(times(4000), spiked));
}

TEST(Spikes, DoNotHideOneAnother) {
  VectorXd values = motion(4000, 9);
  std::mt19937_64 random(9);
  std::vector<Index> rows;
  for (Index k = 50; k < 3950; k += 90) rows.push_back(k + static_cast<Index>(random() % 20));
  for (const Index row : rows) values(row) += 0.8;
  const std::vector<Spike> spikes = find_spikes(values);
  ASSERT_EQ(spikes.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(spikes[i].sample, rows[i]);
}

// The same motion sampled evenly with times that jitter, and sampled when the times say.
TEST(ArrivalTimes, AreToldFromTimesOfSampling) {
  constexpr Index kCount = 4000;
  std::mt19937_64 random(10);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  VectorXd stamps = times(kCount), even(kCount), sampled(kCount);
  for (Index k = 0; k < kCount; ++k) {
    const double t = stamps(k);
    stamps(k) += kSampleTime * jitter(random);
    even(k) = std::sin(5.0 * t) + 0.3 * std::sin(23.0 * t);
    sampled(k) = std::sin(5.0 * stamps(k)) + 0.3 * std::sin(23.0 * stamps(k));
  }
  const auto arrival = find_arrival_times(stamps, even);
  ASSERT_TRUE(arrival);
  EXPECT_NEAR(arrival->step, kSampleTime, 1e-3 * kSampleTime);
  EXPECT_GT(arrival->strength, 10.0);
  EXPECT_FALSE(find_arrival_times(stamps, sampled));
  EXPECT_FALSE(find_arrival_times(times(kCount), even));
  // An encoder so coarse that its rounding hides the jitter says nothing.
  EXPECT_FALSE(find_arrival_times(stamps, (even * 20.0).array().round().matrix() / 20.0));
}

TEST(FaultMending, ReplacesSpikesAndCutsOutWhatIsNoData) {
  const VectorXd clean = motion(2000, 11);
  Signals data;
  data.signals.push_back({"x", "rad", ChannelRole::kOutput});
  data.pieces.push_back({.first_sample = 100, .time = times(2000), .values = clean});
  DataFaults faults;
  FaultySamples& x = faults.channels.emplace_back();
  x.spikes = {300, 301, 600, 601, 602, 603, 604};
  x.held = {1000, 1099};
  x.jumps = {1500};
  for (const Index k : x.spikes) data.pieces[0].values(k, 0) = 90.0;
  mend_faulty_samples({faults}, data);
  ASSERT_EQ(data.pieces.size(), 4U);
  const std::vector<std::pair<std::size_t, Index>> left{
      {100, 600}, {705, 395}, {1200, 400}, {1600, 500}};
  for (std::size_t p = 0; p < 4; ++p) {
    EXPECT_EQ(data.pieces[p].first_sample, left[p].first);
    ASSERT_EQ(data.pieces[p].values.rows(), left[p].second);
    const auto first = static_cast<Index>(left[p].first) - 100;
    EXPECT_LT(
        (data.pieces[p].values.col(0) - clean.segment(first, left[p].second)).cwiseAbs().maxCoeff(),
        0.02);
  }
  ASSERT_EQ(data.remarks.size(), 2U);
  EXPECT_NE(data.remarks[0].find("x: 2 spikes were replaced"), std::string::npos)
      << data.remarks[0];
  EXPECT_NE(data.remarks[1].find("105 of 2000 samples can't be data"), std::string::npos)
      << data.remarks[1];
}

// A range holds for all of the file: it must not cut what the other part of it does.
TEST(DataFaults, NoRangeIsProposedThatCutsGoodSamples) {
  VectorXd values = motion(2000, 17);
  const double lowest = values.minCoeff();
  values(700) = lowest - 90.0;
  Channel channel;
  channel.name = "torque";
  channel.role = ChannelRole::kOutput;
  const auto mend = [&](std::optional<std::pair<double, double>> elsewhere) {
    ChannelSamples samples{"run.csv", &channel, values, times(2000), 0};
    samples.elsewhere = elsewhere;
    std::vector<Finding> findings;
    const DataFaults faults = find_data_faults({samples}, findings);
    EXPECT_EQ(faults.channels[0].spikes.size(), 1U) << "it is bridged all the same";
    for (const Finding& finding : findings) {
      if (finding.check == "spike") return finding.mend;
    }
    return std::string("no spike");
  };
  EXPECT_NE(mend({}).find("range: ["), std::string::npos);
  const std::string wide = mend(std::pair{lowest - 100.0, 0.0});
  EXPECT_EQ(wide.find("range: ["), std::string::npos) << wide;
  EXPECT_NE(wide.find("it is bridged"), std::string::npos) << wide;
  // Good samples elsewhere widen a range that can be.
  const std::string widened = mend(std::pair{lowest - 5.0, 0.0});
  const std::size_t at = widened.find("range: [");
  ASSERT_NE(at, std::string::npos) << widened;
  EXPECT_LT(std::stod(widened.substr(at + 8)), lowest - 5.0);
}

// The same from files: the spike stands in the first part, the second reaches as far.
TEST(DataFaults, TheRangeOfTheWholeFileCounts) {
  const testing::TemporaryFolder folder;
  VectorXd values = motion(2000, 18).array() + 20.0;
  for (Index k = 1000; k < 2000; ++k) values(k) -= 40.0;
  values(500) = -15.0;
  std::string text = "time [s],torque [N m]\n";
  for (Index k = 0; k < 2000; ++k)
    text += fmt::format("{:.6g},{:.9g}\n", times(2000)(k), values(k));
  testing::write_text(folder.file("run.csv"), text);
  for (const bool is_cut : {true, false}) {
    testing::write_text(folder.file("campaign.yaml"),
                        fmt::format("format: graybox-campaign/1\nsample_time: {:g}\nchannels:\n"
                                    "  - {{name: torque, unit: N m, is: output}}\nexperiments:\n"
                                    "  - {{file: run.csv, segments: [[0, {}]]}}\n",
                                    kSampleTime, is_cut ? 900 : 999));
    const Campaign campaign = read_campaign(folder.file("campaign.yaml"));
    bool found = false;
    for (const Finding& finding : load_experiment(campaign, 0).findings) {
      if (finding.check != "spike") continue;
      found = true;
      EXPECT_EQ(finding.mend.find("range: ["), std::string::npos) << finding.mend;
    }
    EXPECT_TRUE(found);
  }
}

// A controller's derivative kicks its drive at every step of the command.
TEST(DataFaults, KicksOfADriveAreNoFaults) {
  for (const int count : {2, 10}) {
    VectorXd values = motion(2000, 13);
    for (int k = 0; k < count; ++k) values(300 + 150 * k) += 90.0;
    for (const ChannelRole role : {ChannelRole::kInput, ChannelRole::kOutput}) {
      Channel channel;
      channel.name = "torque";
      channel.role = role;
      std::vector<Finding> findings;
      const DataFaults faults =
          find_data_faults({{"run.csv", &channel, values, times(2000), 0}}, findings);
      EXPECT_FALSE(findings.empty());
      const bool are_kicks = role == ChannelRole::kInput && count > 3;
      EXPECT_EQ(faults.channels[0].spikes.size(), are_kicks ? 0U : static_cast<std::size_t>(count));
    }
  }
}

TEST(FaultMending, LeavesPeriodsWholeAndNeverMostOfARecordingOut) {
  Signals data;
  data.signals.push_back({"x", "rad", ChannelRole::kOutput});
  data.pieces.push_back({.first_sample = 0, .time = times(2000), .values = motion(2000, 12)});
  DataFaults faults;
  faults.channels.emplace_back().held = {500, 1500};
  mend_faulty_samples({faults}, data);
  EXPECT_EQ(data.pieces.size(), 1U);
  faults.channels[0].held = {500, 600};
  data.excitation = PeriodicExcitation{1000, 2, {1}};
  mend_faulty_samples({faults}, data);
  EXPECT_EQ(data.pieces.size(), 1U);
  EXPECT_TRUE(data.remarks.empty());
}

TEST(Quantisation, IsCoarseBesideTheSignalItMeasures) {
  const VectorXd values = motion(4000, 5);
  const double deviation = deviation_of(values);
  const auto rounded = [&](double step) {
    return VectorXd((values / step).array().round().matrix() * step);
  };
  EXPECT_FALSE(find_coarse_quantisation(values));
  EXPECT_FALSE(find_coarse_quantisation(rounded(0.01 * deviation)));
  const auto coarse = find_coarse_quantisation(rounded(0.2 * deviation));
  ASSERT_TRUE(coarse);
  EXPECT_NEAR(coarse->step, 0.2 * deviation, 1e-12);
  EXPECT_NEAR(coarse->error, 0.2 / std::sqrt(12.0), 0.005);
}

// A position in nine levels was measured in coarse steps; other signals with as few levels switch.
// One that flickers between three levels hardly moves.
TEST(Quantisation, OfAMotionIsTakenByFewLevels) {
  VectorXd position(800);
  for (Index k = 0; k < position.size(); ++k) {
    const double t = 0.01 * static_cast<double>(k);
    position(k) = 20.0 * std::round(4.0 - 4.0 * std::cos(1.7 * t));
  }
  EXPECT_FALSE(find_coarse_quantisation(position));
  const auto coarse = find_coarse_quantisation(position, SignalKind::kMeasuredMotion);
  ASSERT_TRUE(coarse);
  EXPECT_DOUBLE_EQ(coarse->step, 20.0);
  EXPECT_GT(coarse->error, 0.08);
  const VectorXd flicker = (position.array() / 80.0).round().matrix();
  EXPECT_FALSE(find_coarse_quantisation(flicker, SignalKind::kMeasuredMotion));
}

// ---- held values, lost signs --------------------------------------------------------------------

VectorXd held(const VectorXd& values, Index count, Index first) {
  VectorXd result = values;
  for (Index k = 0; k < values.size(); ++k) {
    result(k) = values(std::max<Index>(0, k - (k - first + count * 1000) % count));
  }
  return result;
}

TEST(HeldValues, AreToldWithTheirRate) {
  for (const Index count : {2, 5, 13}) {
    const auto found = find_held_values(held(motion(3000, 4), count, 3));
    ASSERT_TRUE(found) << count;
    EXPECT_EQ(found->samples, count);
    EXPECT_EQ(found->first % count, 3 % count);
    EXPECT_EQ(found->step, 0.0);
  }
  const VectorXd coarse = (motion(3000, 4) * 40.0).array().round().matrix() / 40.0;
  const auto steps = find_held_values(held(coarse, 5, 0));
  ASSERT_TRUE(steps);
  EXPECT_NEAR(steps->step, 0.025, 1e-9);
}

// A coarse sensor on a slow ramp changes every few samples, too: by one step of it.
TEST(HeldValues, AreNotSlowRampsOrWholeSignals) {
  EXPECT_FALSE(find_held_values(motion(3000, 4)));
  VectorXd ramp(3000);
  for (Index k = 0; k < 3000; ++k) ramp(k) = std::floor(static_cast<double>(k) / 5.0);
  EXPECT_FALSE(find_held_values(ramp));
}

TEST(LostSigns, AreToldFromWeights) {
  const VectorXd rate = motion(3000, 6);
  VectorXd drive = rate.array() * 2.0 + 0.1 * motion(3000, 7).array();
  EXPECT_FALSE(find_lost_sign(drive, rate));
  EXPECT_TRUE(find_lost_sign(drive.cwiseAbs(), rate));
  EXPECT_TRUE(find_lost_sign(-drive.cwiseAbs(), rate)->is_negative);
  const VectorXd weight = drive.array() - drive.minCoeff();  // down to zero, and of one sign
  EXPECT_FALSE(find_lost_sign(weight, rate));
  EXPECT_FALSE(find_lost_sign(drive.cwiseAbs(), rate.cwiseAbs()));  // one way
}

TEST(DataFaults, SayThatAValueIsHeldAndASignLost) {
  const auto channel = [](const char* name, ChannelRole role, const char* unit) {
    return Channel{.name = name,
                   .role = role,
                   .recorded_unit = unit,
                   .unit = unit,
                   .column = name,
                   .file = {},
                   .range = {}};
  };
  const Channel drive = channel("torque", ChannelRole::kInput, "N m"),
                speed = channel("speed", ChannelRole::kOutput, "rad/s");
  const VectorXd rate = motion(3000, 6);
  const auto checks = [&](const VectorXd& force, const VectorXd& measured) {
    std::vector<Finding> findings;
    find_data_faults({{"run.csv", &drive, force, times(3000), 0},
                      {"run.csv", &speed, measured, times(3000), 0, false}},
                     findings);
    std::string names;
    for (const Finding& finding : findings) names += finding.check + ": " + finding.mend + "\n";
    return names;
  };
  EXPECT_EQ(checks(rate, rate), "");
  EXPECT_NE(checks(rate, held(rate, 5, 2)).find("held values: every: {samples: 5, from: 2}"),
            std::string::npos)
      << checks(rate, held(rate, 5, 2));
  EXPECT_EQ(checks(held(rate, 5, 2), rate).find("held"), std::string::npos);  // by its controller
  EXPECT_NE(checks(rate.cwiseAbs(), rate).find("lost sign"), std::string::npos);
}

TEST(RecordingCopies, AreFoundShiftedAndCutButRepetitionsAreNot) {
  const VectorXd first = motion(6000, 6), repeated = motion(6000, 7);
  EXPECT_FALSE(SampleFingerprint(first).shared_with(SampleFingerprint(repeated)));
  const auto copy =
      SampleFingerprint(first.segment(1500, 2000)).shared_with(SampleFingerprint(first));
  ASSERT_TRUE(copy);
  EXPECT_EQ(copy->first + 1500, copy->first_there);
  EXPECT_FALSE(
      SampleFingerprint(VectorXd::Zero(5000)).shared_with(SampleFingerprint(VectorXd::Zero(5000))));
}

TEST(DataFaults, SayWhereHowSureWhatElseAndWhatMendsThem) {
  const Channel speed{.name = "speed",
                      .role = ChannelRole::kOutput,
                      .recorded_unit = "rad/s",
                      .unit = "rad/s",
                      .column = "speed",
                      .file = {},
                      .range = {}};
  VectorXd values = motion(2000, 8);
  values(700) = 50.0;
  std::vector<Finding> findings;
  find_data_faults({{"run.csv", &speed, values, times(2000), 100}}, findings);
  ASSERT_EQ(findings.size(), 1U);
  const Finding& finding = findings.front();
  EXPECT_EQ(finding.check, "spike");
  EXPECT_EQ(finding.channel, "speed");
  EXPECT_NEAR(*finding.time, 0.7, 1e-9);
  EXPECT_GT(finding.strength, 1.0);
  EXPECT_NE(finding.message.find("run.csv: speed: row 801 (0.7 s)"), std::string::npos)
      << finding.message;
  EXPECT_NE(finding.message.find("could also be"), std::string::npos);
  EXPECT_NE(finding.mend.find("{kind: valid, of: [speed], range: [-1."), std::string::npos)
      << finding.mend;
}

// ---- all channels of the real recordings --------------------------------------------------------

class RecordingFaultRates : public ::testing::Test {
 protected:
  void SetUp() override {
    if (testing::recorded_channels().empty()) {
      GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: the rates are not measured";
    }
  }

  using Detector = std::function<bool(const RecordedChannel&, const VectorXd&)>;
  using Fault = std::function<VectorXd(const RecordedChannel&)>;
  using Selection = std::function<bool(const RecordedChannel&)>;

  static bool everything(const RecordedChannel&) { return true; }
  static bool is_position(const RecordedChannel& channel) { return channel.is_position; }
  // The drive's wanted currents and torques of UR10e.
  static bool is_no_command(const RecordedChannel& channel) {
    return channel.set != "UR10e" || std::stoi(channel.column) < 20;
  }

  // Share of channels where the detector speaks.
  static double rate(const Detector& detects, const Fault& fault,
                     const Selection& counts = everything) {
    std::size_t count = 0, found = 0;
    for (const RecordedChannel& channel : testing::recorded_channels()) {
      if (!counts(channel)) continue;
      ++count;
      if (!detects(channel, fault(channel))) continue;
      if (++found <= 3) std::printf("  %s %s\n", channel.file.c_str(), channel.column.c_str());
    }
    const double share = static_cast<double>(found) / static_cast<double>(count);
    std::printf("  %zu of %zu channels\n", found, count);
    return share;
  }
  static VectorXd as_it_is(const RecordedChannel& channel) { return channel.values; }

  Index somewhere(Index size, Index margin) {
    return std::uniform_int_distribution<Index>(margin, size - 1 - margin)(random_);
  }
  static Index samples_in(const RecordedChannel& channel, double seconds) {
    return static_cast<Index>(std::ceil(seconds / channel.sample_time));
  }

  std::mt19937_64 random_{20};
};

TEST_F(RecordingFaultRates, Spikes) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return !find_spikes(values).empty();
  };
  const auto spiked = [&](double size) {
    return [this, size](const RecordedChannel& channel) {
      VectorXd values = channel.values;
      values(somewhere(values.size(), 20)) += size * deviation_of(values);
      return values;
    };
  };
  const Fault often_spiked = [this](const RecordedChannel& channel) {
    VectorXd values = channel.values;
    for (int spike = 0; spike < 20; ++spike) {
      values(somewhere(values.size(), 20)) += 10.0 * deviation_of(values);
    }
    return values;
  };
  EXPECT_EQ(rate(detects, as_it_is), 0.0);
  EXPECT_GT(rate(detects, spiked(10.0)), 0.9);
  EXPECT_GT(rate(detects, often_spiked), 0.9);
  EXPECT_GT(rate(detects, spiked(1.0)), 0.6);
}

// Positions at times that jitter: sampled evenly, and sampled when the times say.
TEST_F(RecordingFaultRates, ArrivalTimes) {
  std::size_t count = 0, alarms = 0, hits = 0;
  for (const RecordedChannel& channel : testing::recorded_channels()) {
    if (!channel.is_position) continue;
    const Index last = channel.values.size() - 1;
    const VectorXd even =
        VectorXd::LinSpaced(last + 1, 0.0, channel.sample_time * static_cast<double>(last));
    std::uniform_real_distribution<double> jitter(-0.3, 0.3);
    VectorXd stamps = even;
    for (double& stamp : stamps) stamp += channel.sample_time * jitter(random_);
    stamps = stamps.cwiseMax(0.0).cwiseMin(even(last));
    const auto inside = Eigen::seq(Index{1}, last - 1);
    ++count;
    if (find_arrival_times(stamps(inside), channel.values(inside))) ++hits;
    const VectorXd sampled = interpolated(even, channel.values, stamps(inside));
    if (find_arrival_times(stamps(inside), sampled)) ++alarms;
  }
  std::printf("  %zu false, %zu hits of %zu\n", alarms, hits, count);
  EXPECT_EQ(alarms, 0U);
  EXPECT_GT(static_cast<double>(hits), 0.3 * static_cast<double>(count));
}

// Commands that are held are no sensors.
TEST_F(RecordingFaultRates, StuckSensors) {
  const Detector detects = [](const RecordedChannel& channel, const VectorXd& values) {
    return find_stuck_run(values, samples_in(channel, 0.05)).has_value();
  };
  const auto stuck = [this](const RecordedChannel& channel) {
    VectorXd values = channel.values;
    const Index length = std::min(samples_in(channel, 0.5), values.size() / 3);
    const Index first = somewhere(values.size() - length, 20);
    values.segment(first, length).setConstant(values(first - 1));
    return values;
  };
  EXPECT_LT(rate(detects, as_it_is, is_no_command), 0.01);
  EXPECT_GT(rate(detects, stuck, is_no_command), 0.7);
}

TEST_F(RecordingFaultRates, CounterWraps) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return find_wrap(values, 0.0).has_value();
  };
  const auto wrapped = [](double period) {
    return [period](const RecordedChannel& channel) {
      VectorXd values = channel.values.array() - channel.values.mean();
      values *= 0.25 * period / values.cwiseAbs().maxCoeff();
      values = values.array().round();
      for (double& value : values) value += value < 0.0 ? period : 0.0;
      return values;
    };
  };
  EXPECT_EQ(rate(detects, as_it_is), 0.0);
  EXPECT_GT(rate(detects, wrapped(65536.0)), 0.7);
  EXPECT_GT(rate(detects, wrapped(256.0)), 0.7);
}

// Rates of the measured positions; hits: from a sample in full motion on the speed is turned.
TEST_F(RecordingFaultRates, SpeedImpacts) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return find_speed_impacts(values).has_value();
  };
  const Fault speed = [](const RecordedChannel& channel) { return central_steps(channel.values); };
  const Fault turned = [](const RecordedChannel& channel) {
    VectorXd values = central_steps(channel.values);
    const double most = values.segment(2, values.size() - 4).cwiseAbs().maxCoeff();
    for (Index k = values.size() / 4; k + 2 < values.size(); ++k) {
      if (std::abs(values(k)) < 0.7 * most) continue;
      values.tail(values.size() - k) *= -0.6;
      break;
    }
    return values;
  };
  EXPECT_EQ(rate(detects, speed, is_position), 0.0);
  EXPECT_GT(rate(detects, turned, is_position), 0.5);
}

TEST_F(RecordingFaultRates, HeldValues) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return find_held_values(values).has_value();
  };
  const Fault slower = [](const RecordedChannel& channel) { return held(channel.values, 5, 2); };
  EXPECT_EQ(rate(detects, as_it_is), 0.0);
  EXPECT_GT(rate(detects, slower), 0.9);
}

// A first row from another place is found, wherever the log begins.
TEST_F(RecordingFaultRates, StaleStart) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return find_stale_start(values).has_value();
  };
  const auto stale = [this](const RecordedChannel& channel) {
    const Index first = somewhere(channel.values.size() / 2, 20);
    VectorXd values = channel.values.tail(channel.values.size() - first);
    values(0) += 0.5 * (channel.values.maxCoeff() - channel.values.minCoeff());
    return values;
  };
  EXPECT_EQ(rate(detects, as_it_is, is_position), 0.0);
  EXPECT_GT(rate(detects, stale, is_position), 0.9);
}

TEST_F(RecordingFaultRates, LostSamples) {
  const Detector detects = [](const RecordedChannel& channel, const VectorXd& values) {
    const VectorXd time =
        channel.sample_time * VectorXd::LinSpaced(values.size(), 0.0, double(values.size() - 1));
    return find_lost_samples(time, values).has_value();
  };
  const auto cut = [this](const RecordedChannel& channel) {
    const Index size = channel.values.size(), length = samples_in(channel, 0.2);
    const Index first = somewhere(size - length, 20);
    VectorXd values(size - length);
    values << channel.values.head(first), channel.values.tail(size - length - first);
    return values;
  };
  EXPECT_EQ(rate(detects, as_it_is, is_position), 0.0);
  EXPECT_GT(rate(detects, cut, is_position), 0.6);
}

// What is found on the recordings as they are is so: efforts in steps of 0.001, a bus voltage.
TEST_F(RecordingFaultRates, Quantisation) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return find_coarse_quantisation(values).has_value();
  };
  const auto coarse = [](const RecordedChannel& channel) {
    const double step = 0.2 * deviation_of(channel.values);
    return VectorXd((channel.values / step).array().round().matrix() * step);
  };
  EXPECT_LT(rate(detects, as_it_is), 0.02);
  EXPECT_GT(rate(detects, coarse), 0.8);
  const Detector detects_motion = [](const RecordedChannel&, const VectorXd& values) {
    return find_coarse_quantisation(values, SignalKind::kMeasuredMotion).has_value();
  };
  EXPECT_LT(rate(detects_motion, as_it_is, is_position), 0.02);
}

TEST_F(RecordingFaultRates, Saturation) {
  const Detector detects = [](const RecordedChannel&, const VectorXd& values) {
    return clipped_samples(values) > 0;
  };
  const auto clipped = [](const RecordedChannel& channel) {
    const double limit = 0.7 * channel.values.cwiseAbs().maxCoeff();
    return VectorXd(channel.values.cwiseMin(limit).cwiseMax(-limit));
  };
  EXPECT_LT(rate(detects, as_it_is), 0.01);
  EXPECT_GT(rate(detects, clipped), 0.75);
}

// Two files of one set are two recordings; a third of a file, shifted, is a copy of it.
TEST_F(RecordingFaultRates, Copies) {
  const auto& channels = testing::recorded_channels();
  std::vector<SampleFingerprint> prints;
  for (const RecordedChannel& channel : channels) prints.emplace_back(channel.values);
  std::size_t pairs = 0, false_alarms = 0, copies = 0;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const Index third = channels[i].values.size() / 3;
    const SampleFingerprint part(channels[i].values.segment(third, third));
    if (part.shared_with(prints[i])) ++copies;
    for (std::size_t j = 0; j < i; ++j) {
      const bool same = channels[i].set == channels[j].set &&
                        channels[i].file != channels[j].file &&
                        channels[i].column == channels[j].column;
      const std::string& column = channels[i].column;
      const bool is_command = column.find("ref") != std::string::npos || column == "qg" ||
                              column.find("time") != std::string::npos;
      if (!same || is_command) continue;
      ++pairs;
      if (prints[i].shared_with(prints[j])) {
        ++false_alarms;
        std::printf("  %s %s %s\n", channels[i].file.c_str(), channels[j].file.c_str(),
                    channels[i].column.c_str());
      }
    }
  }
  std::printf("  %zu of %zu pairs, %zu of %zu copies\n", false_alarms, pairs, copies,
              channels.size());
  EXPECT_EQ(false_alarms, 0U);
  EXPECT_GT(copies, 9 * channels.size() / 10);
}

}  // namespace
}  // namespace graybox
