#include "cli/arguments/robot_arguments.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/robot_elements.hpp"

namespace graybox::cli {
namespace {

constexpr double kMostPositions = 1e9;
constexpr std::size_t kPositionBytes = 200;  // angles of the full grid and of the one taken from it

}  // namespace

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

namespace {

// 4000 and 4e3 are numbers; what is no number is a file.
std::optional<std::size_t> grid_count(const std::string& grid) {
  double count = 0.0;
  const char* end = grid.data() + grid.size();
  const auto [rest, error] = std::from_chars(grid.data(), end, count);
  const bool too_large = error == std::errc::result_out_of_range;
  if ((error != std::errc() && !too_large) || rest != end) return std::nullopt;
  if (too_large || !(count >= 1.0) || count != std::floor(count) || count > kMostPositions) {
    throw InputError(fmt::format(
        "--grid {}: must be paper, a file, or a whole number of positions from 1 to {:.0f}", grid,
        kMostPositions));
  }
  const auto positions = static_cast<std::size_t>(count);
  require_memory(positions * kPositionBytes, fmt::format("--grid {}: a grid so fine", grid),
                 "choose a smaller --grid");
  return positions;
}

}  // namespace

PositionTable load_positions(const RobotArguments& arguments, const RobotModel& robot) {
  const std::string& grid = arguments.grid;
  if (grid == "paper") return paper_grid();
  if (const std::optional<std::size_t> count = grid_count(grid)) return robot_grid(*count);
  return read_positions(grid, robot.joint_names.size());
}

}  // namespace graybox::cli
