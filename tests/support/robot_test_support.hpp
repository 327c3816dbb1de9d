// The robot of the paper and a few positions, for the tests of the robot.
#pragma once

#include <Eigen/Core>
#include <numbers>
#include <vector>

#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox::robot_test {

inline std::filesystem::path robot_folder() {
  return std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems" / "robot";
}

inline RobotModel paper_robot() { return load_robot_model(robot_folder() / "irb6600_like.yaml"); }

inline Eigen::VectorXd radians(std::initializer_list<double> degrees) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(degrees.size()));
  Eigen::Index i = 0;
  for (const double angle : degrees) result(i++) = angle * std::numbers::pi / 180.0;
  return result;
}

// Positions with the arm stretched out, folded, upright and twisted.
inline std::vector<Eigen::VectorXd> some_positions() {
  return {radians({0, 0, 0, 0, 0, 0}), radians({45, 15, -150, 0, -90, 0}),
          radians({0, 60, -90, 90, 0, 0}), radians({90, -60, 45, 45, 45, 0}),
          radians({12, 33, -71, 23, 57, -40})};
}

inline PositionTable to_table(const std::vector<Eigen::VectorXd>& positions) {
  PositionTable table{static_cast<std::size_t>(positions.front().size()), {}};
  for (const Eigen::VectorXd& position : positions) {
    for (const double angle : position) {
      table.degrees.push_back(angle * 180.0 / std::numbers::pi);
    }
  }
  return table;
}

}  // namespace graybox::robot_test
