// The options by which commands take samples of the stiffness of a robot.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>

#include "problems/robot_information/stiffness_samples.hpp"

namespace graybox::cli {

struct StiffnessArguments {
  StiffnessUncertainty options;
  std::size_t samples = 50;
};

void add_stiffness_options(CLI::App& command, StiffnessArguments& arguments);

}  // namespace graybox::cli
