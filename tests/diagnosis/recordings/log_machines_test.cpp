// Which machine `graybox model` makes of a log: every proposal can be read again, and what is
// measured or wanted is told apart. All logs are simulated here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/runs/proposed_files.hpp"
#include "tests/support/proposal_words.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Column = std::pair<std::string, std::vector<double>>;

// J v' = u - b v - c sign(v), at even times.
struct Machine {
  double step = 0.01, inertia = 0.02, damping = 0.05, dry = 0.1;
};

struct Motion {
  std::vector<double> time, position, velocity, force;
};

Motion moved(const Machine& machine, int samples, const std::function<double(double)>& drive) {
  constexpr int kSteps = 50;
  Motion result;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double t = machine.step * k, u = drive(t);
    result.time.push_back(t);
    result.position.push_back(q);
    result.velocity.push_back(v);
    result.force.push_back(u);
    for (int s = 0; s < kSteps; ++s) {
      const double rest = u - machine.damping * v - machine.dry * std::tanh(v / 0.01);
      v += rest / machine.inertia * machine.step / kSteps;
      q += v * machine.step / kSteps;
    }
  }
  return result;
}

double two_sines(double t) { return 0.6 * std::sin(2.0 * t) + 0.3 * std::sin(5.1 * t + 1.0); }

std::vector<double> mapped(const std::vector<double>& values,
                           const std::function<double(double)>& change) {
  std::vector<double> result;
  for (const double value : values) result.push_back(change(value));
  return result;
}

class LogMachines : public ::testing::Test, protected testing::ProposalWords {
 protected:
  std::string write(const std::string& name, const std::vector<Column>& columns) {
    std::string text;
    for (const Column& column : columns) text += (text.empty() ? "" : ",") + column.first;
    text += "\n";
    for (std::size_t k = 0; k < columns.front().second.size(); ++k) {
      for (std::size_t c = 0; c < columns.size(); ++c) {
        text += fmt::format("{}{:.9g}", c == 0 ? "" : ",", columns[c].second[k]);
      }
      text += "\n";
    }
    testing::write_text(folder_.file(name), text);
    return folder_.file(name);
  }

  // As the command proposes and writes it.
  ModelProposal written(const std::vector<std::string>& files, ProposalRequest request = {}) {
    if (request.machine == ProposedMachine::kOpen) request.machine = ProposedMachine::kOneMass;
    return written_as_asked(files, std::move(request));
  }
  ModelProposal written_as_asked(const std::vector<std::string>& files, ProposalRequest request) {
    for (const std::string& file : files) request.logs.emplace_back(file);
    request.folder = folder_.file("axis");
    ModelProposal proposal = propose_model(request);
    (void)write_proposal(request, proposal);
    return proposal;
  }

  testing::TemporaryFolder folder_;
};

// ---- what is proposed can be read ---------------------------------------------------------------

// Whatever the titles are: the reader of campaigns and models takes what was written.
TEST_F(LogMachines, EveryProposalIsReadByItsOwnReader) {
  const Motion m = moved({}, 400, two_sines);
  const std::vector<double> lagging = mapped(m.position, [](double q) { return 0.8 * q + 0.1; });
  const std::vector<std::vector<Column>> motions{
      {{"position", m.position}, {"velocity", m.velocity}},
      {{"position", m.position}},
      {{"velocity", m.velocity}},
      {{"motor_position", m.position}, {"velocity", m.velocity}},
      {{"load_position", m.position}, {"velocity", m.velocity}},
      {{"motor_position", m.position}, {"load_position", lagging}},
      {{"position", m.position}, {"load_velocity", m.velocity}},
      {{"position_1", m.position}, {"position_2", lagging}}};
  for (const char* drive : {"torque", "current", "motor_torque", "motor_current", "load_torque",
                            "motor_voltage", "command", "joint_torque", "u", "load_current"}) {
    for (const std::vector<Column>& motion : motions) {
      for (const ProposedMachine machine :
           {ProposedMachine::kOneMass, ProposedMachine::kTwoMasses, ProposedMachine::kOpen}) {
        std::vector<Column> columns{{"time [s]", m.time}, {drive, m.force}};
        columns.insert(columns.end(), motion.begin(), motion.end());
        ProposalRequest request;
        request.machine = machine;
        EXPECT_NO_THROW(written_as_asked({write("log.csv", columns)}, request))
            << drive << " beside " << motion.front().first << ", " << motion.back().first
            << ", machine " << static_cast<int>(machine);
      }
    }
  }
}

// ---- what is wanted was not measured ------------------------------------------------------------

TEST_F(LogMachines, WhatIsWantedIsNeverTheMeasuredMotion) {
  const Motion m = moved({}, 600, two_sines);
  const std::vector<double> wanted = mapped(m.position, [](double q) { return 1.1 * q + 0.01; });
  for (const char* title : {"position_des", "q_ref [rad]", "target position", "pos cmd",
                            "goal_position", "position sp", "wanted position", "desired angle"}) {
    const std::string log = write("log.csv", {{"time [s]", m.time},
                                              {"torque [N m]", m.force},
                                              {title, wanted},
                                              {"velocity [rad/s]", m.velocity}});
    const ModelProposal proposal = written({log});
    EXPECT_NE(value_of(proposal, "velocity").find("'velocity"), std::string::npos) << title;
    EXPECT_EQ(value_of(proposal, "position"), "") << title;
    // Alone it is asked about, and is what the user says.
    const std::string alone =
        write("alone.csv", {{"time [s]", m.time}, {"torque [N m]", m.force}, {title, wanted}});
    EXPECT_NE(questions_of(written({alone})).find("measured position"), std::string::npos) << title;
    ProposalRequest answered;
    answered.columns = {column_answer(std::string(title) + "=position:rad")};
    EXPECT_NE(value_of(written({alone}, answered), "position"), "") << title;
  }
}

// ---- copies -------------------------------------------------------------------------------------

// An encoder's counts beside its degrees drive nothing, unless the user says so.
TEST_F(LogMachines, ACopyOfTheMotionIsNoDrive) {
  const Motion m = moved({}, 400, two_sines);
  const std::string log =
      write("log.csv",
            {{"time [s]", m.time},
             {"angle [rad]", m.position},
             {"raw", mapped(m.position, [](double q) { return std::round(100.0 - 8192.0 * q); })}});
  const ModelProposal proposal = written({log});
  EXPECT_TRUE(says(proposal, "'raw' is a copy of 'angle' (times -8192)")) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "What drives the machine?")) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "raw: a copy of 'angle'")) << all_of(proposal);
  EXPECT_EQ(value_of(proposal, "drive"), "");
  ProposalRequest answered;
  answered.columns = {column_answer("raw=torque")};
  EXPECT_EQ(value_of(written({log}, answered), "drive"), "'raw'; you said so");
  // What follows the motion late is none.
  const std::string other =
      write("other.csv", {{"time [s]", m.time}, {"angle [rad]", m.position}, {"raw", m.force}});
  EXPECT_FALSE(says(written({other}), "is a copy of"));
}

// The duty cycle that a command becomes, under a title of a speed.
TEST_F(LogMachines, ACopyOfTheCommandIsNoMotion) {
  const Motion m = moved({}, 400, two_sines);
  const auto with = [&](const std::vector<double>& command, const std::vector<double>& speed) {
    return written({write(
        "log.csv",
        {{"time [s]", m.time}, {"pwm", command}, {"speed", speed}, {"angle [rad]", m.position}})});
  };
  const ModelProposal duty =
      with(m.force, mapped(m.force, [](double u) { return std::round(4915.0 + 1638.0 * u); }));
  EXPECT_TRUE(says(duty, "'speed' is an affine copy of 'pwm' (times 1638): a command, not used"))
      << all_of(duty);
  EXPECT_TRUE(says(duty, "position: 'angle' in rad")) << all_of(duty);
  EXPECT_FALSE(says(with(m.force, m.velocity), "affine copy"));
  // A controller that brakes makes its command of the speed.
  const std::vector<double> braking = mapped(m.velocity, [](double v) { return -0.5 * v; });
  EXPECT_FALSE(says(with(braking, m.velocity), "affine copy"));
}

// ---- several logs -------------------------------------------------------------------------------

// Every 10 ms and every 20 ms: all come to the slower rate, whichever log is the first.
TEST_F(LogMachines, LogsOfSeveralRatesComeToTheSlowest) {
  const auto file = [&](const std::string& name, double step, double size) {
    const Motion m = moved({.step = step}, 500, [&](double t) { return size * two_sines(t); });
    return write(name,
                 {{"time [s]", m.time}, {"torque [N m]", m.force}, {"position [rad]", m.position}});
  };
  const std::string fast = file("fast.csv", 0.01, 1.0), slow = file("slow.csv", 0.02, 1.0),
                    other = file("other.csv", 0.02, 1.2);
  for (const std::vector<std::string>& files : {std::vector{fast, slow}, std::vector{slow, fast}}) {
    const ModelProposal proposal = written(files);
    const std::string& text = proposal.campaign_text;
    EXPECT_NE(text.find("{kind: resample, sample_time: 0.01}"), std::string::npos) << text;
    EXPECT_NE(text.find("{kind: decimate, factor: 2}"), std::string::npos) << text;
    EXPECT_NE(notes_of(proposal).find("every 0.01 to 0.02 s"), std::string::npos)
        << notes_of(proposal);
    EXPECT_FALSE(proposal.is_too_short);
  }
  const ModelProposal alike = written({slow, other});
  EXPECT_EQ(alike.campaign_text.find("resample"), std::string::npos) << alike.campaign_text;
  EXPECT_EQ(notes_of(alike), "");
}

// 16 bits of microseconds: what is refused names the sample time that the steps have.
TEST_F(LogMachines, AClockOfFewBitsIsNamed) {
  const Motion m = moved({}, 300, two_sines);
  const auto log = [&](double period) {
    std::vector<double> ticks;
    for (int k = 0; k < 300; ++k) ticks.push_back(std::fmod(5e3 + 1e4 * k + k % 3, period));
    return write("log.csv",
                 {{"time [us]", ticks}, {"torque [N m]", m.force}, {"position [rad]", m.position}});
  };
  testing::expect_refused([&] { return written({log(65536.0)}); },
                          "the clock has 16 bits and begins anew at 2^16");
  testing::expect_refused([&] { return written({log(65536.0)}); }, "--sample-time 0.01");
  testing::expect_refused([&] { return written({log(5e4)}); }, "times must rise");
}

// One log that goes there is kept out of three that go there, there and back.
TEST_F(LogMachines, BothWaysStayInTheFit) {
  std::vector<std::string> files;
  for (const double level : {0.8, 0.6, -0.7}) {
    const Motion m = moved({}, 119, [&](double) { return level; });
    files.push_back(
        write(fmt::format("step_{}.csv", level),
              {{"time [s]", m.time}, {"voltage [V]", m.force}, {"speed [rad/s]", m.velocity}}));
  }
  const auto kept = [&](std::vector<std::size_t> order) {
    std::vector<std::string> ordered;
    for (const std::size_t k : order) ordered.push_back(files[k]);
    return value_of(written(ordered), "kept out");
  };
  EXPECT_NE(kept({0, 1, 2}).find("step_0.6"), std::string::npos) << kept({0, 1, 2});
  EXPECT_NE(kept({2, 0, 1}).find("step_0.6"), std::string::npos) << kept({2, 0, 1});
  EXPECT_NE(kept({2, 1, 0}).find("step_0.8"), std::string::npos) << kept({2, 1, 0});
}

// Each log holds one level of the drive, so that none tells the mass beside its dry friction.
TEST_F(LogMachines, TheOrderOfLogsDoesNotChangeTheMass) {
  std::vector<std::string> files;
  for (const double level : {0.3, 0.5}) {
    const Motion motion = moved({}, 200, [level](double) { return level; });
    files.push_back(write(fmt::format("level_{:g}.csv", level), {{"time [s]", motion.time},
                                                                 {"speed [rad/s]", motion.velocity},
                                                                 {"torque [N m]", motion.force}}));
  }
  const std::string mass = value_of(written(files), "mass");
  EXPECT_NEAR(std::stod(mass), 0.02, 0.002) << mass;
  EXPECT_NE(mass.find("least squares"), std::string::npos) << mass;
  std::swap(files[0], files[1]);
  EXPECT_EQ(value_of(written(files), "mass"), mass);
}

// ---- what nothing drives ------------------------------------------------------------------------

// Two masses of 1 and 0.6 that swing against each other at `hertz`, and coast together.
Motion free_swing(double hertz, bool is_load) {
  constexpr int kRows = 800, kSteps = 20;
  constexpr double kStep = 0.01, kMotor = 1.0, kLoad = 0.6, kDamping = 0.02;
  const double rate = 2.0 * std::numbers::pi * hertz;
  const double stiffness = rate * rate / (1.0 / kMotor + 1.0 / kLoad);
  Motion result;
  double x = 0.0, y = 0.0, v = 0.9, w = -0.6;
  for (int k = 0; k < kRows; ++k) {
    result.time.push_back(kStep * k);
    result.position.push_back(is_load ? y : x);
    result.velocity.push_back(is_load ? w : v);
    for (int s = 0; s < kSteps; ++s) {
      const double force = stiffness * (x - y) + kDamping * (v - w);
      v += (-force - kDamping * v) / kMotor * kStep / kSteps;
      w += (force - kDamping * w) / kLoad * kStep / kSteps;
      x += v * kStep / kSteps;
      y += w * kStep / kSteps;
    }
  }
  return result;
}

// An encoder that counts the other way has its sign in the campaign, with a drive and without one.
TEST_F(LogMachines, ALoadThatCountsTheOtherWayHasItsSignWithoutADrive) {
  ProposalRequest request;
  request.machine = ProposedMachine::kTwoMasses;
  request.no_drive = true;
  const Motion motor = free_swing(2.0, false);
  const std::vector<double> turned = mapped(motor.position, [](double q) { return -q; });
  const ModelProposal both =
      written_as_asked({write("log.csv", {{"time [s]", motor.time},
                                          {"motor angle [rad]", motor.position},
                                          {"load angle [rad]", turned}})},
                       request);
  const std::size_t load = both.campaign_text.find("\"load angle\"");
  ASSERT_NE(load, std::string::npos) << both.campaign_text;
  const std::string line =
      both.campaign_text.substr(load, both.campaign_text.find('\n', load) - load);
  EXPECT_NE(line.find("gain: {value: -1, unit: rad/rad}"), std::string::npos) << line;
}

TEST_F(LogMachines, TwoMassesThatNothingDrivesStartAtTheirSwing) {
  ProposalRequest request;
  request.machine = ProposedMachine::kTwoMasses;
  request.no_drive = true;
  for (const double hertz : {0.5, 3.0}) {
    const Motion motor = free_swing(hertz, false), load = free_swing(hertz, true);
    const double rate = 2.0 * std::numbers::pi * hertz;
    for (const bool is_velocity : {false, true}) {
      const std::vector<double>& signal = is_velocity ? motor.velocity : motor.position;
      const std::string title = is_velocity ? "motor speed [rad/s]" : "motor angle [rad]";
      const std::string log = write("log.csv", {{"time [s]", motor.time}, {title, signal}});
      const ModelProposal one = written_as_asked({log}, request);
      EXPECT_TRUE(one.questions.empty()) << all_of(one);
      EXPECT_NEAR(std::stod(value_of(one, "spring")), 0.5 * rate * rate, 0.1 * rate * rate);
      EXPECT_TRUE(says(one, "both are held, and all else is relative to them")) << all_of(one);
      EXPECT_NE(
          one.model_text.find("motor: {value: 1, fixed: true}, load: {value: 1, fixed: true}"),
          std::string::npos)
          << one.model_text;
    }
    const ModelProposal both =
        written_as_asked({write("log.csv", {{"time [s]", motor.time},
                                            {"motor angle [rad]", motor.position},
                                            {"load angle [rad]", load.position}})},
                         request);
    EXPECT_TRUE(says(both, "the motor's is held, and all else is relative to it")) << all_of(both);
    EXPECT_NE(both.model_text.find("motor: {value: 1, fixed: true}, load: 1}"), std::string::npos)
        << both.model_text;
  }
  // A run-down swings at no frequency.
  const std::vector<double> time = free_swing(1.0, false).time;
  const std::vector<double> slows = mapped(time, [](double t) { return 9.0 * std::exp(-0.4 * t); });
  const ModelProposal none = written_as_asked(
      {write("log.csv", {{"time [s]", time}, {"motor speed [rad/s]", slows}})}, request);
  EXPECT_TRUE(says(none, "a resonance at 20 Hz")) << all_of(none);
}

}  // namespace
}  // namespace graybox
