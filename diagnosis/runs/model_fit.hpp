// A fit of a model file to a campaign file, by the format of the model: what `graybox fit` does.
// Each format has one function (fit_<format>.cpp) that reads model and campaign and fits.
//
//   const FitReport report = fit_model({.model = "motor.yaml", .campaign = "campaign/"});
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"

namespace graybox {

struct ModelFitRequest {
  std::string model;
  std::string campaign;
  std::string written_model = {};  // where the caller will write the fitted model; empty: nowhere
  int threads = 1;
  std::uint64_t seed = 1;
  int starts = 8;  // of the search, at most
  bool all_starts = false;
  std::string lines = "none";             // or local, full; flexible robots
  std::vector<std::string> physics = {};  // files with further elements; rigid robots, lumped
                                          // models
  int decimation = 1;                     // of columns and torques alike; rigid robots
  bool equal_noise = false;               // in all joints; rigid robots
  std::vector<std::string> refine = {};   // "element.parameter" to estimate, too; rigid robots
  std::string initial_state = "free";     // or measured, rest; lumped models
  // Recordings done, of all; flexible robots.
  std::function<void(std::size_t, std::size_t)> report = {};
};

// Throws InputError for options that the model's format does not have.
void require_fit_options(const ModelFitRequest& request);

// Whether models of this format can be simulated: lumped models and rigid robots.
[[nodiscard]] bool is_simulated(const ModelFitRequest& request);

// With the gate of physical sanity (judge_plausibility()). Throws InputError for files that are
// missing, wrong or do not belong together, and as above. Once the user has asked to stop
// (stop.hpp) it hands back the best so far.
[[nodiscard]] FitReport fit_model(const ModelFitRequest& request);

// The text of the model with the fitted values, for request.written_model.
[[nodiscard]] std::string fitted_model_text(const ModelFitRequest& request,
                                            const FitReport& report);

// By format.
[[nodiscard]] FitReport fit_robot(const ModelFitRequest& request);
[[nodiscard]] FitReport fit_rigid_robot(const ModelFitRequest& request);
[[nodiscard]] FitReport fit_lumped(const ModelFitRequest& request);

}  // namespace graybox
