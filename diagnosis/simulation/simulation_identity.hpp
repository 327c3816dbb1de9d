// What a simulation is of: simulations are told apart by the bytes of their files.
#pragma once

#include <filesystem>
#include <string>

#include "diagnosis/simulation/simulated_system.hpp"

namespace graybox {

// SHA-256 of the system's files and the plan's.
[[nodiscard]] std::string simulation_identity(const SimulatedSystem& system,
                                              const std::filesystem::path& plan);

}  // namespace graybox
