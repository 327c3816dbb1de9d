#include "robot_arguments.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "graybox/problems/elements/robot_elements.hpp"

namespace graybox::cli {

void add_model_option(CLI::App& command, RobotArguments& arguments) {
  command.add_option("--model", arguments.model,
                     "graybox-robot/1 file (YAML; default: the IRB 6600-like robot of graybox)");
}

void add_robot_options(CLI::App& command, RobotArguments& arguments) {
  add_model_option(command, arguments);
  command
      .add_option("--grid", arguments.grid,
                  "paper (7920 positions), a number of positions, or a CSV file of joint "
                  "angles in degrees")
      ->capture_default_str();
}

RobotModel load_robot(const RobotArguments& arguments) {
  const std::filesystem::path file =
      arguments.model.empty() ? default_robot_file() : std::filesystem::path(arguments.model);
  LinearRobot linear = load_linear_robot(file);
  if (!linear.left_out.empty()) {
    fmt::print(
        stderr,
        "graybox: warning: {}: a linear model of the robot leaves out {}; it describes motions in "
        "which that is only a disturbance\n",
        file.string(), fmt::join(linear.left_out, ", "));
  }
  return std::move(linear.robot);
}

PositionTable load_positions(const RobotArguments& arguments, const RobotModel& robot) {
  const std::string& grid = arguments.grid;
  if (grid == "paper") return paper_grid();
  std::size_t count = 0;
  const char* end = grid.data() + grid.size();
  const auto [rest, error] = std::from_chars(grid.data(), end, count);
  if (error == std::errc() && rest == end) return robot_grid(count);
  return read_positions(grid, robot.joint_names.size());
}

}  // namespace graybox::cli
