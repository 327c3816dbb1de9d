// Figure 5 of the paper: where the robot stands in the positions of a design.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "solvers/core/design.hpp"

namespace graybox::bench {

struct PosePoint {
  std::string name;  // "base", a joint's name, or "payload": the centre of mass of the last body
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // m, in the base frame
};

struct RobotPose {
  std::size_t candidate = 0;
  double weight = 0.0;
  std::vector<PosePoint> points;  // from the base outwards
};

// The arm at commanded joint angles (rad), without its static deflection, which is far below a
// line's width. Throws InputError for a wrong number of joints.
[[nodiscard]] std::vector<PosePoint> robot_pose(const RobotModel& robot,
                                                const Eigen::VectorXd& joint_angles);

// One pose for each candidate of positive weight; the coordinates of the candidates are joint
// angles in degrees. Throws InputError if the set's coordinates are not the robot's joints.
[[nodiscard]] std::vector<RobotPose> robot_poses(const RobotModel& robot, const InformationSet& set,
                                                 const Design& design);

// One line a point: pose (1, 2, ...), candidate, weight, point, x_m, y_m, z_m.
[[nodiscard]] std::string to_csv(const std::vector<RobotPose>& poses);

}  // namespace graybox::bench
