// The options by which commands take a robot and its candidate positions.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox::cli {

struct RobotArguments {
  std::string model;           // empty: the robot that comes with graybox
  std::string grid = "paper";  // "paper", a number of positions, or a file
};

void add_model_option(CLI::App& command, RobotArguments& arguments);   // --model
void add_robot_options(CLI::App& command, RobotArguments& arguments);  // --model and --grid

// Both throw InputError for files that are missing or wrong.
[[nodiscard]] RobotModel load_robot(const RobotArguments& arguments);
[[nodiscard]] PositionTable load_positions(const RobotArguments& arguments,
                                           const RobotModel& robot);

}  // namespace graybox::cli
