#include "diagnosis/simulation/simulated_system.hpp"

#include <fmt/format.h>

#include <numbers>

#include "problems/files/environment_text.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using Signal = SimulatedSystem::Signal;

std::vector<Signal> numbered(const char* letter, const char* unit, Eigen::Index count) {
  std::vector<Signal> signals;
  for (Eigen::Index i = 1; i <= count; ++i) {
    signals.push_back({fmt::format("{}_{}", letter, i), unit});
  }
  return signals;
}

SimulatedSystem robot_system(const fs::path& file, const std::optional<fs::path>& physics) {
  const auto extended = std::make_shared<const ExtendedRobot>(load_extended_robot(file, physics));
  const RobotModel& robot = extended->robot;
  SimulatedSystem system;
  system.files = {file, file.parent_path() / with_environment(YamlField::load(file).at("urdf"))};
  system.sample_time = robot.sample_time;
  system.references = numbered("r", "rad/s", robot.motor_count());
  system.inputs = numbered("u", "N m", robot.motor_count());
  system.outputs = numbered("y", "rad/s", robot.motor_count());
  system.controller = robot.controller;
  system.joints = robot.joint_names.size();
  for (const double w : robot.frequencies) {
    system.frequencies.push_back(w / (2.0 * std::numbers::pi));
  }
  system.velocity_psd_slope = robot.velocity_psd_slope;
  system.plant = [extended](SimulatedSystem::PlantKind kind, const Eigen::VectorXd& angles) {
    return kind == SimulatedSystem::PlantKind::kRobot
               ? robot_plant(extended->robot, extended->elements, angles)
               : local_robot_plant(extended->robot, extended->elements, angles);
  };
  return system;
}

std::vector<Signal> named(const std::vector<std::string>& names,
                          const std::vector<std::string>& units, const std::string& prefix = {}) {
  std::vector<Signal> signals;
  for (std::size_t k = 0; k < names.size(); ++k) signals.push_back({prefix + names[k], units[k]});
  return signals;
}

SimulatedSystem lumped_system(const fs::path& file, const std::optional<fs::path>& physics) {
  const auto model = std::make_shared<const LumpedModel>(load_lumped_model(file, physics));
  SimulatedSystem system;
  system.files = {file};
  system.sample_time = model->sample_time;
  system.inputs = named(model->input_names, model->input_units);
  system.outputs = named(model->output_names, model->output_units);
  system.controller = model->controller;
  if (model->controller) {
    system.references = named(model->output_names, model->output_units, "reference_");
  }
  system.white_noise = model->noise;
  system.plant = [model](SimulatedSystem::PlantKind, const Eigen::VectorXd&) {
    return lumped_plant(*model);
  };
  return system;
}

}  // namespace

SimulatedSystem load_system(const fs::path& model, const std::optional<fs::path>& physics) {
  const std::string format =
      YamlField::load(model).at("format").choice({"graybox-robot/1", "graybox-lumped/1"});
  SimulatedSystem system =
      format == "graybox-robot/1" ? robot_system(model, physics) : lumped_system(model, physics);
  if (physics) system.files.push_back(*physics);
  system.hidden = physics;
  return system;
}

}  // namespace graybox
