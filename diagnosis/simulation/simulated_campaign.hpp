// Carries out a plan by simulation and writes a campaign folder (graybox-campaign/1): campaign.yaml
// and one file a recording, with references, inputs and outputs as channels: for a robot r_1, u_1,
// y_1, ... (reference rad/s, motor torque N m from the holding torque, motor velocity rad/s).
//
// Resumes: each recording appears complete or not at all, and one that is there is not simulated
// again. Phases and noise depend on the seed and on the place in the plan alone, so that neither
// the number of threads nor an interruption changes a byte. The file `simulation.json` in the
// folder says which model, plan and seed the recordings are of. A folder of other ones is refused.
// One run at a time in a folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "diagnosis/simulation/excitation_plan.hpp"
#include "diagnosis/simulation/simulated_system.hpp"

namespace graybox {

struct SimulationOptions {
  std::uint64_t seed = 1;
  int threads = 1;
  std::string identity;  // of the model's and plan's contents; compared with what the folder holds
  std::function<bool()> keep_going;                      // asked often, from any thread
  std::function<void(std::size_t, std::size_t)> report;  // recordings done, of all; one at a time
  std::function<void(double)> forecast;  // s that all will take; told once, where they are many
};

struct SimulationOutcome {
  std::size_t recordings = 0;
  std::size_t already_there = 0;
  bool complete = false;  // false: asked to stop
};

// Throws InputError, before anything is written, in four cases. The folder can't be made or holds
// other recordings. The work would take more than a month. A position has no rest. No phases keep
// the crest limit. Throws UnstableMotion (plant.hpp) with the recording's name.
SimulationOutcome simulate_campaign(const SimulatedSystem& system, const ExcitationPlan& plan,
                                    const std::filesystem::path& folder,
                                    const SimulationOptions& options);

}  // namespace graybox
