#include "problems/robot_information/robot_spectrum_information.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/information_kernels.hpp"
#include "problems/robot_information/robot_position_tables.hpp"

namespace graybox {
namespace {

// The matrices of all lines of one position after another; one a thread.
class LineWorker {
 public:
  LineWorker(const RobotModel& robot, const PositionFreeTables& shared, bool gravity_deflection)
      : shared_(shared),
        tables_(shared.tables()),
        arm_(robot, shared, gravity_deflection),
        lines_(line_count(robot)),
        line_size_(packed_size(robot.springs.size())),
        stride_(packed_size(robot.parameters.size())),
        scale_(flat_power(robot) * static_cast<double>(robot.motor_count()) / robot.reference_psd),
        sums_(tables_.frequencies * tables_.motors * line_size_),
        workspace_(information_workspace_size(tables_.bearings, tables_.motors)) {}

  // Writes P H_{w,a} for the flat spectrum's power P, all lines one after the other. (The kernel
  // computes for rho = Phi_r / n_y.) `joint_angles` in rad.
  void compute(const Eigen::VectorXd& joint_angles, double* information) {
    arm_.linearise(joint_angles);
    information_kernel().lines(tables_, arm_.mass(), arm_.gravity(), workspace_.data(),
                               sums_.data());
    for (std::size_t line = 0; line < lines_; ++line) {
      shared_.pick_parameters(sums_.data() + line * line_size_, scale_,
                              information + line * stride_);
    }
    if (!std::all_of(information, information + lines_ * stride_,
                     [](double value) { return std::isfinite(value); })) {
      throw InputError(
          "robot: the information of a position is not finite; a resonance without damping lies on "
          "one of the frequencies");
    }
  }

 private:
  const PositionFreeTables& shared_;
  InformationTables tables_;
  PackedArm arm_;
  std::size_t lines_, line_size_, stride_;
  double scale_;
  AlignedArray sums_, workspace_;
};

void check(const RobotModel& robot, const PositionTable& positions,
           const RobotSpectrumOptions& options) {
  check_positions(robot, positions);
  if (options.threads < 1) {
    throw InputError(fmt::format("threads: must be at least 1, is {}", options.threads));
  }
  if (!options.power.empty() && options.power.size() != positions.count()) {
    throw InputError(
        fmt::format("power: {} numbers for {} positions", options.power.size(), positions.count()));
  }
  for (const double power : options.power) {
    if (!(power > 0.0) || !std::isfinite(power)) {
      throw InputError(fmt::format("power: must be positive and finite, is {}", power));
    }
  }
}

// From the flat spectrum's power to P_i.
void scale_to_power(const RobotModel& robot, const std::vector<double>& power, std::size_t block,
                    AlignedArray& information) {
  for (std::size_t i = 0; i < power.size(); ++i) {
    const double factor = power[i] / flat_power(robot);
    for (double& value : information.span().subspan(i * block, block)) value *= factor;
  }
}

CandidateTable line_columns(const RobotModel& robot, const PositionTable& positions) {
  CandidateTable table = position_columns(positions);
  table.names.insert(table.names.end(), {"frequency", "axis"});
  table.units.insert(table.units.end(), {"Hz", ""});
  table.values.clear();
  table.values.reserve(positions.count() * line_count(robot) * table.names.size());
  for (std::size_t i = 0; i < positions.count(); ++i) {
    const auto angles = positions.position(i);
    for (const double w : robot.frequencies) {
      for (Eigen::Index axis = 0; axis < robot.motor_count(); ++axis) {
        table.values.insert(table.values.end(), angles.begin(), angles.end());
        table.values.push_back(w / (2.0 * std::numbers::pi));
        table.values.push_back(static_cast<double>(axis + 1));
      }
    }
  }
  return table;
}

}  // namespace

std::size_t line_count(const RobotModel& robot) {
  return robot.frequencies.size() * static_cast<std::size_t>(robot.motor_count());
}

double flat_power(const RobotModel& robot) {
  return static_cast<double>(robot.frequencies.size()) * robot.reference_psd;
}

std::size_t robot_spectrum_bytes(const RobotModel& robot, std::size_t positions) {
  const std::size_t numbers =
      packed_size(robot.parameters.size()) + static_cast<std::size_t>(robot.motor_count()) + 2;
  return positions * line_count(robot) * numbers * sizeof(double);
}

InformationSet robot_spectrum_set(const RobotModel& robot, const PositionTable& positions,
                                  const RobotSpectrumOptions& options) {
  check(robot, positions, options);
  const std::size_t d = robot.parameters.size();
  const std::size_t block = line_count(robot) * packed_size(d);
  AlignedArray information(positions.count() * block);
  const PositionFreeTables shared(robot);
  for_each_position(
      positions, block, options.threads,
      [&] { return LineWorker(robot, shared, options.gravity_deflection); }, information.data());
  scale_to_power(robot, options.power, block, information);
  return InformationSet(d, std::move(information), line_columns(robot, positions),
                        robot.parameter_names(), robot.name + " spectrum");
}

}  // namespace graybox
