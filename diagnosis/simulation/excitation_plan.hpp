// ExcitationPlan: which experiments to make. Read from a graybox-plan/1 file:
//
//   format: graybox-plan/1
//   plant: local                     # local models | robot: the non-linear one
//   positions: [[0, 30, -60, 0, 45, 0], ...]     # commanded joint angles, degrees
//   levels: [0.5, 3.0]               # rms of each reference, rad/s, motor side
//   realisations: 2                  # of the random phases; default 1
//   validation_realisations: 1       # the last so many are for validation; default 0
//   period: 8000                     # samples
//   settling_periods: 6              # simulated before the recording; default 4
//   periods: 2                       # recorded; default 2
//   frequencies: {from: 1, to: 60, count: 50, spacing: log}    # Hz; default: the model's
//   detection_lines: 4               # of so many odd lines one is left unexcited; default 0: none
//   phase_draws: 20                  # the least crest factor of so many random phases; default 1
//   crest_limit: 4.0                 # the first draw within it is taken instead; default: no limit
//   noise: 0.0827                    # C_v, rad^2 (closed_loop.hpp); default: the model's; 0: none
//   data: h5                         # h5 | csv: the files of the recordings; default h5
//
// Each position, level and realisation takes n_u sub-experiments (multisine.hpp). The plan of a
// lumped model has no plant, positions and noise (its model has that), and levels in the unit of
// what is excited, reference or input.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/simulation/simulated_system.hpp"

namespace graybox {

struct ExcitationPlan {
  enum class DataFormat : std::int8_t { kHdf5, kCsv };

  SimulatedSystem::PlantKind plant = SimulatedSystem::PlantKind::kLocal;
  std::vector<Eigen::VectorXd> positions;  // degrees; one of size 0 for a lumped model
  std::vector<double> levels;              // rms
  std::size_t realisations = 1;
  std::size_t validation_realisations = 0;
  std::size_t period = 0;
  std::size_t settling_periods = 4;
  std::size_t periods = 2;
  std::vector<std::size_t> lines;  // odd DFT lines
  std::size_t phase_draws = 1;
  double crest_limit = 0.0;  // 0: none
  double noise_psd_slope = 0.0;
  DataFormat data = DataFormat::kHdf5;
};

// One recording of the plan; all count from zero.
struct PlannedExperiment {
  std::size_t position = 0;
  std::size_t level = 0;
  std::size_t realisation = 0;
  Eigen::Index sub_experiment = 0;

  [[nodiscard]] std::string name() const;  // "p1_l1_r1_e1", counting from one
};

// Throws InputError of one line for whatever is wrong with the file or does not fit the system.
[[nodiscard]] ExcitationPlan read_plan(const std::filesystem::path& file,
                                       const SimulatedSystem& system);

// All experiments, sub-experiments running fastest.
[[nodiscard]] std::vector<PlannedExperiment> planned_experiments(const ExcitationPlan& plan,
                                                                 Eigen::Index inputs);

}  // namespace graybox
