// What `graybox model` makes of a robot's log beside its URDF: whose columns they are, which joints
// are left out and said to be, counts, units, and what is kept out. All logs are made here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/joint_columns.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Signal = std::function<double(double)>;

constexpr int kRows = 600;
constexpr double kStep = 0.02;

// Revolute joints in a row about y, each with a link of 1 kg, between -3 and 3 rad.
std::string urdf_of(const std::vector<std::string>& joints) {
  std::string text = "<robot name=\"arm\">\n<link name=\"base\"/>\n", parent = "base";
  for (const std::string& joint : joints) {
    const std::string link = joint + "_link";
    text += fmt::format(
        "<link name=\"{}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"1\"/><inertia "
        "ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\n"
        "<joint name=\"{}\" type=\"revolute\"><parent link=\"{}\"/><child link=\"{}\"/><origin "
        "xyz=\"0.2 0 0\"/><axis xyz=\"0 1 0\"/><limit lower=\"-3\" upper=\"3\" effort=\"10\" "
        "velocity=\"5\"/></joint>\n",
        link, joint, parent, link);
    parent = link;
  }
  return text + "</robot>\n";
}

class RobotLogs : public ::testing::Test {
 protected:
  ModelProposal proposed(const std::vector<std::string>& joints,
                         const std::vector<std::pair<std::string, Signal>>& columns,
                         const std::vector<std::string>& answers = {},
                         std::optional<double> counts_per_turn = {}) {
    return proposed_of(urdf_of(joints), columns, answers, counts_per_turn);
  }

  ModelProposal proposed_of(const std::string& urdf,
                            const std::vector<std::pair<std::string, Signal>>& columns,
                            const std::vector<std::string>& answers = {},
                            std::optional<double> counts_per_turn = {}) {
    testing::write_text(folder_.file("arm.urdf"), urdf);
    std::string text = "time [s]";
    for (const auto& [title, signal] : columns) text += "," + title;
    text += "\n";
    for (int k = 0; k < kRows; ++k) {
      text += fmt::format("{:.2f}", kStep * k);
      for (const auto& [title, signal] : columns) text += fmt::format(",{:.6g}", signal(kStep * k));
      text += "\n";
    }
    testing::write_text(folder_.file("log.csv"), text);
    ProposalRequest request;
    request.machine = ProposedMachine::kRobot;
    request.urdf = folder_.file("arm.urdf");
    request.logs = {folder_.file("log.csv")};
    request.folder = folder_.file("arm");
    request.counts_per_turn = counts_per_turn;
    for (const std::string& each : answers) request.columns.push_back(column_answer(each));
    return propose_model(request);
  }

  static std::string value_of(const ModelProposal& proposal, const std::string& subject) {
    for (const ProposedGuess& guess : proposal.guesses) {
      if (guess.subject == subject) return guess.value + "; " + guess.reason;
    }
    return "";
  }
  static std::string notes_of(const ModelProposal& proposal) {
    std::string text;
    for (const std::string& note : proposal.notes) text += note + "\n";
    return text;
  }

  testing::TemporaryFolder folder_;
};

Signal swing(double size, double rate, double phase) {
  return [=](double t) { return size * std::sin(rate * t + phase); };
}

std::vector<std::pair<std::string, Signal>> two_joints(const std::string& second) {
  return {{"waist_pos", swing(1.0, 3.0, 0.0)},
          {"waist_effort", swing(40.0, 3.0, 1.0)},
          {second + "_pos", swing(0.8, 4.1, 0.3)},
          {second + "_effort", swing(30.0, 4.1, 1.0)}};
}

TEST_F(RobotLogs, AJointsNameIsNoQuantity) {
  for (const char* name : {"wrist_angle", "torque_arm", "position_stage", "speedJoint"}) {
    const ModelProposal robot = proposed({"waist", name}, two_joints(name));
    EXPECT_EQ(value_of(robot, "joints").substr(0, 10), "2, waist t") << name;
    EXPECT_NE(robot.campaign_text.find(fmt::format("\"{}_effort\"", name)), std::string::npos)
        << name << robot.campaign_text;
  }
}

TEST_F(RobotLogs, AJointThatIsNamedDoesNotDropTheOthers) {
  const std::vector<std::pair<std::string, Signal>> columns{{"waist_pos", swing(1.0, 3.0, 0.0)},
                                                            {"waist_effort", swing(40.0, 3.0, 1.0)},
                                                            {"w_p", swing(0.8, 4.1, 0.3)},
                                                            {"w_i", swing(30.0, 4.1, 1.0)}};
  const ModelProposal both =
      proposed({"waist", "wrist"}, columns, {"w_p=position@wrist", "w_i=current@wrist"});
  EXPECT_EQ(value_of(both, "joints").substr(0, 17), "2, waist to wrist");
  // All that is there for one joint alone is named once.
  const ModelProposal one = proposed({"waist"}, {columns[0], columns[1]});
  EXPECT_EQ(value_of(one, "joints").substr(0, 9), "1, waist;") << value_of(one, "joints");
  EXPECT_EQ(value_of(one, "positions").find(" to "), std::string::npos);
}

// Also where the name is but a word for joints and a number, which a title would not be held to.
TEST_F(RobotLogs, AJointIsNamedByItsWholeName) {
  const std::vector<std::pair<std::string, Signal>> columns{{"q1", swing(1.0, 3.0, 0.0)},
                                                            {"q2", swing(0.8, 4.1, 0.3)},
                                                            {"current", swing(40.0, 3.0, 1.0)}};
  for (const char* name : {"joint_1", "joint-1"}) {
    const ModelProposal robot =
        proposed({"joint_1", "joint_2"}, columns, {fmt::format("current=torque@{}", name)});
    EXPECT_EQ(value_of(robot, "joints").substr(0, 11), "1, joint_1;") << name;
    EXPECT_NE(robot.campaign_text.find("column: \"current\""), std::string::npos) << name;
  }
  testing::expect_refused(
      [&] {
        proposed({"joint_1", "joint_2"}, columns, {"current=torque@joint_9"});
      },
      "the URDF has no joint 'joint_9'; there are joint_1, joint_2");
}

TEST_F(RobotLogs, ALockedJointThatMovesIsTold) {
  const ModelProposal robot = proposed({"waist", "wrist"}, {{"waist_pos", swing(1.0, 3.0, 0.0)},
                                                            {"waist_effort", swing(40.0, 3.0, 1.0)},
                                                            {"wrist_pos", swing(0.8, 4.1, 0.3)},
                                                            {"wrist_xyz", swing(30.0, 4.1, 1.0)}});
  EXPECT_NE(notes_of(robot).find("joint wrist is locked at "), std::string::npos)
      << notes_of(robot);
  EXPECT_NE(notes_of(robot).find("though 'wrist_pos' moves it: --column "
                                 "'wrist_xyz=torque@wrist' adds it"),
            std::string::npos)
      << notes_of(robot);
  // And the option does.
  const ModelProposal added = proposed({"waist", "wrist"},
                                       {{"waist_pos", swing(1.0, 3.0, 0.0)},
                                        {"waist_effort", swing(40.0, 3.0, 1.0)},
                                        {"wrist_pos", swing(0.8, 4.1, 0.3)},
                                        {"wrist_xyz", swing(30.0, 4.1, 1.0)}},
                                       {"wrist_xyz=torque@wrist"});
  EXPECT_EQ(value_of(added, "joints").substr(0, 17), "2, waist to wrist");
  EXPECT_EQ(notes_of(added).find("locked"), std::string::npos) << notes_of(added);
}

TEST_F(RobotLogs, JointsThatMoveInProportionAreTold) {
  const auto columns_with = [](const Signal& elbow) {
    std::vector<std::pair<std::string, Signal>> columns = two_joints("wrist");
    columns.insert(columns.begin() + 2,
                   {{"elbow_pos", elbow}, {"elbow_effort", columns[1].second}});
    return columns;
  };
  const auto notes_with = [&](const Signal& elbow) {
    return notes_of(proposed({"waist", "elbow", "wrist"}, columns_with(elbow)));
  };
  for (const double size : {0.5, -0.5}) {
    const std::string notes = notes_with(
        [=](double t) { return 0.4 + size * std::sin(3.0 * t) + 0.02 * std::sin(4.1 * t); });
    EXPECT_NE(notes.find("joints waist and elbow move in proportion (to "), std::string::npos)
        << notes;
    EXPECT_NE(notes.find("this log can't tell their friction or loads apart"), std::string::npos);
  }
  // A third of a radian later a joint goes its own way.
  EXPECT_EQ(notes_with(swing(0.5, 3.0, 0.35)).find("in proportion"), std::string::npos);
  EXPECT_EQ(notes_with(swing(0.5, 2.0, 0.0)).find("in proportion"), std::string::npos);
}

TEST_F(RobotLogs, FrictionThatTheUrdfStatesIsToldAndLeftOut) {
  EXPECT_EQ(notes_of(proposed({"waist", "wrist"}, two_joints("wrist"))).find("<dynamics>"),
            std::string::npos);
  std::string urdf = urdf_of({"waist", "wrist"});
  const std::size_t first = urdf.find("</joint>");
  urdf.insert(first, "<dynamics damping=\"0.7\" friction=\"0.2\"/>");
  const ModelProposal robot = proposed_of(urdf, two_joints("wrist"));
  EXPECT_NE(notes_of(robot).find("(<dynamics>: waist 0.7 and 0.2): not in the model"),
            std::string::npos)
      << notes_of(robot);
}

// One row in which all joints read alike makes no motor angles of the others.
TEST_F(RobotLogs, ADropoutIsNoOtherUnit) {
  const auto dropping = [](const Signal& signal, double value) -> Signal {
    return [=](double t) { return std::abs(t - 4.0) < 0.25 * kStep ? value : signal(t); };
  };
  std::vector<std::pair<std::string, Signal>> columns = two_joints("wrist");
  for (auto& [title, signal] : columns) {
    signal = dropping(signal, title.ends_with("pos") ? -6.0 : 0.0);
  }
  const ModelProposal robot = proposed({"waist", "wrist"}, columns);
  for (const OpenQuestion& question : robot.questions) {
    EXPECT_EQ(question.text.find("motor angles"), std::string::npos) << question.text;
  }
  EXPECT_NE(notes_of(robot).find("beyond the joints' limits in row 200 alone"), std::string::npos)
      << notes_of(robot);
  for (auto& [title, signal] : columns) {
    if (title.ends_with("pos")) signal = swing(9.0, 3.0, 0.0);
  }
  EXPECT_EQ(notes_of(proposed({"waist", "wrist"}, columns)).find("dropout"), std::string::npos);
}

TEST_F(RobotLogs, AJointThatStandsStillIsLockedWhereItStands) {
  const auto columns_with = [](const Signal& elbow, const Signal& effort) {
    std::vector<std::pair<std::string, Signal>> columns = two_joints("wrist");
    columns.emplace_back("elbow_pos", elbow);
    columns.emplace_back("elbow_effort", effort);
    return columns;
  };
  const Signal still = [](double) { return -0.25; };
  // Between the joints that move, and beyond them.
  const ModelProposal between = proposed({"waist", "elbow", "wrist"}, columns_with(still, still));
  EXPECT_EQ(value_of(between, "joints").substr(0, 17), "2, waist to wrist");
  EXPECT_EQ(value_of(between, "locked").substr(0, 18), "elbow at -0.25 rad");
  EXPECT_NE(between.model_text.find("locked: {\"elbow\": -0.25}"), std::string::npos)
      << between.model_text;
  // An encoder that trembles is still, too, beside a motor that gives nothing.
  const Signal trembling = [](double t) { return -0.25 + 2e-3 * std::sin(900.0 * t); };
  for (const double effort : {0.0, 0.4}) {
    const ModelProposal noisy = proposed({"waist", "elbow", "wrist"},
                                         columns_with(trembling, [=](double) { return effort; }));
    EXPECT_EQ(value_of(noisy, "joints").substr(0, 17), "2, waist to wrist");
    EXPECT_EQ(value_of(noisy, "locked").substr(0, 18), "elbow at -0.25 rad");
    EXPECT_EQ(notes_of(noisy).find("moves"), std::string::npos) << notes_of(noisy);
  }
  const ModelProposal beyond = proposed({"waist", "wrist", "elbow"}, columns_with(still, still));
  EXPECT_EQ(value_of(beyond, "locked").substr(0, 18), "elbow at -0.25 rad");
  const ModelProposal at_zero =
      proposed({"waist", "wrist", "elbow"}, columns_with([](double) { return 0.0; }, still));
  EXPECT_EQ(at_zero.model_text.find("locked"), std::string::npos) << at_zero.model_text;
  // Before them, it turns gravity: by -0.25 rad about y.
  const ModelProposal before = proposed({"elbow", "waist", "wrist"}, columns_with(still, still));
  EXPECT_EQ(before.model_text.find("locked"), std::string::npos) << before.model_text;
  EXPECT_NE(before.model_text.find(fmt::format("gravity: [{:.6g}, 0, {:.6g}]",
                                               -9.81 * std::sin(0.25), -9.81 * std::cos(0.25))),
            std::string::npos)
      << before.model_text;
  testing::expect_refused(
      [&] {
        proposed({"waist", "elbow", "wrist"}, columns_with(swing(1.0, 2.0, 0.0), still));
      },
      "its force is not logged or never changes");
}

// Zeros are a known force; another constant may be an idle offset.
TEST_F(RobotLogs, AJointThatNothingDrivesStays) {
  const auto with = [&](double torque, double swing_of_second, const char* unit) {
    return proposed({"joint_1", "joint_2"},
                    {{"q1", swing(1.0, 3.0, 0.0)},
                     {"q2", swing(swing_of_second, 4.1, 0.3)},
                     {fmt::format("tau1{}", unit), swing(4.0, 3.0, 1.0)},
                     {fmt::format("tau2{}", unit), [=](double) { return torque; }}});
  };
  const ModelProposal passive = with(0.0, 0.8, " [N m]");
  EXPECT_EQ(value_of(passive, "joints").substr(0, 21), "2, joint_1 to joint_2");
  EXPECT_EQ(notes_of(passive).find("locked"), std::string::npos) << notes_of(passive);
  EXPECT_NE(notes_of(passive).find("joint joint_2 moves and 'tau2"), std::string::npos)
      << notes_of(passive);
  EXPECT_NE(notes_of(passive).find("is zero throughout"), std::string::npos) << notes_of(passive);
  EXPECT_EQ(notes_of(passive).find("the force never changes"), std::string::npos);
  EXPECT_NE(passive.model_text.find("\"joint_2\", gear_ratio: 1, rotor_inertia: 0}"),
            std::string::npos)
      << passive.model_text;
  EXPECT_EQ(notes_of(passive).find("gains are unknown"), std::string::npos) << notes_of(passive);
  EXPECT_NE(notes_of(with(0.0, 0.8, "")).find("gains are unknown; state their unit"),
            std::string::npos);
  const ModelProposal offset = with(0.7, 0.8, " [N m]");
  EXPECT_EQ(value_of(offset, "joints").substr(0, 11), "1, joint_1;");
  EXPECT_NE(notes_of(offset).find("never changes, so its force is not known"), std::string::npos)
      << notes_of(offset);
  EXPECT_EQ(value_of(with(0.0, 0.0, " [N m]"), "joints").substr(0, 11), "1, joint_1;");
}

// A column of zeros that is named, as the note advises; alone it drives nothing.
TEST_F(RobotLogs, ZerosMayBeNamed) {
  const Signal none = [](double) { return 0.0; };
  std::vector<std::pair<std::string, Signal>> columns{{"waist_pos", swing(1.0, 3.0, 0.0)},
                                                      {"waist_effort", swing(40.0, 3.0, 1.0)},
                                                      {"wrist_pos", swing(0.8, 4.1, 0.3)},
                                                      {"zeros", none}};
  EXPECT_NE(notes_of(proposed({"waist", "wrist"}, columns)).find("(zeros where nothing drives it)"),
            std::string::npos);
  const ModelProposal robot = proposed({"waist", "wrist"}, columns, {"zeros=torque@wrist"});
  EXPECT_EQ(value_of(robot, "joints").substr(0, 17), "2, waist to wrist");
  columns[1].second = none;
  testing::expect_refused(
      [&] {
        proposed({"waist", "wrist"}, columns, {"zeros=torque@wrist"});
      },
      "no columns that move are the torque, effort or current");
}

TEST_F(RobotLogs, CountsOfServosAreAskedForAndCentred) {
  const auto counted = [](double middle, double phase) -> Signal {
    return [=](double t) { return std::round(middle + 500.0 * std::sin(3.0 * t + phase)); };
  };
  const std::vector<std::pair<std::string, Signal>> columns{
      {"waist_position", counted(2048.0, 0.0)},
      {"waist_current", swing(40.0, 3.0, 1.0)},
      {"wrist_position", counted(2500.0, 0.5)},
      {"wrist_current", swing(30.0, 3.0, 1.5)}};
  const ModelProposal open = proposed({"waist", "wrist"}, columns);
  ASSERT_EQ(open.questions.size(), 1U);
  EXPECT_NE(open.questions.front().option.find("--counts-per-turn"), std::string::npos);
  EXPECT_EQ(value_of(open, "positions").find("keep within"), std::string::npos)
      << value_of(open, "positions");
  const ModelProposal robot = proposed({"waist", "wrist"}, columns, {}, 4096.0);
  EXPECT_TRUE(robot.questions.empty());
  EXPECT_NE(value_of(robot, "positions").find("zero at 2048"), std::string::npos)
      << value_of(robot, "positions");
  EXPECT_NE(robot.campaign_text.find(
                fmt::format("value: {:.8g}, unit: rad/counts", 2.0 * std::numbers::pi / 4096.0)),
            std::string::npos)
      << robot.campaign_text;
  // Half a turn is subtracted.
  EXPECT_NE(robot.campaign_text.find("name: centre, value: 3.1415927, unit: rad"),
            std::string::npos)
      << robot.campaign_text;
  EXPECT_NE(robot.campaign_text.find("weights: [1, -1], unit: rad, name: position_wrist"),
            std::string::npos);
  // Angles are no counts.
  testing::expect_refused(
      [&] {
        (void)proposed({"waist", "wrist"}, two_joints("wrist"), {}, 4096.0);
      },
      "--counts-per-turn: 'waist_pos' is in no whole numbers, not in counts");
}

TEST_F(RobotLogs, EffortsWithoutAUnitAreInUnitsOfTheirOwn) {
  const ModelProposal robot = proposed({"waist", "wrist"}, two_joints("wrist"));
  EXPECT_NE(robot.campaign_text.find("column: \"waist_effort\", unit: \"1\", gain: {value: 1, "
                                     "unit: \"N m/1\"}"),
            std::string::npos)
      << robot.campaign_text;
}

TEST_F(RobotLogs, AJointThatGoesOneWayInAHalfIsSharedOut) {
  // Swings, and from the middle on only goes back.
  const double half = 0.5 * kRows * kStep;
  const Signal one_way = [=](double t) {
    return t < half ? 0.4 * std::sin(4.0 * t) : 0.4 * std::sin(4.0 * half) - 0.25 * (t - half);
  };
  std::vector<std::pair<std::string, Signal>> columns = two_joints("wrist");
  EXPECT_EQ(value_of(proposed({"waist", "wrist"}, columns), "kept out").substr(0, 15),
            "the second half");
  columns[2].second = one_way;
  const ModelProposal robot = proposed({"waist", "wrist"}, columns);
  EXPECT_NE(value_of(robot, "kept out").find("every second of"), std::string::npos)
      << value_of(robot, "kept out") << notes_of(robot);
  EXPECT_NE(value_of(robot, "kept out").find("joint wrist: the axis goes one way in one half"),
            std::string::npos)
      << value_of(robot, "kept out");
}

// A unit is no part of what a column is called: all joints are read, and patterns find them.
TEST_F(RobotLogs, UnitsInTheTitlesPartNoJoints) {
  const std::vector<std::pair<std::string, Signal>> columns{
      {"joint1_pos [deg]", swing(57.0, 3.0, 0.0)},
      {"joint1_torque [Nm]", swing(40.0, 3.0, 1.0)},
      {"joint2_pos [deg]", swing(46.0, 4.1, 0.3)},
      {"joint2_torque [N m]", swing(30.0, 4.1, 1.0)}};
  const auto expect_both = [&](const ModelProposal& robot) {
    EXPECT_TRUE(robot.questions.empty());
    EXPECT_EQ(value_of(robot, "joints").substr(0, 19), "2, joint1 to joint2");
    EXPECT_EQ(value_of(robot, "not used"), "");
    EXPECT_EQ(notes_of(robot).find("locked"), std::string::npos) << notes_of(robot);
  };
  expect_both(proposed({"joint1", "joint2"}, columns));
  expect_both(proposed({"joint1", "joint2"}, columns, {"joint*_torque=torque:N m"}));
  // Written otherwise for each joint: nothing is to be chosen either.
  std::vector<std::pair<std::string, Signal>> others = columns;
  others[1].first = "motor 1 torque [Nm]";
  expect_both(proposed({"joint1", "joint2"}, others));
  // Two torques of one joint are: what is asked for is advised about no further.
  others[1].first = "joint1_torque [Nm]";
  others.push_back({"joint1_effort [Nm]", swing(41.0, 3.0, 1.2)});
  others.push_back({"joint2_effort [Nm]", swing(31.0, 4.1, 1.2)});
  const ModelProposal open = proposed({"joint1", "joint2"}, others);
  ASSERT_EQ(open.questions.size(), 1U);
  EXPECT_NE(open.questions[0].text.find("'joint*_torque', 'joint*_effort'?"), std::string::npos)
      << open.questions[0].text;
}

}  // namespace
}  // namespace graybox
