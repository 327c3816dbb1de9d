// SimulatedSystem: what `graybox simulate` experiments on, robot or lumped model, with all
// elements.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/simulation/plant.hpp"

namespace graybox {

struct SimulatedSystem {
  struct Signal {
    std::string name;
    std::string unit;
  };
  // Lumped models have no positions and one kind of plant.
  enum class PlantKind : std::int8_t { kLocal, kRobot, kLumped };

  std::vector<std::filesystem::path> files;     // model first, then what it is made of
  std::optional<std::filesystem::path> hidden;  // the graybox-physics/1 file
  double sample_time = 0.0;
  std::vector<Signal> references;  // empty: open loop, the excitation is the input
  std::vector<Signal> inputs, outputs;
  std::optional<PiController> controller;  // where there are references
  Eigen::VectorXd white_noise;             // standard deviation of each output; empty: none
  std::size_t joints = 0;                  // of a position; 0: a lumped model
  std::vector<double> frequencies;         // Hz, of the model's own excitation; may be empty
  double velocity_psd_slope = 0.0;         // C_v of the model
  // At joint angles in rad (empty for a lumped model).
  std::function<std::unique_ptr<Plant>(PlantKind, const Eigen::VectorXd&)> plant;
};

// A graybox-robot/1 or graybox-lumped/1 file with its elements and those of a graybox-physics/1
// file. Throws InputError of one line for whatever is wrong.
[[nodiscard]] SimulatedSystem load_system(const std::filesystem::path& model,
                                          const std::optional<std::filesystem::path>& physics = {});

}  // namespace graybox
