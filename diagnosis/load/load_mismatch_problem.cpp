#include "diagnosis/load/load_mismatch_problem.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {

std::unique_ptr<MismatchProblem> load_mismatch_problem(const std::filesystem::path& model,
                                                       const Campaign& campaign,
                                                       const MismatchProblemOptions& options) {
  const std::string format = YamlField::load(model).at("format").choice(
      {"graybox-robot/1", "graybox-lumped/1", "graybox-rigid-robot/1"});
  if (format == "graybox-rigid-robot/1") {
    return force_balance_problem(model, campaign,
                                 {.threads = options.threads,
                                  .keep_going = options.keep_going,
                                  .place_files = options.place_files,
                                  .without_rotors = options.without_rotors});
  }
  const auto is_periodic = [](const Experiment& experiment) {
    return experiment.excitation.has_value();
  };
  if (!std::all_of(campaign.experiments.begin(), campaign.experiments.end(), is_periodic)) {
    throw InputError(
        fmt::format("{}: experiments: a {} model is diagnosed from periodic recordings "
                    "('excitation'); for other "
                    "signals describe the drive as graybox-rigid-robot/1",
                    campaign.file.string(), format));
  }
  PeriodicMismatchOptions periodic;
  periodic.threads = options.threads;
  periodic.keep_going = options.keep_going;
  periodic.place_files = options.place_files;
  return periodic_mismatch_problem(model, campaign, periodic);
}

}  // namespace graybox
