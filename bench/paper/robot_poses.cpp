#include "bench/paper/robot_poses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "problems/base/error.hpp"
#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox::bench {

std::vector<PosePoint> robot_pose(const RobotModel& robot, const Eigen::VectorXd& joint_angles) {
  const std::vector<Eigen::Index> gearboxes = robot.gearbox_rotations();
  if (joint_angles.size() != static_cast<Eigen::Index>(gearboxes.size())) {
    throw InputError(fmt::format("{}: {} joint angles given for {} joints", robot.name,
                                 joint_angles.size(), gearboxes.size()));
  }
  Eigen::VectorXd rotations = Eigen::VectorXd::Zero(robot.arm_size());
  for (std::size_t j = 0; j < gearboxes.size(); ++j) {
    rotations(gearboxes[j]) = joint_angles(static_cast<Eigen::Index>(j));
  }
  RigidChainEvaluator evaluator(robot.chain);
  const BodyPlaces places = evaluator.body_places(rotations);
  std::vector<PosePoint> points{{"base", Eigen::Vector3d::Zero()}};
  for (std::size_t j = 0; j < gearboxes.size(); ++j) {
    points.push_back(
        {robot.joint_names[j], places.origins[static_cast<std::size_t>(gearboxes[j])]});
  }
  points.push_back({"payload", places.centres_of_mass.back()});
  return points;
}

std::vector<RobotPose> robot_poses(const RobotModel& robot, const InformationSet& set,
                                   const Design& design) {
  if (set.candidates().names.size() != robot.joint_names.size()) {
    throw InputError(fmt::format("{}: its candidates have {} coordinates, but {} has {} joints",
                                 set.name(), set.candidates().names.size(), robot.name,
                                 robot.joint_names.size()));
  }
  if (std::ranges::any_of(set.candidates().units, [](const auto& unit) { return unit != "deg"; })) {
    throw InputError(fmt::format(
        "{}: its candidates' coordinates must be joint angles in deg, as graybox problem robot "
        "writes them",
        set.name()));
  }
  std::vector<RobotPose> poses;
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (!(design.weights[i] > 0.0)) continue;
    const auto degrees = set.coordinates(i);
    const Eigen::VectorXd angles = Eigen::Map<const Eigen::VectorXd>(
                                       degrees.data(), static_cast<Eigen::Index>(degrees.size())) *
                                   (std::numbers::pi / 180.0);
    poses.push_back({i, design.weights[i], robot_pose(robot, angles)});
  }
  return poses;
}

std::string to_csv(const std::vector<RobotPose>& poses) {
  std::string text = "pose,candidate,weight,point,x_m,y_m,z_m\n";
  for (std::size_t k = 0; k < poses.size(); ++k) {
    for (const PosePoint& point : poses[k].points) {
      text += fmt::format("{},{},{:.17g},{},{:.6f},{:.6f},{:.6f}\n", k + 1, poses[k].candidate,
                          poses[k].weight, point.name, point.place.x(), point.place.y(),
                          point.place.z());
    }
  }
  return text;
}

}  // namespace graybox::bench
