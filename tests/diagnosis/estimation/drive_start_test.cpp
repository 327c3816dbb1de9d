// What a drive was before a log began, and how actuators that follow late begin from it.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "diagnosis/predictor/drive_signals.hpp"
#include "diagnosis/predictor/drive_start.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kStep = 0.002, kTorque = 3.2, kLag = 0.04;
constexpr Index kSamples = 500;

// A motor, with elements as YAML.
LumpedModel motor_with(const std::string& elements, const std::string& quantity = "velocity") {
  const testing::TemporaryFolder folder;
  std::ofstream(folder.file("model.yaml"))
      << "format: graybox-lumped/1\nsample_time: 0.002\nmotion: rotation\nmasses: {motor: 0.02}\n"
      << "elements:\n  - {name: bearing, location: {kind: element, mass: motor}, law: viscous, "
         "parameters: {damping: {value: 0.1, unit: N m s/rad}}}\n"
      << elements << "inputs:\n  - {name: torque, mass: motor}\noutputs:\n"
      << "  - {name: y, mass: motor, quantity: " << quantity << "}\n";
  return load_lumped_model(folder.file("model.yaml"));
}

const char* const kLate =
    "  - {name: late, location: {kind: actuator, input: torque}, law: lag, parameters: "
    "{time_constant: {value: 0.04, unit: s}}}\n";
const char* const kSpring =
    "  - {name: spring, location: {kind: element, mass: motor}, law: stiffness, parameters: "
    "{stiffness: {value: 2, unit: N m/rad}}}\n";

// The speed settles at `last` from `first`, later by a lag; the drive steps back half-way.
OutputErrorRecording recording(double first, double last, bool as_position = false,
                               double lag = kLag) {
  constexpr double kSettles = 0.2;  // s
  OutputErrorRecording result;
  result.time = VectorXd::LinSpaced(kSamples, 0.0, kStep * static_cast<double>(kSamples - 1));
  VectorXd speed(kSamples), drive(kSamples), angle(kSamples);
  for (Index k = 0; k < kSamples; ++k) {
    const double t = result.time(k), slow = std::exp(-t / kSettles);
    const double left =
        lag > 0.0 ? (kSettles * slow - lag * std::exp(-t / lag)) / (kSettles - lag) : slow;
    speed(k) = last + (first - last) * left;
    drive(k) = 2 * k < kSamples ? kTorque : 0.2 * kTorque;
    angle(k) = (k > 0 ? angle(k - 1) : 0.0) + kStep * speed(k);
  }
  result.inputs = drive;
  result.outputs = as_position ? angle : speed;
  return result;
}

TEST(DriveStart, ALogThatBeginsWithTheCommandHadNoneBefore) {
  EXPECT_EQ(drives_before(motor_with(""), recording(0.0, 30.0))(0), 0.0);
  EXPECT_EQ(drives_before(motor_with("", "position"), recording(0.0, 30.0, true))(0), 0.0);
  EXPECT_EQ(drives_before(motor_with(""), recording(0.0, -30.0))(0), 0.0);
}

TEST(DriveStart, AMachineThatTurnsOrStaysHadTheFirstCommand) {
  EXPECT_EQ(drives_before(motor_with(""), recording(30.0, 30.0))(0), kTorque);
  EXPECT_EQ(drives_before(motor_with(""), recording(25.0, 30.0))(0), kTorque);
  EXPECT_EQ(drives_before(motor_with(kSpring), recording(0.0, 30.0))(0), kTorque);
  OutputErrorRecording noisy = recording(0.0, 30.0, false, 0.0);
  noisy.outputs(0, 0) += 0.1;  // it goes at once, and its sensor does not say that it stood
  EXPECT_EQ(drives_before(motor_with(""), noisy)(0), kTorque);
  OutputErrorRecording changes = recording(0.0, 30.0);
  for (Index k = 0; k < kSamples; ++k)
    changes.inputs(k, 0) = std::cos(0.5 * static_cast<double>(k));
  EXPECT_EQ(drives_before(motor_with(""), changes)(0), 1.0);
}

// What reads exactly zero stood, and a command that moves it at once was not there before.
TEST(DriveStart, AMachineThatReadsRestHadNoCommandBefore) {
  EXPECT_EQ(drives_before(motor_with(""), recording(0.0, 30.0, false, 0.0))(0), 0.0);
  EXPECT_EQ(drives_before(motor_with(kSpring), recording(0.0, 30.0, false, 0.0))(0), kTorque);
}

// At rest speeds read zero and positions the same; a counter begins at zero. What turns is no rest.
TEST(DriveStart, ARecordingBeginsAtRestWhereItsFirstReadingsSaySo) {
  const LumpedModel by_speed = motor_with(""), by_position = motor_with("", "position");
  EXPECT_GT(samples_at_rest(by_speed, recording(0.0, 30.0)), 0);
  EXPECT_GT(samples_at_rest(by_position, recording(0.0, 30.0, true)), 0);
  EXPECT_EQ(samples_at_rest(by_speed, recording(25.0, 30.0)), 0);
  EXPECT_EQ(samples_at_rest(by_position, recording(25.0, 30.0, true)), 0);
  OutputErrorRecording shifted = recording(0.0, 30.0, true);
  shifted.outputs.array() += 0.7;
  shifted.outputs(1, 0) += 0.01;
  EXPECT_EQ(samples_at_rest(by_position, shifted), 0) << "neither twice the same nor zero";
  OutputErrorRecording goes_on = recording(0.0, 30.0);
  goes_on.past_inputs = Eigen::MatrixXd::Constant(5, 1, kTorque);
  EXPECT_EQ(samples_at_rest(by_speed, goes_on), 0) << "a part of a file before it";
}

// T x' = u - x from x(0) = 0: x = u (1 - exp(-t/T)); from x(0) = u: x = u.
TEST(DriveStart, ALateActuatorBeginsFromThere) {
  const LumpedModel late = motor_with(kLate);
  for (const double first : {0.0, 30.0}) {
    const std::vector<OutputErrorRecording> recordings{recording(first, 30.0)};
    const RecordedNodes nodes = recorded_nodes(recordings, InputHold::kZero, 1);
    DriveSignals signals(recordings, InputHold::kZero, nodes);
    const NodeInputs& drive = signals.of(0, late, kStep);
    for (const Index k : {Index{1}, Index{10}, Index{100}}) {
      const double t = kStep * static_cast<double>(k);
      const double expected = first > 0.0 ? kTorque : -kTorque * std::expm1(-t / kLag);
      EXPECT_NEAR(drive.samples(0, k), expected, 1e-9 * kTorque) << first << " " << k;
    }
  }
}

TEST(DriveStart, ADelayedCommandIsNotThereBeforeItsDelay) {
  const LumpedModel late = motor_with(
      "  - {name: late, location: {kind: actuator, input: torque}, law: delay, parameters: "
      "{time: {value: 0.01, unit: s}}}\n");
  const std::vector<OutputErrorRecording> recordings{recording(0.0, 30.0)};
  const RecordedNodes nodes = recorded_nodes(recordings, InputHold::kZero, 1);
  DriveSignals signals(recordings, InputHold::kZero, nodes);
  const NodeInputs& drive = signals.of(0, late, kStep);
  EXPECT_EQ(drive.samples(0, 4), 0.0);
  EXPECT_EQ(drive.samples(0, 5), kTorque);
}

// Whatever an actuator remembers, the second part of a record goes on where the first ends.
TEST(DriveStart, APartGoesOnWhereTheOneBeforeEnds) {
  const std::vector<std::string> laws{
      "delay, parameters: {time: {value: 0.013, unit: s}}",
      "lag, parameters: {time_constant: {value: 0.04, unit: s}}",
      "rate_limit, parameters: {limit: {value: 20, unit: N m/s}, time_constant: {value: 0.005, "
      "unit: s}}"};
  OutputErrorRecording whole = recording(0.0, 30.0);
  for (Index k = 0; k < kSamples; ++k)
    whole.inputs(k, 0) = std::cos(0.05 * static_cast<double>(k)) + (k % 40 < 20 ? 1.0 : -1.0);
  OutputErrorRecording part = whole;
  const Index cut = 300;
  part.time = whole.time.tail(kSamples - cut);
  part.inputs = whole.inputs.bottomRows(kSamples - cut);
  part.outputs = whole.outputs.bottomRows(kSamples - cut);
  part.past_inputs = whole.inputs.topRows(cut);
  const std::vector<OutputErrorRecording> recordings{whole, part};
  for (const std::string& law : laws) {
    const LumpedModel late = motor_with(
        "  - {name: late, location: {kind: actuator, input: torque}, law: " + law + "}\n");
    for (const InputHold hold : {InputHold::kZero, InputHold::kFirst}) {
      const RecordedNodes nodes = recorded_nodes(recordings, hold, 2);
      DriveSignals signals(recordings, hold, nodes);
      const NodeInputs all = signals.of(0, late, kStep);
      const NodeInputs& drive = signals.of(1, late, kStep);
      ASSERT_EQ(drive.nodes.cols(), nodes[1].nodes.cols());
      EXPECT_TRUE(drive.nodes.isApprox(all.nodes.rightCols(drive.nodes.cols()), 1e-12)) << law;
      EXPECT_TRUE(drive.samples.isApprox(all.samples.rightCols(kSamples - cut), 1e-12)) << law;
    }
  }
}

TEST(DriveStart, PartsOfOneFileAreJoinedWhereTheyMeet) {
  const testing::TemporaryFolder folder;
  std::ofstream log(folder.file("log.csv"));
  log << "torque,y\n";
  for (int k = 0; k < 90; ++k) log << 0.1 * k << "," << 0.01 * k * k << "\n";
  log.close();
  std::ofstream(folder.file("campaign.yaml"))
      << "format: graybox-campaign/1\nsample_time: 0.002\nhold: zero\nchannels:\n"
         "  - {name: torque, column: torque, unit: N m, is: input}\n"
         "  - {name: y, column: y, unit: rad/s, is: output}\n"
         "experiments:\n  - {file: log.csv, segments: [[0, 29]]}\n"
         "  - {file: log.csv, segments: [[30, 59]], role: validation}\n"
         "  - {file: log.csv, segments: [[62, 89]]}\n";
  const OutputErrorData data =
      load_output_error_data(motor_with(""), read_campaign(folder.file("campaign.yaml")));
  ASSERT_EQ(data.recordings.size(), 3U);
  EXPECT_EQ(data.recordings[0].past_inputs.rows(), 0);
  EXPECT_EQ(data.recordings[1].past_inputs, data.recordings[0].inputs);
  EXPECT_EQ(data.recordings[2].past_inputs.rows(), 0);
}

// A step from one speed to another tells where it begins, and so all of the answer counts.
TEST(DriveStart, ARecordingBeginsAtOneSpeedUntilItsDriveSteps) {
  const LumpedModel by_speed = motor_with("");
  OutputErrorRecording step = recording(25.0, 30.0);
  constexpr Index kChange = 12;
  for (Index k = 0; k < kSamples; ++k) {
    const double since = 0.1 * static_cast<double>(k - kChange);
    step.inputs(k, 0) = k < kChange ? 0.5 * kTorque : kTorque;
    step.outputs(k, 0) =
        k < kChange ? 15.0 + 0.01 * static_cast<double>(k % 2) : 30.0 - 15.0 * std::exp(-since);
  }
  EXPECT_EQ(samples_at_one_speed(by_speed, step), kChange);
  EXPECT_EQ(samples_at_one_speed(motor_with("", "position"), step), 0);
  OutputErrorRecording turning = step;
  for (Index k = 0; k < kChange; ++k) turning.outputs(k, 0) = static_cast<double>(k);
  EXPECT_EQ(samples_at_one_speed(by_speed, turning), 0);
  EXPECT_EQ(samples_at_one_speed(by_speed, recording(25.0, 30.0)), 0)
      << "it turns faster before its drive steps";
  step.past_inputs = Eigen::MatrixXd::Constant(5, 1, kTorque);
  EXPECT_EQ(samples_at_one_speed(by_speed, step), 0) << "a part of a file before it";
}

}  // namespace
}  // namespace graybox
