#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/prediction/kinds.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Parameters in which the force is linear have the values of the file.
void take_values_of_file(RigidRobotModel& robot) {
  robot.known.clear();
  for (std::size_t e = 0; e < robot.elements.size(); ++e) {
    for (std::size_t p = 0; p < robot.elements[e].parameters.size(); ++p) {
      robot.known.push_back({e, p});
    }
  }
}

void refuse_unknown(const RigidRobotModel& robot) {
  std::vector<std::string> unknown;
  for (const RobotJoint& joint : robot.joints) {
    if (!joint.body) unknown.push_back("the body of " + joint.name);
    if (!joint.rotor_inertia) unknown.push_back("the rotor inertia of " + joint.name);
  }
  if (robot.channels.unknown_drive_gains) unknown.emplace_back("the gains of the drives");
  if (unknown.empty()) return;
  const bool is_one = unknown.size() == 1 && !robot.channels.unknown_drive_gains;
  throw InputError(
      fmt::format("model {}: {} {} unknown: a prediction needs numbers; 'graybox fit' estimates "
                  "what is unknown and says how well that predicts recordings kept out",
                  robot.name, fmt::join(unknown, ", "), is_one ? "is" : "are"));
}

MatrixXd predicted(TorqueColumns& columns, const Motion& piece) {
  MatrixXd forces = columns.remembered(piece);
  columns.carry(piece.load);
  for (Index t = 0; t < piece.samples(); ++t) {
    columns.evaluate(piece.position.row(t).transpose(), piece.velocity.row(t).transpose(),
                     piece.acceleration.row(t).transpose());
    forces.row(t) += columns.known().transpose();
  }
  return forces;
}

// Pieces of one recording one after another.
struct Forces {
  VectorXd time;
  MatrixXd measured, predicted;
};

Forces forces_of(TorqueColumns& columns, const MotionRecord& record) {
  Index samples = 0, row = 0;
  for (const Motion& piece : record.pieces) samples += piece.samples();
  const Index joints = record.pieces.front().position.cols();
  Forces all{VectorXd(samples), MatrixXd(samples, joints), MatrixXd(samples, joints)};
  for (const Motion& piece : record.pieces) {
    all.time.segment(row, piece.samples()) = piece.time;
    all.measured.middleRows(row, piece.samples()) = piece.torque;
    all.predicted.middleRows(row, piece.samples()) = predicted(columns, piece);
    row += piece.samples();
  }
  return all;
}

void add(const RigidRobotModel& robot, const MotionRecord& record, const Forces& forces,
         ModelPrediction& result) {
  RecordingPrediction prediction{record.name, record.role, 0.0, {}};
  const auto samples = static_cast<double>(forces.time.size());
  for (Index j = 0; j < forces.measured.cols(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const std::string unit = joint.is_prismatic ? "N" : "N m";
    const std::string name =
        fmt::format("{} of {}", joint.is_prismatic ? "force" : "torque", joint.name);
    const VectorXd measured = forces.measured.col(j), shown = forces.predicted.col(j);
    const double mean = measured.mean();
    prediction.channels.push_back({name, unit,
                                   std::sqrt((measured - shown).squaredNorm() / samples),
                                   std::sqrt((measured.array() - mean).square().sum() / samples)});
    result.curves.push_back({record.name, name, unit, forces.time, measured, shown});
  }
  result.recordings.push_back(std::move(prediction));
}

}  // namespace

ModelPrediction predict_forces(RigidRobotModel robot, const Campaign& campaign) {
  refuse_unknown(robot);
  take_values_of_file(robot);
  TorqueColumns columns(robot);
  ModelPrediction result;
  result.of = "forces";
  for (const MotionRecord& record : read_motion_records(robot, campaign)) {
    for (const std::string& remark : record.remarks) {
      result.notes.push_back(fmt::format("{}: {}", record.name, remark));
    }
    if (record.pieces.empty()) continue;
    add(robot, record, forces_of(columns, record), result);
  }
  return result;
}

}  // namespace graybox
