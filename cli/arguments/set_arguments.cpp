#include "cli/arguments/set_arguments.hpp"

#include <nlohmann/json.hpp>

#include "cli/arguments/option_groups.hpp"
#include "problems/formats/information_set_file.hpp"

namespace graybox::cli {

void add_set_options(CLI::App& command, SetArguments& arguments) {
  command.add_option("set", arguments.path, "information set: .h5, .npy, .csv or .mat")->required();
  command.add_option("--variable", arguments.variable, "variable of a .mat file with several")
      ->group(kReadingOptions);
  add_psd_tolerance(command, arguments.psd_tolerance);
}

void add_factors_option(CLI::App& command, SetArguments& arguments) {
  command
      .add_flag("--factors", arguments.factors,
                "the file holds F of H = F'F: [Q x d] or [Q x k x d]")
      ->group(kReadingOptions);
}

void add_psd_tolerance(CLI::App& command, double& tolerance) {
  command
      .add_option("--psd-tolerance", tolerance,
                  "negative eigenvalues up to this, relative to the largest, become zero")
      ->group(kReadingOptions)
      ->capture_default_str();
}

ProjectedSet read_set(const SetArguments& arguments, SingularSum singular_sum,
                      FactorForm factor_form) {
  ProjectedSet read = project_semidefinite(
      read_information_set(arguments.path,
                           {.variable = arguments.variable, .factors = arguments.factors}),
      arguments.psd_tolerance, singular_sum);
  if (factor_form == FactorForm::kMadeMatrices) static_cast<void>(read.set.data());
  return read;
}

std::string change_note(const SemidefiniteChange& changed) {
  const std::string line = describe(changed);
  return line.empty() ? line : "note: " + line + "\n";
}

void add_change(const SemidefiniteChange& changed, nlohmann::ordered_json& line) {
  if (changed.candidates == 0) return;
  line["semidefinite_projection"] = {{"candidates", changed.candidates},
                                     {"smallest_eigenvalue", changed.smallest_eigenvalue},
                                     {"worst_candidate", changed.worst_candidate}};
}

}  // namespace graybox::cli
