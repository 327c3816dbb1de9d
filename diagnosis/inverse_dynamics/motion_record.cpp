#include "diagnosis/inverse_dynamics/motion_record.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "diagnosis/inverse_dynamics/law_force.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

// What the channels of one kind must be in, one a joint.
std::vector<std::string> units_of(const RigidRobotModel& robot, const char* revolute,
                                  const char* prismatic, int derivatives) {
  std::vector<std::string> units;
  for (const RobotJoint& joint : robot.joints) {
    std::string unit = joint.is_prismatic ? prismatic : revolute;
    for (int k = 0; k < derivatives; ++k) unit = unit_of_derivative(unit);
    units.push_back(std::move(unit));
  }
  return units;
}

// A zero-phase filter guesses what came before a recording and after it. Of positions that are
// differentiated twice the ends then are mostly that guess.
Motion without_filter_ends(const Motion& motion) {
  double lowest = 0.0;
  for (const FilterPass& filter : motion.filters) {
    lowest = lowest > 0.0 ? std::min(lowest, filter.frequency) : filter.frequency;
  }
  if (!(lowest > 0.0) || !(motion.sample_time() > 0.0)) return motion;
  const double reach = std::ceil(kFilterReach / (lowest * motion.sample_time()) - 1e-9);
  if (reach > 0.25 * static_cast<double>(motion.samples())) return motion;
  const auto end = static_cast<Index>(reach);
  return samples_of(motion, end, motion.samples() - 2 * end);
}

class MotionReader {
 public:
  MotionReader(const RigidRobotModel& robot, const Campaign& campaign,
               const ExperimentRecording& recording)
      : robot_(robot), source_(campaign.file.string()), recording_(recording) {}

  [[nodiscard]] std::vector<Motion> read() const {
    const RobotChannels& channels = robot_.channels;
    const auto torque = columns(channels.torque, units_of(robot_, "N m", "N", 0));
    const auto position = columns(channels.position, units_of(robot_, "rad", "m", 0));
    const auto velocity = columns(channels.velocity, units_of(robot_, "rad", "m", 1));
    const auto acceleration = columns(channels.acceleration, units_of(robot_, "rad", "m", 2));
    const Eigen::MatrixXd to_joints = robot_.transmission.inverse().transpose();
    const auto joints = [&](const Eigen::MatrixXd& values) {
      return channels.motor_position ? Eigen::MatrixXd(values * to_joints) : values;
    };
    std::vector<Motion> motions;
    for (const SignalPiece& piece : recording_.data.pieces) {
      if (piece.time.size() < 3) fail("a segment has fewer than three samples");
      Motion motion;
      motion.time = piece.time;
      motion.torque = piece.values(Eigen::all, torque);
      if (channels.motor_torque) motion.torque = (motion.torque * robot_.transmission).eval();
      motion.filters = filters_of(torque);
      motion.position_is_recorded = !position.empty();
      if (!position.empty()) motion.position = joints(piece.values(Eigen::all, position));
      motion.velocity = velocity.empty() ? slopes(motion.time, motion.position)
                                         : joints(piece.values(Eigen::all, velocity));
      if (position.empty()) motion.position = integral(motion.time, motion.velocity);
      motion.acceleration = acceleration.empty() ? slopes(motion.time, motion.velocity)
                                                 : joints(piece.values(Eigen::all, acceleration));
      motions.push_back(without_filter_ends(motion));
    }
    return motions;
  }

 private:
  [[noreturn]] void fail(const std::string& text) const {
    throw InputError(fmt::format("{}: {}", source_, text));
  }

  [[nodiscard]] std::vector<Index> columns(const std::vector<std::string>& names,
                                           const std::vector<std::string>& units) const {
    const std::vector<Signal>& signals = recording_.data.signals;
    std::vector<Index> result;
    for (std::size_t k = 0; k < names.size(); ++k) {
      const auto found = std::ranges::find(signals, names[k], &Signal::name);
      if (found == signals.end()) {
        std::string known;
        for (const Signal& signal : signals) known += (known.empty() ? "" : ", ") + signal.name;
        fail(fmt::format("no channel '{}', which the channels of model {} name; there are {}",
                         names[k], robot_.name, known));
      }
      if (found->unit != units[k]) {
        fail(fmt::format("channel {} is in {}; joint {} of model {} needs {}", names[k],
                         found->unit, robot_.joints[k].name, robot_.name, units[k]));
      }
      result.push_back(found - signals.begin());
    }
    return result;
  }

  // Of the least filtered torque.
  [[nodiscard]] std::vector<FilterPass> filters_of(const std::vector<Index>& torques) const {
    const std::vector<Signal>& signals = recording_.data.signals;
    const Signal* least = &signals[static_cast<std::size_t>(torques.front())];
    for (const Index column : torques) {
      const Signal& signal = signals[static_cast<std::size_t>(column)];
      if (signal.filters.empty()) return {};
      if (signal.low_pass > least->low_pass) least = &signal;
    }
    return least->filters;
  }

  // By trapezoids, from zero on.
  static Eigen::MatrixXd integral(const Eigen::VectorXd& time, const Eigen::MatrixXd& rates) {
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(rates.rows(), rates.cols());
    for (Index t = 1; t < rates.rows(); ++t) {
      result.row(t) =
          result.row(t - 1) + 0.5 * (time(t) - time(t - 1)) * (rates.row(t - 1) + rates.row(t));
    }
    return result;
  }

  static Eigen::MatrixXd slopes(const Eigen::VectorXd& time, const Eigen::MatrixXd& values) {
    Eigen::MatrixXd result(values.rows(), values.cols());
    for (Index k = 0; k < values.cols(); ++k) result.col(k) = time_derivative(time, values.col(k));
    return result;
  }

  const RigidRobotModel& robot_;
  std::string source_;
  const ExperimentRecording& recording_;
};

void check_loads(const RigidRobotModel& robot, const Campaign& campaign) {
  for (const Element& element : robot.elements) {
    const std::string& load = element.location.load;
    if (load.empty() || std::ranges::find(campaign.experiments, load, &Experiment::load) !=
                            campaign.experiments.end()) {
      continue;
    }
    throw InputError(
        fmt::format("{}: experiments: none has 'load: {}', which element '{}' of model {} needs",
                    campaign.file.string(), load, element.name, robot.name));
  }
}

}  // namespace

Motion samples_of(const Motion& motion, Index first, Index count) {
  Motion part = motion;
  part.time = motion.time.segment(first, count);
  for (Eigen::MatrixXd Motion::*signal :
       {&Motion::position, &Motion::velocity, &Motion::acceleration, &Motion::torque}) {
    part.*signal = (motion.*signal).middleRows(first, count);
  }
  if (motion.stands.size() > 0) part.stands = motion.stands.middleRows(first, count);
  return part;
}

bool needs_position(const RigidRobotModel& robot) {
  TorqueColumns columns(robot);
  const Eigen::Index joints = robot.size();
  const auto at = [&](double position) {
    columns.evaluate(Eigen::VectorXd::Constant(joints, position),
                     Eigen::VectorXd::LinSpaced(joints, 0.7, 1.9),
                     Eigen::VectorXd::LinSpaced(joints, -1.1, 2.3));
    Eigen::MatrixXd all(joints, columns.size() + 1);
    all << columns.matrix(), columns.known();
    return all;
  };
  for (const Element& element : robot.elements) {
    if (element.law && depends_on_position(*element.law)) return true;
  }
  const Eigen::MatrixXd here = at(0.0);
  return !at(0.83).isApprox(here, 1e-12) || !at(-2.1).isApprox(here, 1e-12);
}

std::vector<MotionRecord> read_motion_records(const RigidRobotModel& robot,
                                              const Campaign& campaign) {
  if (robot.channels.torque.empty()) {
    throw InputError(
        fmt::format("model {}: has no 'channels', which say what the campaign's torques and "
                    "positions are called",
                    robot.name));
  }
  if (robot.channels.position.empty() && needs_position(robot)) {
    throw InputError(
        fmt::format("model {}: channels: needs 'position': gravity, a law or another joint makes "
                    "the torques depend on it",
                    robot.name));
  }
  check_loads(robot, campaign);
  std::vector<MotionRecord> records;
  bool has_estimation = false;
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    const Experiment& experiment = campaign.experiments[k];
    const ExperimentRecording recording = load_experiment(campaign, k);
    records.push_back({experiment.name, experiment.role,
                       MotionReader(robot, campaign, recording).read(), recording.data.remarks});
    for (Motion& piece : records.back().pieces) piece.load = experiment.load;
    has_estimation = has_estimation || experiment.role == ExperimentRole::kEstimation;
  }
  if (!has_estimation) {
    throw InputError(
        fmt::format("{}: experiments: none has the role estimation", campaign.file.string()));
  }
  return records;
}

}  // namespace graybox
