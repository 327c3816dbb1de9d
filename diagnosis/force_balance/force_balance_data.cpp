#include "graybox/diagnosis/force_balance/force_balance_data.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "graybox/diagnosis/inverse_dynamics/base_parameters.hpp"
#include "graybox/diagnosis/inverse_dynamics/torque_columns.hpp"
#include "graybox/problems/error.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestSamples = 50;
// What is left of a column after projection on the others, below which these data can't tell it from
// them.
constexpr double kDependent = 1e-6;

void append(const MotionRecord& record, TorqueColumns& columns, ForceBalanceRows& rows) {
  for (const Motion& piece : record.pieces) {
    const Eigen::Index joints = piece.position.cols();
    const Eigen::Index first = rows.base.torque.size();
    const Eigen::Index count = piece.samples() * joints;
    rows.base.joints = joints;
    rows.base.torque.conservativeResize(first + count);
    rows.base.columns.conservativeResize(first + count, columns.size());
    for (Eigen::Index t = 0; t < piece.samples(); ++t) {
      columns.evaluate(piece.position.row(t).transpose(), piece.velocity.row(t).transpose(),
                       piece.acceleration.row(t).transpose());
      const Eigen::Index row = first + t * joints;
      rows.base.torque.segment(row, joints) = piece.torque.row(t).transpose() - columns.known();
      rows.base.columns.middleRows(row, joints) = columns.matrix();
    }
    rows.base.piece_samples.push_back(piece.samples());
    rows.pieces.push_back(piece);
    rows.names.push_back(record.name);
  }
}

Eigen::MatrixXd chosen_columns(const Eigen::MatrixXd& columns,
                               const std::vector<Eigen::Index>& chosen) {
  Eigen::MatrixXd result(columns.rows(), static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    result.col(static_cast<Eigen::Index>(k)) = columns.col(chosen[k]);
  }
  return result;
}

void keep_base_parameters(const TorqueColumns& columns, ForceBalanceData& data) {
  if (columns.size() == 0) return;
  const BaseParameters base =
      base_parameters(data.estimation.base.columns, columns.names(), kDependent);
  for (const Eigen::Index column : base.columns) {
    data.parameter_units.push_back(columns.units()[static_cast<std::size_t>(column)]);
  }
  data.parameter_names = base.names;
  data.estimation.base.columns = chosen_columns(data.estimation.base.columns, base.columns);
  data.validation.base.columns = chosen_columns(data.validation.base.columns, base.columns);
}

// ---- places ---------------------------------------------------------------------------------------

PlaceUnits units_of(const RobotJoint& joint) {
  return joint.is_prismatic ? PlaceUnits{"N", "m", "kg"} : PlaceUnits{"N m", "rad", "kg m^2"};
}

CandidatePlace place_along(std::string name, std::string yaml, const Eigen::VectorXd& direction,
                           const RobotJoint& joint) {
  CandidatePlace place;
  place.location.name = std::move(name);
  place.location.input = place.location.output = direction;
  place.location.units = units_of(joint);
  place.location.takes_inertia = true;
  place.yaml = std::move(yaml);
  place.turns = !joint.is_prismatic;
  return place;
}

bool couples_joints(const RigidRobotModel& robot, Eigen::Index motor) {
  return (robot.transmission.row(motor).array() != 0.0).count() > 1;
}

void add_joint_places(const RigidRobotModel& robot, std::vector<CandidatePlace>& places) {
  for (Eigen::Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    places.push_back(place_along(joint.name + ".arm",
                                 fmt::format("{{kind: element, joint: {}, axis: arm}}", joint.name),
                                 Eigen::VectorXd::Unit(robot.size(), j), joint));
    if (!couples_joints(robot, j)) continue;
    places.push_back(place_along(
        joint.name + ".motor", fmt::format("{{kind: element, joint: {}, axis: motor}}", joint.name),
        robot.transmission.row(j).transpose(), joint));
  }
}

void add_neighbours(const RigidRobotModel& robot, std::vector<CandidatePlace>& places) {
  for (Eigen::Index j = 0; j + 1 < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const RobotJoint& next = robot.joints[static_cast<std::size_t>(j + 1)];
    if (joint.is_prismatic != next.is_prismatic) continue;
    for (const double sign : {1.0, -1.0}) {
      Eigen::VectorXd direction = Eigen::VectorXd::Unit(robot.size(), j);
      direction(j + 1) = sign;
      places.push_back(
          place_along(fmt::format("{}{}{}", joint.name, sign > 0.0 ? "+" : "-", next.name),
                      fmt::format("{{kind: element, deflection: {{{}: 1, {}: {:g}}}}}", joint.name,
                                  next.name, sign),
                      direction, joint));
    }
  }
}

}  // namespace

ForceBalanceData load_force_balance_data(const std::filesystem::path& model,
                                         const Campaign& campaign) {
  ForceBalanceData data;
  data.robot = load_rigid_robot(model);
  TorqueColumns columns(data.robot);
  for (const MotionRecord& record : read_motion_records(data.robot, campaign)) {
    append(record, columns,
           record.role == ExperimentRole::kEstimation ? data.estimation : data.validation);
  }
  if (data.estimation.samples() < kFewestSamples) {
    throw InputError(fmt::format("{}: {} samples for estimation; a diagnosis needs {}",
                                 campaign.file.string(), data.estimation.samples(),
                                 kFewestSamples));
  }
  if (data.validation.empty()) {
    data.validation.base.columns.resize(0, columns.size());
    data.validation.base.torque.resize(0);
  }
  keep_base_parameters(columns, data);
  add_joint_places(data.robot, data.places);
  add_neighbours(data.robot, data.places);
  return data;
}

PlaceMotion motion_at(const CandidatePlace& place, const Motion& piece) {
  return {piece.time, piece.position * place.location.input, piece.velocity * place.location.input,
          piece.acceleration * place.location.input};
}

namespace {

// `scalar`: the force along b_out of one piece.
template <typename Scalar>
Eigen::VectorXd place_rows(const CandidatePlace& place, const ForceBalanceRows& rows,
                           Scalar scalar) {
  Eigen::VectorXd result(rows.base.torque.size());
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    const Eigen::VectorXd force = scalar(motion_at(place, piece));
    for (Eigen::Index t = 0; t < force.size(); ++t, row += rows.base.joints) {
      result.segment(row, rows.base.joints) = force(t) * place.location.output;
    }
  }
  return result;
}

}  // namespace

Eigen::VectorXd law_rows(const CandidatePlace& place, const Law& law,
                         const ForceBalanceRows& rows) {
  return place_rows(place, rows,
                    [&law](const PlaceMotion& motion) { return law_force(law, motion); });
}

Eigen::VectorXd inertia_rows(const CandidatePlace& place, const ForceBalanceRows& rows) {
  return place_rows(place, rows, [](const PlaceMotion& motion) { return motion.acceleration; });
}

}  // namespace graybox
