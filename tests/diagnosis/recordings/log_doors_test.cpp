// The doors of graybox for strangers' logs: separators behind rows, units on lines of their own,
// rows without a time or written again, machines that nothing drives, servos that follow a goal,
// and titles as people write them. All logs are simulated here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/recordings/signal_checks.hpp"
#include "diagnosis/runs/recording_warnings.hpp"
#include "diagnosis/signal_faults/written_bursts.hpp"
#include "tests/support/proposal_words.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// J v' = u - b v: what a drive of two tones does to a mass.
struct DoorAxis {
  VectorXd time, position, velocity, force;
};

DoorAxis door_axis(Index samples, double step) {
  constexpr double kInertia = 0.02, kDamping = 0.05;
  constexpr int kSteps = 50;
  DoorAxis result{VectorXd(samples), VectorXd(samples), VectorXd(samples), VectorXd(samples)};
  double q = 0.0, v = 0.0;
  for (Index k = 0; k < samples; ++k) {
    const double t = step * static_cast<double>(k);
    const double u = 0.6 * std::sin(2.0 * t) + 0.3 * std::sin(5.1 * t + 1.0);
    result.time(k) = t;
    result.position(k) = q;
    result.velocity(k) = v;
    result.force(k) = u;
    for (int s = 0; s < kSteps; ++s) {
      v += (u - kDamping * v) / kInertia * step / kSteps;
      q += v * step / kSteps;
    }
  }
  return result;
}

using TitledColumn = std::pair<std::string, VectorXd>;

std::string table_of(const std::vector<TitledColumn>& columns, const std::string& behind = "") {
  std::string text;
  for (const TitledColumn& column : columns) text += (text.empty() ? "" : ",") + column.first;
  text += "\n";
  for (Index k = 0; k < columns.front().second.size(); ++k) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      text += fmt::format("{}{:.9g}", c == 0 ? "" : ",", columns[c].second(k));
    }
    text += behind + "\n";
  }
  return text;
}

class LogDoors : public ::testing::Test, protected testing::ProposalWords {
 protected:
  RecordingFile read(const std::string& text) {
    testing::write_text(folder_.file("read.csv"), text);
    return read_recording_file(folder_.file("read.csv"));
  }
  ModelProposal proposed(const std::string& text, const std::vector<std::string>& answers = {},
                         ProposalRequest request = {}) {
    testing::write_text(folder_.file("log.csv"), text);
    if (request.machine == ProposedMachine::kOpen) request.machine = ProposedMachine::kOneMass;
    request.logs = {folder_.file("log.csv")};
    request.folder = folder_.file("axis");
    for (const std::string& each : answers) request.columns.push_back(column_answer(each));
    return propose_model(request);
  }
  // The first experiment of the campaign, as a diagnosis reads it.
  ExperimentRecording loaded(const ModelProposal& proposal) {
    std::filesystem::create_directories(folder_.file("axis"));
    testing::write_text(folder_.file("axis/campaign.yaml"), proposal.campaign_text);
    return load_experiment(read_campaign(folder_.file("axis/campaign.yaml")), 0);
  }

  testing::TemporaryFolder folder_;
};

// ---- tables -------------------------------------------------------------------------------------

TEST_F(LogDoors, SeparatorsBehindRowsDontMatter) {
  const std::vector<std::string> tables{
      "t,u,q\n0,1.5,2\n1,2.5,4\n",          "t,u,q\n0,1.5,2;\n1,2.5,4;\n",
      "t,u,q;\n0,1.5,2;\n1,2.5,4;\n",       "t,u,q,\n0,1.5,2,\n1,2.5,4,\n",
      "t,u,q\n0,1.5,2,\n1,2.5,4,\n",        "t,u,q\n0,1.5,2,\n1,2.5,4\n",
      "t u q\n0 1.5 2;\n1 2.5 4;\n",        "t;u;q\n0;1,5;2;\n1;2,5;4;\n",
      "t\tu\tq\n0\t1.5\t2,\n1\t2.5\t4\t\n", "# t,u,q\n0,1.5,2;\n1,2.5,4;\n"};
  for (const std::string& table : tables) {
    const RecordingFile file = read(table);
    ASSERT_EQ(file.columns.size(), 3U) << table;
    EXPECT_EQ(file.at("u").values, Eigen::Vector2d(1.5, 2.5)) << table;
    EXPECT_EQ(file.at("q").values, Eigen::Vector2d(2, 4)) << table;
  }
  // A number that is missing is still told.
  testing::expect_refused([&] { (void)read("t,u,q\n0,1.5,2\n1,2.5\n"); }, "2 fields");
  testing::expect_refused([&] { (void)read("t,u,q\n0,1.5,2\n1,2.5,4,5\n"); }, "4 fields");
}

TEST_F(LogDoors, UnitsStandOnALineOfTheirOwnOnEitherSide) {
  const std::string rows = "0,0.5,1,2\n1,0.6,2,3\n";
  for (const std::string& head :
       {std::string("%a log\n%timestep (8Hz),voltage,position,velocity\n%[#],[V],[rad],[rad/s]\n"),
        std::string("%[#],[V],[rad],[rad/s]\n%timestep (8Hz),voltage,position,velocity\n"),
        std::string(
            "# a log\n# timestep (8Hz),voltage,position,velocity\n# [#],[V],[rad],[rad/s]\n"),
        std::string("timestep (8Hz),voltage,position,velocity\n[#],[V],[rad],[rad/s]\n"),
        std::string("[#],[V],[rad],[rad/s]\ntimestep (8Hz),voltage,position,velocity\n")}) {
    const RecordingFile file = read(head + rows);
    ASSERT_EQ(file.columns.size(), 4U) << head;
    EXPECT_EQ(file.columns[0].name, "timestep (8Hz)") << head;
    EXPECT_EQ(file.columns[0].unit, "") << head;
    EXPECT_EQ(file.at("voltage").unit, "V") << head;
    EXPECT_EQ(file.at("position").unit, "rad") << head;
    EXPECT_EQ(file.at("velocity").unit, "rad/s") << head;
    EXPECT_EQ(file.at("velocity").values, Eigen::Vector2d(2, 3)) << head;
  }
  // Titles that are units alone stay titles, and a remark above titles is none.
  EXPECT_EQ(read("s,V,rad\n0,1,2\n1,2,3\n").columns[2].name, "rad");
  EXPECT_EQ(read("# one, two, three\n# t, u, q\n0,1,2\n1,2,3\n").columns[2].name, "q");
}

// ---- rows that are no samples -------------------------------------------------------------------

TEST_F(LogDoors, RowsWithoutATimeAreLeftOut) {
  const DoorAxis m = door_axis(600, 0.01);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  DoorAxis gapped = m;
  for (const Index row : {39, 300, 301}) {
    for (VectorXd* column : {&gapped.time, &gapped.position, &gapped.force}) (*column)(row) = kNone;
  }
  const ModelProposal proposal = proposed(table_of({{"time [s]", gapped.time},
                                                    {"position [rad]", gapped.position},
                                                    {"torque [N m]", gapped.force}}));
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "3 rows without a time are left out")) << all_of(proposal);
  const ExperimentRecording run = loaded(proposal);
  const Index angle = run.index_of("angle");
  double off = 0.0;
  Index count = 0;
  for (const SignalPiece& piece : run.data.pieces) {
    for (Index k = 0; k < piece.time.size(); ++k, ++count) {
      const auto row = static_cast<Index>(std::lround(piece.time(k) / 0.01));
      off = std::max(off, std::abs(piece.values(k, angle) - m.position(row)));
    }
  }
  EXPECT_GT(count, 280);
  EXPECT_LT(off, 1e-3 * m.position.cwiseAbs().maxCoeff());
}

// Seven rows each 40 ms, of one measurement: stamps of one burst are equal, or 0.1 ms apart.
TEST_F(LogDoors, RowsWrittenAgainAreOneSample) {
  constexpr int kRows = 7;
  const DoorAxis m = door_axis(400, 0.04);
  for (const double within : {0.0, 0.0001}) {
    DoorAxis burst{VectorXd(400 * kRows), VectorXd(400 * kRows), {}, VectorXd(400 * kRows)};
    for (Index k = 0; k < burst.time.size(); ++k) {
      burst.time(k) = m.time(k / kRows) + within * static_cast<double>(k % kRows);
      burst.position(k) = m.position(k / kRows);
      burst.force(k) = m.force(k / kRows);
    }
    const ModelProposal proposal = proposed(table_of({{"time [s]", burst.time},
                                                      {"position [rad]", burst.position},
                                                      {"torque [N m]", burst.force}}));
    EXPECT_TRUE(says(proposal, "400 of 2800 rows are samples")) << all_of(proposal);
    EXPECT_EQ(says(proposal, " s of 'time'"), within > 0.0) << all_of(proposal);
    EXPECT_TRUE(says(proposal, within > 0.0 ? "the others follow one within"
                                            : "the others repeat the 'time' of one"))
        << all_of(proposal);
    EXPECT_NE(proposal.campaign_text.find("burst: "), std::string::npos);
    const ExperimentRecording run = loaded(proposal);
    EXPECT_DOUBLE_EQ(run.data.sample_time.value_or(0.0), 0.04);
    const SignalPiece& piece = run.data.pieces.at(0);
    ASSERT_GT(piece.time.size(), 190);
    for (Index k = 0; k < 190; ++k) {
      EXPECT_NEAR(piece.values(k, run.index_of("angle")), m.position(k), 1e-6);
    }
  }
}

// A logger writes row 99 once more, 0.2 ms before row 100: no sample is due there.
TEST_F(LogDoors, ASampleThatWasLoggedTwiceIsLeftOut) {
  constexpr Index kRows = 600, kAgain = 100;
  const DoorAxis m = door_axis(kRows, 0.01);
  DoorAxis twice{VectorXd(kRows + 1), VectorXd(kRows + 1), {}, VectorXd(kRows + 1)};
  for (Index k = 0; k <= kRows; ++k) {
    const Index row = k < kAgain ? k : k - 1;
    twice.time(k) = k == kAgain ? m.time(kAgain) - 0.0002 : m.time(row);
    twice.position(k) = m.position(row);
    twice.force(k) = m.force(row);
  }
  EXPECT_EQ(repeated_rows(twice.time, {twice.position, twice.force}), std::vector<Index>{kAgain});
  const ModelProposal proposal = proposed(table_of({{"time [s]", twice.time},
                                                    {"position [rad]", twice.position},
                                                    {"torque [N m]", twice.force}}));
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "row 101 holds the values of a row beside it")) << all_of(proposal);
  EXPECT_FALSE(says(proposal, "jumps")) << all_of(proposal);
  const ExperimentRecording run = loaded(proposal);
  EXPECT_TRUE(std::ranges::any_of(run.findings, [](const Finding& finding) {
    return finding.message.find("a sample that was written before") != std::string::npos;
  }));
  ASSERT_EQ(run.data.pieces.size(), 1U);
  const SignalPiece& piece = run.data.pieces.front();
  ASSERT_GT(piece.time.size(), kAgain + 50);
  for (Index k = 0; k < piece.time.size(); ++k) {
    const auto row = static_cast<Index>(std::lround(piece.time(k) / 0.01));
    EXPECT_NEAR(piece.values(k, run.index_of("angle")), m.position(row), 1e-5);
  }
  // Rows that were measured anew are none, however near, and neither is what is written on time.
  twice.position(kAgain) += 1e-4;
  EXPECT_TRUE(repeated_rows(twice.time, {twice.position, twice.force}).empty());
  VectorXd held = m.position;
  held(kAgain) = held(kAgain - 1);
  EXPECT_TRUE(repeated_rows(m.time, {held}).empty());
  EXPECT_TRUE(repeated_rows(twice.time, {VectorXd::Zero(kRows + 1)}).empty());  // stands still
}

// Stamps of 10 ms for rows of 2 ms that were measured anew: no repetition. What is advised works.
TEST_F(LogDoors, CoarseStampsOfNewMeasurementsAreToldAndTheAdviceWorks) {
  const DoorAxis m = door_axis(1000, 0.002);
  VectorXd coarse = m.time;
  for (double& t : coarse) t = 3600.0 + 10.0 * std::floor(t / 0.01 + 1e-9);
  EXPECT_FALSE(find_bursts(coarse, {m.position}).has_value());
  const std::string text =
      table_of({{"time [ms]", coarse}, {"position [rad]", m.position}, {"torque [N m]", m.force}});
  testing::expect_refused([&] { (void)proposed(text); },
                          "say --column 'time=ignore' --sample-time 0.00199; they are 1.992 ms");
  ProposalRequest request;
  request.sample_time = 0.002;
  const ModelProposal proposal = proposed(text, {"time=ignore"}, request);
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_NE(proposal.campaign_text.find("time: ignore"), std::string::npos);
  const SignalPiece piece = loaded(proposal).data.pieces.at(0);
  EXPECT_NEAR(piece.time(1) - piece.time(0), 0.002, 1e-12);
}

TEST_F(LogDoors, ATimeCountsInTheUnitOfItsTitleAndInTicks) {
  const DoorAxis m = door_axis(400, 0.004);
  testing::write_text(folder_.file("log.csv"),
                      table_of({{"time [ms]", 1000.0 * m.time}, {"q", m.position}}));
  testing::write_text(folder_.file("campaign.yaml"),
                      "format: graybox-campaign/1\nsample_time: irregular\nchannels:\n"
                      "  - {name: q, unit: rad, is: output}\nexperiments: [{file: log.csv}]\n");
  const ExperimentRecording run = load_experiment(read_campaign(folder_.file("campaign.yaml")), 0);
  EXPECT_NEAR(run.data.pieces.at(0).time(1), 0.004, 1e-12);
  // 125 us each, uneven.
  VectorXd ticks = m.time / 0.000125;
  for (Index k = 0; k < ticks.size(); ++k) ticks(k) += 2.0 * static_cast<double>(k % 3);
  const std::vector<TitledColumn> columns{
      {"timestep", ticks}, {"position [rad]", m.position}, {"torque [N m]", m.force}};
  const ModelProposal asked = proposed(table_of(columns));
  EXPECT_TRUE(says(asked, "'timestep' rises by 28 to 34 a row")) << all_of(asked);
  ProposalRequest request;
  request.sample_time = 0.004;
  EXPECT_TRUE(says(proposed(table_of(columns), {}, request), "--sample-time is wrong"));
  const ModelProposal answered = proposed(table_of(columns), {"timestep=time:0.125 ms"});
  EXPECT_TRUE(answered.questions.empty()) << all_of(answered);
  EXPECT_NEAR(loaded(answered).data.sample_time.value_or(0.0), 0.004, 0.0005);
  // Even rows that count by more than one contradict nothing.
  const ModelProposal even = proposed(
      table_of(
          {{"n", m.time / 0.000125}, {"position [rad]", m.position}, {"torque [N m]", m.force}}),
      {}, request);
  EXPECT_FALSE(says(even, "--sample-time is wrong")) << all_of(even);
}

// ---- drives -------------------------------------------------------------------------------------

TEST_F(LogDoors, WithoutADriveARunDownIsProposed) {
  const VectorXd time = VectorXd::LinSpaced(500, 0.0, 4.99);
  const VectorXd speed = time.unaryExpr([](double t) { return 20.0 * std::exp(-0.4 * t) - 2.0; });
  const std::string text = table_of({{"time [s]", time}, {"speed [rad/s]", speed}});
  const ModelProposal asked = proposed(text);
  ASSERT_EQ(asked.questions.size(), 1U) << all_of(asked);
  EXPECT_TRUE(says(asked, "--no-drive")) << all_of(asked);
  EXPECT_TRUE(asked.questions.front().choices.front().no_drive);
  ProposalRequest request;
  request.no_drive = true;
  const ModelProposal proposal = proposed(text, {}, request);
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "drive: nothing")) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "it is held")) << all_of(proposal);
  const ExperimentRecording run = loaded(proposal);
  const Index torque = run.index_of("torque");
  EXPECT_EQ(run.data.signals[static_cast<std::size_t>(torque)].unit, "N m");
  EXPECT_EQ(run.data.signals[static_cast<std::size_t>(torque)].role, ChannelRole::kInput);
  EXPECT_EQ(run.data.pieces.at(0).values.col(torque).cwiseAbs().maxCoeff(), 0.0);
}

// What nothing drives does not speed up by itself.
TEST_F(LogDoors, ASpeedThatGrowsWithoutADriveIsTold) {
  const VectorXd time = VectorXd::LinSpaced(500, 0.0, 4.99);
  ProposalRequest request;
  request.no_drive = true;
  const auto told = [&](const VectorXd& speed) {
    return says(proposed(table_of({{"time [s]", time}, {"speed [rad/s]", speed}}), {}, request),
                "though nothing is said to drive");
  };
  const VectorXd decay = (-0.8 * time.array()).exp().matrix();
  EXPECT_TRUE(told(281.0 * (VectorXd::Ones(500) - decay)));
  // Within a few samples, as of a motor that is switched on; and a first zero that no one measured.
  EXPECT_TRUE(told(9.0 * (VectorXd::Ones(500) - (-80.0 * time.array()).exp().matrix())));
  VectorXd first_zero = (100.0 - 10.0 * time.array()).matrix();
  first_zero(0) = 0.0;
  EXPECT_FALSE(told(first_zero));
  EXPECT_FALSE(told(281.0 * decay));
  EXPECT_FALSE(told(-20.0 * decay));
}

// Two and a half swings of a pendulum: slow in the first tenth of the log, fast in the last one.
TEST_F(LogDoors, AFreeSwingGainsNoSpeedThatStays) {
  const VectorXd time = VectorXd::LinSpaced(500, 0.0, 4.99);
  ProposalRequest request;
  request.no_drive = true;
  for (const double way : {1.0, -1.0}) {
    const VectorXd angle = time.unaryExpr([way](double t) {
      return way * 0.2 * std::exp(-0.02 * t) * std::cos(std::numbers::pi * (t - 0.25));
    });
    const ModelProposal swing =
        proposed(table_of({{"time [s]", time}, {"angle [rad]", angle}}), {}, request);
    EXPECT_FALSE(says(swing, "though nothing is said to drive")) << all_of(swing);
  }
}

// A pendulum that hangs, is lifted by a hand from 1 to 2 s, and swings out from there.
TEST_F(LogDoors, ALiftByHandIsToldWithItsSeconds) {
  constexpr Index kRows = 800, kLifted = 200;
  constexpr double kStep = 0.01;
  VectorXd angle(kRows);
  for (Index k = 0; k < kRows; ++k) {
    const double t = kStep * static_cast<double>(k), way = std::clamp(t - 1.0, 0.0, 1.0);
    angle(k) = 0.6 * (1.0 - std::cos(std::numbers::pi * way));
    if (k >= kLifted) angle(k) = 1.2 * std::exp(2.0 - t) * std::cos(7.0 * (t - 2.0));
  }
  ProposalRequest request;
  request.no_drive = true;
  const auto proposal_of = [&](const VectorXd& motion, const std::string& title) {
    const VectorXd time =
        VectorXd::LinSpaced(motion.size(), 0.0, kStep * static_cast<double>(motion.size() - 1));
    return proposed(table_of({{"time [s]", time}, {title, motion}}), {}, request);
  };
  const ModelProposal lifted = proposal_of(angle, "angle [rad]");
  EXPECT_TRUE(says(lifted, "leaves its rest by 1.2 rad and comes back to it, between 1.1"))
      << all_of(lifted);
  EXPECT_TRUE(says(lifted, "and 2.0")) << all_of(lifted);
  // From where it is let go, or held there before, it swings freely; so it does once it was struck.
  const std::string words = "though nothing is said to drive";
  EXPECT_FALSE(says(proposal_of(angle.tail(kRows - kLifted), "angle [rad]"), words));
  EXPECT_FALSE(says(proposal_of(angle.tail(kRows - kLifted + 5), "angle [rad]"), words));
  EXPECT_FALSE(says(proposal_of(angle.tail(kRows - kLifted - 22), "angle [rad]"), words));
}

// K (goal - q): the goal drives, and a spring of the servo's gain pulls back.
TEST_F(LogDoors, AServosGoalDrivesThroughItsSpring) {
  const DoorAxis m = door_axis(600, 0.01);
  const VectorXd goal = m.position + 0.5 * m.force;
  const std::string text = table_of(
      {{"time [s]", m.time}, {"position [rad]", m.position}, {"goal_position [rad]", goal}});
  const ModelProposal asked = proposed(text);
  EXPECT_TRUE(says(asked, "--column 'goal_position=goal'")) << all_of(asked);
  EXPECT_TRUE(says(proposed(text, {"goal_position=command"}), "a servo follows it"));
  ProposalRequest request;
  request.gain = 2.0;
  const ModelProposal proposal = proposed(text, {"goal_position=goal"}, request);
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "the goal drives through it")) << all_of(proposal);
  EXPECT_NE(proposal.model_text.find("stiffness: {value: 2, unit: N m/rad, fixed: true}"),
            std::string::npos)
      << proposal.model_text;
  const ExperimentRecording run = loaded(proposal);
  const SignalPiece& piece = run.data.pieces.at(0);
  for (Index k = 0; k < piece.time.size(); ++k) {
    const auto row = static_cast<Index>(std::lround(piece.time(k) / 0.01));
    EXPECT_NEAR(piece.values(k, run.index_of("torque")), 2.0 * goal(row), 1e-6);
  }
  // A goal in the unit of the position, which is in degrees.
  const ModelProposal degrees = proposed(
      table_of({{"time [s]", m.time}, {"position [deg]", m.position}, {"goal_position", goal}}),
      {"goal_position=goal"});
  const ExperimentRecording other = loaded(degrees);
  EXPECT_NEAR(other.data.pieces.at(0).values(50, other.index_of("torque")),
              goal(std::lround(other.data.pieces.at(0).time(50) / 0.01)) * std::numbers::pi / 180.0,
              1e-9);
}

// A step of the goal before the first row is constant in the log.
TEST_F(LogDoors, AGoalThatNeverChangesIsOffered) {
  const VectorXd time = VectorXd::LinSpaced(300, 0.0, 2.99);
  const VectorXd place = time.unaryExpr([](double t) { return 1.5 - 1.5 * std::exp(-4.0 * t); });
  const VectorXd goal = VectorXd::Constant(300, 1.5);
  for (const char* title : {"goal_position [rad]", "goal_rad", "setpoint", "target"}) {
    const std::string text = table_of({{"time [s]", time}, {"pos_rad", place}, {title, goal}});
    const ModelProposal asked = proposed(text);
    ASSERT_EQ(asked.questions.size(), 1U) << all_of(asked);
    const std::string name = std::string(title).substr(0, std::string(title).find(' '));
    EXPECT_TRUE(says(asked, fmt::format("--column '{}=goal'", name))) << all_of(asked);
    const ModelProposal answered = proposed(text, {name + "=goal"});
    EXPECT_TRUE(answered.questions.empty()) << all_of(answered);
    EXPECT_TRUE(says(answered, "the goal drives through it")) << all_of(answered);
  }
  // A speed's goal is none of a position, and neither is what no title calls one.
  for (const char* title : {"goal_speed [rad/s]", "battery", "mode"}) {
    const ModelProposal asked =
        proposed(table_of({{"time [s]", time}, {"pos_rad", place}, {title, goal}}));
    EXPECT_FALSE(says(asked, "=goal'")) << all_of(asked);
  }
}

// The flat crests of a goal are wanted; those of a torque may be a drive's end.
TEST_F(LogDoors, AGoalDoesNotSaturate) {
  const DoorAxis m = door_axis(1500, 0.01);
  const VectorXd flat = (90.0 * m.force.array()).min(40.0).max(-40.0).matrix();
  const auto clipped = [&](const std::string& column, const std::string& unit) {
    testing::write_text(folder_.file("log.csv"), table_of({{"q", m.position}, {column, flat}}));
    testing::write_text(folder_.file("campaign.yaml"),
                        fmt::format("format: graybox-campaign/1\nsample_time: 0.01\nchannels:\n"
                                    "  - {{name: q, unit: rad, is: output}}\n"
                                    "  - {{name: torque, column: {}, unit: {}, is: input}}\n"
                                    "experiments: [{{file: log.csv}}]\n",
                                    column, unit));
    return examine_recordings(read_campaign(folder_.file("campaign.yaml"))).clipped;
  };
  EXPECT_EQ(clipped("drive", "N m"), std::vector<std::string>{"torque"});
  EXPECT_TRUE(clipped("wanted", "deg, gain: {value: 0.1, unit: N m/deg}").empty());
  EXPECT_TRUE(clipped("goal", "counts, gain: {value: 0.1, unit: N m/counts}").empty());
  EXPECT_EQ(clipped("dac", "counts, gain: {value: 0.1, unit: N m/counts}").size(), 1U);
}

// Counts are those of the position; what is no position is no goal.
TEST_F(LogDoors, AGoalIsInTheUnitOfAPosition) {
  const DoorAxis m = door_axis(600, 0.01);
  const VectorXd goal = m.position + 0.5 * m.force;
  const auto text = [&](const std::string& title, const VectorXd& values) {
    return table_of(
        {{"time [s]", m.time}, {"position [counts]", 1000.0 * m.position}, {title, values}});
  };
  ProposalRequest request;
  request.counts_per_turn = 2000.0 * std::numbers::pi;
  const ModelProposal counts =
      proposed(text("goal [counts]", 1000.0 * goal), {"goal=goal"}, request);
  const ExperimentRecording run = loaded(counts);
  EXPECT_NEAR(run.data.pieces.at(0).values(50, run.index_of("torque")),
              goal(std::lround(run.data.pieces.at(0).time(50) / 0.01)), 1e-6);
  testing::expect_refused([&] { (void)proposed(text("goal [N m]", goal), {"goal=goal"}, request); },
                          "a goal in N m is none of a position in counts");
  request.no_drive = true;
  testing::expect_refused([&] { (void)proposed(text("goal [rad]", goal), {"goal=goal"}, request); },
                          "--no-drive: 'goal' is the goal of a servo");
  request.no_drive = false;
  testing::expect_refused(
      [&] {
        (void)proposed(text("goal [rad]", goal * std::numeric_limits<double>::quiet_NaN()),
                       {"goal=goal"}, request);
      },
      "column 'goal' holds no numbers");
}

TEST_F(LogDoors, TheHoldOfADriveIsToldWithItsReason) {
  const DoorAxis m = door_axis(600, 0.01);
  const auto hold_of = [&](const std::string& drive) {
    const ModelProposal proposal = proposed(
        table_of({{"time [s]", m.time}, {"position [rad]", m.position}, {drive, m.force}}));
    const bool is_zero = proposal.campaign_text.find("hold: zero") != std::string::npos;
    const std::string hold = value_of(proposal, "hold");
    EXPECT_TRUE(hold.starts_with(is_zero ? "zero; " : "first; ")) << all_of(proposal);
    return hold;
  };
  const std::string usual = "zero; between samples, as a controller holds its output; guessed";
  for (const char* title : {"current [A]", "pwm", "voltage [V]", "torque command [N m]"}) {
    EXPECT_EQ(hold_of(title), usual) << title;
  }
  EXPECT_EQ(hold_of("torque measured [N m]"),
            "first; evenly from sample to sample: the drive was measured");
  EXPECT_NE(hold_of("torque [N m]").find("where the drive was measured, write hold: first"),
            std::string::npos);
  ProposalRequest request;
  request.no_drive = true;
  EXPECT_EQ(value_of(proposed(table_of({{"time [s]", m.time}, {"position [rad]", m.position}}), {},
                              request),
                     "hold"),
            "");
}

TEST_F(LogDoors, AStepFromZeroIsNoSupply) {
  const DoorAxis m = door_axis(400, 0.01);
  VectorXd step = VectorXd::Constant(400, 12.0), supply = step;
  for (Index k = 0; k < 400; ++k) supply(k) -= 0.05 * std::sin(0.3 * static_cast<double>(k));
  step.head(3).setZero();
  const auto with = [&](const VectorXd& volts) {
    return proposed(
        table_of({{"time [s]", m.time}, {"speed [rad/s]", m.time}, {"voltage [V]", volts}}));
  };
  EXPECT_TRUE(with(step).questions.empty()) << all_of(with(step));
  EXPECT_TRUE(says(with(supply), "as a supply does")) << all_of(with(supply));
}

// ---- titles -------------------------------------------------------------------------------------

TEST_F(LogDoors, TitlesOfDrivesAndSpeeds) {
  for (const char* title : {"Vin", "vin", "V_in", "Vout", "volts"}) {
    EXPECT_EQ(read_column_words(title, "").quantity, LogQuantity::kVoltage) << title;
  }
  for (const char* title : {"u", "pwm_duty", "PWM", "duty"}) {
    EXPECT_EQ(read_column_words(title, "").quantity, LogQuantity::kCommand) << title;
  }
  const ColumnWords speed = read_column_words("velocity measured [Hz]", "");
  EXPECT_EQ(speed.unit, "turn/s");
  EXPECT_TRUE(speed.odd_unit.empty());
  EXPECT_EQ(column_answer("w=velocity:Hz").unit, "turn/s");
  EXPECT_TRUE(read_column_words("torque [Hz]", "").unit.empty());
}

TEST_F(LogDoors, ColumnsAreNamedWithAndWithoutTheirUnits) {
  const DoorAxis m = door_axis(300, 0.01);
  const std::string text = table_of({{"time [s]", m.time},
                                     {"angle [rad]", m.position},
                                     {"motor torque [Nm]", m.force},
                                     {"net torque [N m]", m.force}});
  for (const char* name : {"motor torque", "motor torque [Nm]", "motor torque [N m]"}) {
    const ModelProposal proposal =
        proposed(text, {std::string(name) + "=torque", "net torque=ignore"});
    EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
    EXPECT_TRUE(says(proposal, "drive: 'motor torque")) << all_of(proposal);
  }
  EXPECT_TRUE(proposed(text, {"net torque [N m]=torque", "motor torque=ignore"}).questions.empty());
  testing::expect_refused([&] { (void)proposed(text, {"motor torque [A]=torque"}); },
                          "has no such column");
}

TEST_F(LogDoors, AMotorsAccelerationMayBeTheCommand) {
  const DoorAxis m = door_axis(300, 0.01);
  const ModelProposal proposal = proposed(table_of({{"time", m.time},
                                                    {"angle_velocity [rad/s]", m.velocity},
                                                    {"angle [rad]", m.position},
                                                    {"motor_acc", m.force}}));
  EXPECT_TRUE(says(proposal, "--column 'motor_acc=command'")) << all_of(proposal);
}

TEST_F(LogDoors, OneQuestionIsAskedOnce) {
  const DoorAxis m = door_axis(300, 0.01);
  ProposalRequest request;
  request.machine = ProposedMachine::kTwoMasses;
  const ModelProposal proposal = proposed(
      table_of({{"time [s]", m.time}, {"speed [furlong]", m.velocity}, {"torque [N m]", m.force}}),
      {}, request);
  ASSERT_FALSE(proposal.questions.empty());
  for (std::size_t a = 0; a < proposal.questions.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      EXPECT_NE(proposal.questions[a].text, proposal.questions[b].text);
    }
  }
}

// ---- what is doubted ----------------------------------------------------------------------------

TEST_F(LogDoors, CountsCalledRadAreDoubted) {
  const DoorAxis m = door_axis(600, 0.01);
  const double counts = 8192.0 / 6.283185307;
  VectorXd encoder = 2233639.0 + counts * m.position.array() * 4.0;
  for (double& each : encoder) each = std::round(each * 4.0) / 4.0;
  const auto text = [&](const VectorXd& position) {
    return table_of(
        {{"time [s]", m.time}, {"position [rad]", position}, {"torque [N m]", m.force}});
  };
  EXPECT_TRUE(says(proposed(text(encoder)), "are these counts of an encoder, or radians?"));
  EXPECT_TRUE(says(proposed(text(encoder), {"position=position:rad"}), "Then say --column"));
  EXPECT_TRUE(proposed(text(1000.3 * m.position)).questions.empty());
}

TEST(KeptOutHalves, AHalfThatTremblesIsNotKeptOut) {
  const Index n = 600;
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.02);
  VectorXd angle(n);
  for (Index k = 0; k < n; ++k) {
    const double t = static_cast<double>(k) / 100.0;
    angle(k) = t < 2.0 ? 0.5 * std::cos(3.0 * t) : 0.5 * std::cos(6.0);
    angle(k) += noise(random);
  }
  for (const double drive : {0.0, 1.0}) {
    VectorXd force = VectorXd::Zero(n);
    for (Index k = 0; k < n; ++k) force(k) = drive * std::sin(0.7 * static_cast<double>(k));
    EXPECT_EQ(kept_out_blocks(force, angle, false).reason, "nothing moves in the second half");
  }
  // One that swings on is kept out.
  for (Index k = 0; k < n; ++k) angle(k) = 0.5 * std::cos(0.03 * static_cast<double>(k));
  EXPECT_EQ(kept_out_blocks(VectorXd::Zero(n), angle, false).reason, "");
}

// An axis that brakes, turns round and stands there a while is not cut; one whose range ends is.
TEST(FlatTops, TurningPointsAreNoClipping) {
  std::vector<double> steps{0.06, 0.14, 0.22};
  steps.insert(steps.end(), 40, 0.30);
  steps.insert(steps.end(), {0.22, 0.14, 0.06, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  const auto profile = [&](double limit) {
    VectorXd values(static_cast<Index>(10 * steps.size()));
    double place = 0.0;
    for (Index k = 0; k < values.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      values(k) = 0.02 * std::round(std::min(place, limit) / 0.02);
      place += (at / steps.size() % 2 == 0 ? 1.0 : -1.0) * steps[at % steps.size()];
    }
    return values;
  };
  EXPECT_EQ(clipped_samples(profile(100.0)), 0U);
  EXPECT_GT(clipped_samples(profile(10.0)), 0U);
}

// Noise tells two samples apart: one long flat top is no chance. A drive at rest is at zero.
TEST(FlatTops, OneIsEnoughInNoise) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 0.02);
  VectorXd values(300);
  for (Index k = 0; k < values.size(); ++k) {
    values(k) = 2.0 * std::sin(0.02 * static_cast<double>(k)) + noise(random);
  }
  EXPECT_EQ(clipped_samples(values), 0U);
  EXPECT_GT(clipped_samples(values.cwiseMin(1.5)), 30U);
  EXPECT_GT(clipped_samples(values.cwiseMin(1.5).cwiseMax(-1.5)), 70U);
  EXPECT_EQ(clipped_samples(values.cwiseMax(0.0)), 0U);
}

TEST_F(LogDoors, ACoarseSpeedIsNoGear) {
  const DoorAxis m = door_axis(1000, 0.01);
  VectorXd coarse = m.velocity, geared = 3.7 * m.velocity;
  const double largest = m.velocity.cwiseAbs().maxCoeff();
  for (double& v : coarse) v = 1.2 * (std::abs(v) < 0.5 * largest ? 0.4 * v : v);
  const auto with = [&](const VectorXd& speed) {
    return proposed(table_of({{"time [s]", m.time},
                              {"position [deg]", 57.29577951 * m.position},
                              {"speed [deg/s]", 57.29577951 * speed},
                              {"torque [N m]", m.force}}));
  };
  EXPECT_FALSE(says(with(coarse), "as behind a gear")) << all_of(with(coarse));
  EXPECT_TRUE(says(with(coarse), "a coarse speed")) << all_of(with(coarse));
  EXPECT_TRUE(says(with(geared), "as behind a gear")) << all_of(with(geared));
}

TEST_F(LogDoors, AMeasuredCurrentGoesOnBetweenSamples) {
  const DoorAxis m = door_axis(300, 0.01);
  const auto hold_of = [&](const std::string& title) {
    const ModelProposal proposal = proposed(
        table_of({{"time [s]", m.time}, {"position [rad]", m.position}, {title, m.force}}));
    const std::size_t at = proposal.campaign_text.find("hold: ");
    return proposal.campaign_text.substr(at + 6, 5);
  };
  EXPECT_EQ(hold_of("actual current [A]"), "first");
  EXPECT_EQ(hold_of("current [A]"), "zero ");
}

// ---- speeds and places --------------------------------------------------------------------------

// Only the mean of a speed that hardly changes is compared.
TEST_F(LogDoors, ASteadySpeedIsComparedByItsMean) {
  constexpr Index kSamples = 400;
  for (const double share : {1.0, 0.6}) {
    VectorXd time(kSamples), place(kSamples), speed(kSamples), force(kSamples);
    for (Index k = 0; k < kSamples; ++k) {
      const auto n = static_cast<double>(k);
      time(k) = 0.01 * n;
      // Noise of stamps in the place, and a ripple of the speed that the place hardly has.
      place(k) = share * 5.0 * time(k) + 0.01 * std::sin(37.0 * n * n);
      speed(k) = 5.0 + 0.1 * std::sin(11.0 * n * n + 1.0);
      force(k) = std::sin(3.0 * n * n);
    }
    const ModelProposal proposal = proposed(table_of({{"time [s]", time},
                                                      {"position [rad]", place},
                                                      {"velocity [rad/s]", speed},
                                                      {"torque [N m]", force}}));
    EXPECT_EQ(says(proposal, "is not the rate of"), share < 1.0) << all_of(proposal);
  }
}

// A sample time that the user stated is the first suspect where rate and velocity differ by a
// number.
TEST_F(LogDoors, AStatedSampleTimeIsDoubtedFirst) {
  const DoorAxis m = door_axis(2000, 0.01);
  const std::string table =
      table_of({{"position", m.position}, {"velocity", m.velocity}, {"torque [N m]", m.force}});
  ProposalRequest request;
  request.sample_time = 0.0125;
  const ModelProposal wrong = proposed(table, {}, request);
  EXPECT_TRUE(says(wrong, "x 0.0125 s = 10 ms for --sample-time")) << all_of(wrong);
  request.sample_time = 0.01;
  EXPECT_FALSE(says(proposed(table, {}, request), "for --sample-time"));
}

// Milliseconds under a title that says seconds make the rate a thousandth of the velocity.
TEST_F(LogDoors, AnotherUnitOfTimeIsAsked) {
  const DoorAxis m = door_axis(1500, 0.01);
  const auto table = [&](double unit) {
    return table_of({{"time [s]", unit * m.time},
                     {"position [rad]", m.position},
                     {"velocity [rad/s]", m.velocity},
                     {"torque [N m]", m.force}});
  };
  EXPECT_TRUE(proposed(table(1.0)).questions.empty());
  const ModelProposal wrong = proposed(table(1000.0));
  EXPECT_NE(questions_of(wrong).find("Is the time in ms?"), std::string::npos) << all_of(wrong);
  const ModelProposal answered = proposed(table(1000.0), {"time=time:ms"});
  EXPECT_TRUE(answered.questions.empty()) << all_of(answered);
  EXPECT_TRUE(says(proposed(table(1000.0), {"time=time:s"}), "as behind a gear"));
}

// A position in coarse steps has a rate of mere noise, and yet its velocity is its rate.
TEST_F(LogDoors, ANoisyPositionDoesNotDoubtItsSpeed) {
  DoorAxis m = door_axis(400, 0.001);
  std::mt19937_64 random(2);
  std::normal_distribution<double> noise(0.0, 4e-4);
  for (double& place : m.position) place += noise(random);
  const ModelProposal proposal = proposed(table_of({{"time [s]", m.time},
                                                    {"position [rad]", m.position},
                                                    {"velocity [rad/s]", m.velocity},
                                                    {"torque [N m]", m.force}}));
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
}

// What speeds up with its drive is not driven backwards, however poorly its mass is told.
TEST_F(LogDoors, ADriveThatPushesIsNotCalledReversed) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  VectorXd time(60), voltage(60), speed(60);
  for (Index k = 0; k < 60; ++k) {
    time(k) = 0.1 * static_cast<double>(k);
    voltage(k) = 11.5 * (1.0 - std::exp(-time(k) / 1.5));
    // The speed comes a sample before the voltage that was read.
    speed(k) = 5.0 * 11.5 * (1.0 - std::exp(-(time(k) + 0.1) / 1.5)) + noise(random);
  }
  const ModelProposal proposal = proposed(
      table_of({{"time [s]", time}, {"voltage [V]", voltage}, {"velocity [rad/s]", speed}}));
  EXPECT_FALSE(says(proposal, "are the signs right?")) << all_of(proposal);
}

// Whatever stands before it starts.
TEST_F(LogDoors, ADriveAgainstItsMotionIsTold) {
  VectorXd time(300), voltage(300), speed(300);
  for (Index k = 0; k < 300; ++k) {
    time(k) = 0.02 * static_cast<double>(k);
    voltage(k) = k < 150 ? 0.0 : -9.0;
    // In counts, and with an impact where it starts: no mass is told.
    const double grows = 11.6355 * (1.0 - std::exp(-(time(k) - 3.0) / 0.02));
    speed(k) = k < 150 ? 0.0 : k < 152 ? 16.7 : 0.727 * std::round(grows / 0.727);
  }
  const ModelProposal proposal = proposed(
      table_of({{"time [s]", time}, {"voltage [V]", voltage}, {"velocity [rad/s]", speed}}));
  EXPECT_TRUE(says(proposal, "acts against the motion, which goes one way")) << all_of(proposal);
  // A boom that a weight pulls down and that comes back slowly goes both ways.
  for (VectorXd* const values : {&time, &voltage, &speed}) values->conservativeResize(345);
  for (Index k = 300; k < 345; ++k) {
    time(k) = 0.02 * static_cast<double>(k);
    voltage(k) = -9.0;
    speed(k) = -2.3;
  }
  const ModelProposal both = proposed(
      table_of({{"time [s]", time}, {"voltage [V]", voltage}, {"velocity [rad/s]", speed}}));
  EXPECT_FALSE(says(both, "which goes one way")) << all_of(both);
}

// A controller's log names what it has measured the current value.
TEST_F(LogDoors, ACurrentBesideATargetAndADriveIsAsked) {
  const DoorAxis m = door_axis(400, 0.01);
  const std::string text = table_of({{"time [s]", m.time},
                                     {"target", VectorXd::Ones(400)},
                                     {"current", m.position},
                                     {"pwm", m.force}});
  const ModelProposal proposal = proposed(text);
  EXPECT_TRUE(says(proposal, "Is 'current' an electric current")) << all_of(proposal);
  const ModelProposal answered = proposed(text, {"current=position:rad"});
  EXPECT_TRUE(says(answered, "'pwm'")) << all_of(answered);
  EXPECT_TRUE(answered.questions.empty()) << all_of(answered);
  // Beside a motion it is what it says.
  const ModelProposal plain = proposed(table_of({{"time [s]", m.time},
                                                 {"position [rad]", m.position},
                                                 {"current", m.force},
                                                 {"pwm", m.force + m.velocity}}));
  EXPECT_FALSE(says(plain, "electric current")) << all_of(plain);
}

// u = -k q - d v of what was measured; a force that moves a mass beside it is none.
TEST_F(LogDoors, ADriveThatAControllerComputedIsTold) {
  const DoorAxis m = door_axis(600, 0.01);
  const auto told = [&](const VectorXd& drive) {
    return says(proposed(table_of({{"time [s]", m.time},
                                   {"position [rad]", m.position},
                                   {"velocity [rad/s]", m.velocity},
                                   {"torque [N m]", drive}})),
                "a controller computed it");
  };
  EXPECT_TRUE(told(-3.0 * m.position - 0.5 * m.velocity + VectorXd::Constant(600, 0.2)));
  EXPECT_FALSE(told(m.force));
}

// By its own quantity: its sizes are then told in its unit.
TEST_F(LogDoors, ADriveThatStaysTheSameIsOffered) {
  const DoorAxis m = door_axis(400, 0.01);
  const std::string text = table_of({{"time [s]", m.time},
                                     {"voltage [V]", VectorXd::Constant(400, 12.0)},
                                     {"speed [rad/s]", m.velocity}});
  EXPECT_TRUE(says(proposed(text), "--column 'voltage=voltage'")) << all_of(proposed(text));
  EXPECT_TRUE(proposed(text, {"voltage=voltage"}).questions.empty());
}

// Seconds under a title of microseconds.
TEST_F(LogDoors, TimesThatNoMachineIsSampledAtAreAsked) {
  const DoorAxis m = door_axis(400, 0.001);
  const auto text = [&](double factor) {
    return table_of(
        {{"time_us", factor * m.time}, {"position [rad]", m.position}, {"torque [N m]", m.force}});
  };
  EXPECT_TRUE(says(proposed(text(1.0)), "Is 'time_us' in us, as its title says?"));
  EXPECT_FALSE(says(proposed(text(1e6)), "Is 'time_us'"));
  EXPECT_FALSE(says(proposed(text(1.0), {"time_us=time:s"}), "Is 'time_us'"));
}

// The stamps come in steps of two sizes, the samples do not; the angle wraps.
TEST_F(LogDoors, StampsThatJitterWhileTheSamplesDoNotAreTold) {
  const DoorAxis m = door_axis(600, 0.033);
  VectorXd stamps(600), angle(600);
  for (Index k = 0; k < 600; ++k) {
    stamps(k) = 0.02 * std::round(m.time(k) / 0.02);
    angle(k) = std::remainder(60.0 * m.position(k), 360.0);
  }
  const auto told = [&](const VectorXd& time) {
    return says(
        proposed(table_of({{"time [s]", time}, {"angle [deg]", angle}, {"torque [N m]", m.force}})),
        "moves as if sampled evenly");
  };
  EXPECT_TRUE(told(stamps));
  EXPECT_FALSE(told(m.time));
}

// Millimetres that are called metres make an axis that few have; so do milliseconds called seconds.
TEST_F(LogDoors, SpeedsAndMassesThatNoAxisHasAreDoubted) {
  const DoorAxis m = door_axis(1500, 0.01);
  const auto said = [&](double length, double time) {
    return all_of(proposed(table_of({{"time [s]", time * m.time},
                                     {"position [m]", length * m.position},
                                     {"force [N]", m.force}})));
  };
  EXPECT_EQ(said(1.0, 1.0).find("right?"), std::string::npos) << said(1.0, 1.0);
  EXPECT_NE(said(100.0, 1.0).find("which few axes do"), std::string::npos) << said(100.0, 1.0);
  EXPECT_NE(said(1.0, 1000.0).find("would move here"), std::string::npos) << said(1.0, 1000.0);
}

// A title that says "output" names no load where nothing else moves.
TEST_F(LogDoors, TheOnlySensorOfTwoMassesIsTheMotors) {
  const DoorAxis m = door_axis(1000, 0.01);
  ProposalRequest request;
  request.machine = ProposedMachine::kTwoMasses;
  const ModelProposal proposal =
      proposed(table_of({{"time [s]", m.time}, {"input", m.force}, {"output", m.velocity}}),
               {"output=velocity:rad/s", "input=torque:N m"}, request);
  EXPECT_TRUE(says(proposal, "'output' is the only motion")) << all_of(proposal);
}

// Units that you state stay; a ratio of two sensors that move together is told.
TEST_F(LogDoors, AGearIsNotGuessedAgainstStatedUnits) {
  const DoorAxis m = door_axis(1000, 0.01);
  ProposalRequest request;
  request.machine = ProposedMachine::kTwoMasses;
  const auto two = [&](const std::vector<std::string>& columns) {
    return proposed(table_of({{"time [s]", m.time},
                              {"motor_position", m.position},
                              {"load_position", 0.8 * m.position},
                              {"force [N]", m.force}}),
                    columns, request);
  };
  const ModelProposal stated = two({"motor_position=position:mm", "load_position=position:mm"});
  EXPECT_FALSE(says(stated, "load's sensor: times")) << all_of(stated);
  EXPECT_TRUE(says(stated, "the load moves 0.8 times as far as the motor")) << all_of(stated);
  const ModelProposal open = two({"motor_position=position:mm", "load_position=position"});
  EXPECT_FALSE(says(open, "times as far as the motor")) << all_of(open);
}

// A letter's guess that jumps as a switch does is no position.
TEST_F(LogDoors, ASwitchIsNoPosition) {
  const DoorAxis m = door_axis(2000, 0.01);
  VectorXd level(2000);
  for (Index k = 0; k < level.size(); ++k) {
    level(k) = (k / 300 % 2 == 0 ? 0.01 : 2.25) + 0.002 * std::sin(5.0 * static_cast<double>(k));
  }
  const auto table = [&](const VectorXd& y) {
    return table_of({{"time", m.time}, {"D", m.position}, {"Y", y}, {"F", m.force}});
  };
  const ModelProposal open = proposed(table(level));
  EXPECT_TRUE(says(open, "Which is the measured position or velocity: 'D' or 'Y'?"))
      << all_of(open);
  EXPECT_TRUE(says(proposed(table(m.position)), "position: 'Y'"));
  EXPECT_TRUE(says(proposed(table(level), {"Y=position:m"}), "position: 'Y' in m; you said so"));
}

// ---- two recordings -----------------------------------------------------------------------------

// There in one recording and back in the other: both ways are fitted, and both are kept out.
TEST_F(LogDoors, OppositeWaysAreSharedOut) {
  constexpr Index kSamples = 400;
  const auto kept_out = [&](double first, double second, std::size_t& parts) {
    ProposalRequest request;
    request.machine = ProposedMachine::kOneMass;
    request.folder = folder_.file("axis");
    for (const double way : {first, second}) {
      VectorXd time(kSamples), place(kSamples), force(kSamples);
      for (Index k = 0; k < kSamples; ++k) {
        time(k) = 0.01 * static_cast<double>(k);
        place(k) = way * time(k) + (way == 0.0 ? std::sin(4.0 * time(k)) : 0.0);
        force(k) = 3.0 * way + 10.0 * std::sin(place(k));
      }
      request.logs.push_back(folder_.file(request.logs.empty() ? "one.csv" : "two.csv"));
      testing::write_text(
          request.logs.back(),
          table_of({{"time [s]", time}, {"position [rad]", place}, {"torque [N m]", force}}));
    }
    const ModelProposal proposal = propose_model(request);
    parts = 0;
    const std::string role = "role: validation";
    for (std::size_t at = proposal.campaign_text.find(role); at != std::string::npos;
         at = proposal.campaign_text.find(role, at + 1)) {
      ++parts;
    }
    return says(proposal, "every second part of each recording");
  };
  std::size_t parts = 0;
  EXPECT_TRUE(kept_out(0.35, -0.35, parts));
  EXPECT_EQ(parts, 4U);
  EXPECT_FALSE(kept_out(0.35, 0.3, parts));
  EXPECT_EQ(parts, 1U);
  EXPECT_FALSE(kept_out(0.35, 0.0, parts));
}

}  // namespace
}  // namespace graybox
