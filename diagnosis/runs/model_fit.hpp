// `graybox fit` by the format of the model file: each format has one function (fit_<format>.cpp)
// that reads model and campaign and fits; fit_command.cpp chooses, prints and writes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"

namespace graybox::cli {

struct FitArguments {
  std::string model;
  std::string campaign;
  std::string output;
  std::string written_model;
  int threads = 1;
  std::uint64_t seed = 1;
  int starts = 8;  // of the search, at most
  bool all_starts = false;
  bool json = false;
  std::string lines = "none";          // or local, full; flexible robots
  std::vector<std::string> physics;    // files with further elements; rigid robots, lumped models
  int decimation = 1;                  // of columns and torques alike; rigid robots
  bool equal_noise = false;            // in all joints; rigid robots
  std::vector<std::string> refine;     // "element.parameter" to estimate, too; rigid robots
  std::string initial_state = "free";  // or measured, rest; lumped models
};

// All throw InputError for files that are missing, wrong or do not belong together. After Ctrl-C
// (interrupt.hpp) they hand back the best so far.
[[nodiscard]] FitReport fit_robot(const FitArguments& arguments);
[[nodiscard]] FitReport fit_rigid_robot(const FitArguments& arguments);
[[nodiscard]] FitReport fit_lumped(const FitArguments& arguments);

}  // namespace graybox::cli
