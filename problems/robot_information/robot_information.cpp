#include "problems/robot_information/robot_information.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/information_kernels.hpp"
#include "problems/robot_information/robot_information_moving.hpp"
#include "problems/robot_information/robot_position_tables.hpp"

namespace graybox {
namespace {

// Computes one position after another; one a thread.
class PositionWorker {
 public:
  PositionWorker(const RobotModel& robot, const PositionFreeTables& shared,
                 const RobotInformationOptions& options)
      : shared_(shared),
        tables_(shared.tables()),
        arm_(robot, shared, options.gravity_deflection),
        scale_(options.scale),
        sums_(packed_size(robot.springs.size())),
        workspace_(information_workspace_size(tables_.bearings, tables_.motors)) {}

  // Writes H, packed. `joint_angles` in rad.
  void compute(const Eigen::VectorXd& joint_angles, double* information) {
    arm_.linearise(joint_angles);
    information_kernel().information(tables_, arm_.mass(), arm_.gravity(), workspace_.data(),
                                     sums_.data());
    shared_.pick_parameters(sums_.data(), scale_, information);
  }

 private:
  const PositionFreeTables& shared_;
  InformationTables tables_;
  PackedArm arm_;
  double scale_;
  AlignedArray sums_, workspace_;
};

void check(const RobotModel& robot, const PositionTable& positions,
           const RobotInformationOptions& options) {
  check_positions(robot, positions);
  if (!(options.scale > 0.0) || !std::isfinite(options.scale)) {
    throw InputError(fmt::format("scale: must be positive, is {}", options.scale));
  }
  if (options.total_derivative && !options.gravity_deflection) {
    throw InputError("total_derivative: needs gravity_deflection, without it no point moves");
  }
  if (options.threads < 1) {
    throw InputError(fmt::format("threads: must be at least 1, is {}", options.threads));
  }
}

}  // namespace

InformationSet robot_information_set(const RobotModel& robot, const PositionTable& positions,
                                     const RobotInformationOptions& options) {
  check(robot, positions, options);
  const std::size_t d = robot.parameters.size(), stride = packed_size(d);
  AlignedArray information(positions.count() * stride);
  if (options.total_derivative) {
    for_each_position(
        positions, stride, options.threads, [&] { return MovingPointWorker(robot, options.scale); },
        information.data());
  } else {
    const PositionFreeTables shared(robot);
    for_each_position(
        positions, stride, options.threads, [&] { return PositionWorker(robot, shared, options); },
        information.data());
  }
  return InformationSet(d, std::move(information), position_columns(positions),
                        robot.parameter_names(), robot.name);
}

Eigen::MatrixXd robot_information_matrix(const RobotModel& robot,
                                         const Eigen::VectorXd& joint_angles,
                                         const RobotInformationOptions& options) {
  PositionTable position{static_cast<std::size_t>(joint_angles.size()), {}};
  for (const double angle : joint_angles) {
    position.degrees.push_back(angle * (180.0 / std::numbers::pi));
  }
  const InformationSet set = robot_information_set(robot, position, options);
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd matrix(d, d);
  unpack(set.data(), set.dimension(), matrix.data());
  return matrix;
}

struct RobotInformationEvaluator::Workspace {
  Workspace(const RobotModel& robot, const RobotInformationOptions& options)
      : shared(robot), worker(robot, shared, options) {}
  PositionFreeTables shared;
  PositionWorker worker;
};

RobotInformationEvaluator::RobotInformationEvaluator(const RobotModel& robot,
                                                     const RobotInformationOptions& options) {
  if (options.total_derivative) {
    throw InputError("total_derivative: not supported for positions one by one");
  }
  workspace_ = std::make_unique<Workspace>(robot, options);
}

RobotInformationEvaluator::~RobotInformationEvaluator() = default;

void RobotInformationEvaluator::compute(const Eigen::VectorXd& joint_angles,
                                        std::span<double> information) {
  workspace_->worker.compute(joint_angles, information.data());
}

}  // namespace graybox
