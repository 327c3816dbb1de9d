#include "problems/robot_information/robot_space.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
// URDF files give limits in radians with a few digits: 90 degrees may be written as 1.5708.
constexpr double kLimitTolerance = 0.01;  // degrees

class RobotEvaluator : public InformationEvaluator {
 public:
  RobotEvaluator(const RobotModel& robot, const RobotInformationOptions& options)
      : evaluator_(robot, options), angles_(robot.motor_count()) {}

  void information(std::span<const double> point, std::span<double> packed) override {
    for (std::size_t j = 0; j < point.size(); ++j) {
      angles_(static_cast<Eigen::Index>(j)) = kDegree * point[j];
    }
    evaluator_.compute(angles_, packed);
  }

 private:
  RobotInformationEvaluator evaluator_;
  Eigen::VectorXd angles_;
};

}  // namespace

std::vector<JointRange> urdf_ranges(const RobotModel& robot) {
  std::vector<JointRange> ranges;
  for (const Eigen::Index rotation : robot.gearbox_rotations()) {
    const ChainRotation& joint = robot.chain.rotations()[static_cast<std::size_t>(rotation)];
    ranges.push_back({joint.lower / kDegree, joint.upper / kDegree});
  }
  return ranges;
}

RobotSpace::RobotSpace(const RobotModel& robot, const std::vector<JointRange>& ranges,
                       const RobotInformationOptions& options)
    : robot_(robot), options_(options) {
  if (ranges.size() != robot.joint_names.size()) {
    throw InputError(fmt::format("joint limits: {} ranges for the {} joints of {}", ranges.size(),
                                 robot.joint_names.size(), robot.name));
  }
  const std::vector<JointRange> limits = urdf_ranges(robot);
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    const JointRange& range = ranges[j];
    if (!std::isfinite(range.from) || !std::isfinite(range.to) || range.from > range.to) {
      throw InputError(
          fmt::format("joint limits: q{}: {} to {} degrees is no range; give finite limits, the "
                      "lower first",
                      j + 1, range.from, range.to));
    }
    if (range.from < limits[j].from - kLimitTolerance ||
        range.to > limits[j].to + kLimitTolerance) {
      throw InputError(fmt::format(
          "joint limits: q{}: {} to {} degrees goes beyond the limits of the URDF, {:.4g} to "
          "{:.4g}",
          j + 1, range.from, range.to, limits[j].from, limits[j].to));
    }
    lower_.push_back(range.from);
    upper_.push_back(range.to);
  }
}

std::unique_ptr<InformationEvaluator> RobotSpace::evaluator() const {
  return std::make_unique<RobotEvaluator>(robot_, options_);
}

PositionTable RobotSpace::inside(const PositionTable& positions) const {
  PositionTable result{positions.joint_count, {}};
  for (std::size_t i = 0; i < positions.count(); ++i) {
    const auto position = positions.position(i);
    bool within = position.size() == lower_.size();
    for (std::size_t j = 0; within && j < position.size(); ++j) {
      within = position[j] >= lower_[j] && position[j] <= upper_[j];
    }
    if (within) result.degrees.insert(result.degrees.end(), position.begin(), position.end());
  }
  if (result.degrees.empty()) {
    throw InputError("joint limits: no position of the grid lies inside them");
  }
  return result;
}

}  // namespace graybox
