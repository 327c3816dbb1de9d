#include "diagnosis/design_page/robot_poses.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <string>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;
constexpr double kSamePlace = 1e-6;  // m

void add_point(const Eigen::Vector3d& point, std::vector<ScenePoint>& points) {
  points.push_back({point.x(), point.y(), point.z()});
}

}  // namespace

std::vector<ScenePoint> robot_pose(const RobotModel& robot, std::span<const double> degrees) {
  const auto& rotations = robot.chain.rotations();
  const std::vector<Eigen::Index> gearboxes = robot.gearbox_rotations();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  std::vector<ScenePoint> points{{0.0, 0.0, 0.0}};
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (std::size_t a = 0; a < rotations.size(); ++a) {
    frame = frame * rotations[a].origin;
    if ((frame.translation() - last).norm() > kSamePlace) {
      last = frame.translation();
      add_point(last, points);
    }
    const auto joint = std::ranges::find(gearboxes, static_cast<Eigen::Index>(a));
    if (joint == gearboxes.end()) continue;
    const double angle =
        kRadiansPerDegree * degrees[static_cast<std::size_t>(joint - gearboxes.begin())];
    frame.rotate(Eigen::AngleAxisd(angle, rotations[a].axis.normalized()));
  }
  const Eigen::Vector3d tip = frame * rotations.back().body.centre_of_mass;
  if ((tip - last).norm() > kSamePlace) add_point(tip, points);
  return points;
}

void require_joint_angles(const InformationSet& set, const RobotModel& robot) {
  const CandidateTable& table = set.candidates();
  const bool in_degrees =
      std::ranges::all_of(table.units, [](const std::string& unit) { return unit == "deg"; });
  if (table.names.size() == robot.joint_names.size() && !table.units.empty() && in_degrees) return;
  throw InputError(
      fmt::format("{}: has {} coordinates a candidate, {} has {} joints; poses are drawn where "
                  "every coordinate is a joint's angle in deg: leave out --model",
                  set.name(), table.names.size(), robot.name, robot.joint_names.size()));
}

std::size_t count_beyond_limits(const RobotModel& robot, std::span<const double> degrees) {
  const auto& rotations = robot.chain.rotations();
  const std::vector<Eigen::Index> gearboxes = robot.gearbox_rotations();
  std::size_t beyond = 0;
  for (std::size_t k = 0; k < gearboxes.size(); ++k) {
    const ChainRotation& rotation = rotations[static_cast<std::size_t>(gearboxes[k])];
    const double angle = kRadiansPerDegree * degrees[k];
    beyond += angle < rotation.lower - 1e-9 || angle > rotation.upper + 1e-9 ? 1U : 0U;
  }
  return beyond;
}

}  // namespace graybox
