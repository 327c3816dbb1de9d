// How commands read an information set: the file, the variable of a .mat file with several, and how
// far its matrices may be from positive semidefinite (semidefinite_projection.hpp).
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "problems/information/semidefinite_projection.hpp"

namespace graybox::cli {

struct SetArguments {
  std::string path;
  std::string variable;
  bool factors = false;
  double psd_tolerance = kDefaultSemidefiniteTolerance;
};

// What becomes of a set in factor form: commands that can't work on factors have its matrices made,
// or refused, as soon as it is read.
enum class FactorForm : std::int8_t { kKept, kMadeMatrices };

// The positional "set", --variable and --psd-tolerance.
void add_set_options(CLI::App& command, SetArguments& arguments);
// --factors, for commands that can work on them.
void add_factors_option(CLI::App& command, SetArguments& arguments);
void add_psd_tolerance(CLI::App& command, double& tolerance);

// Reads and validates; throws InputError naming file, field and remedy.
[[nodiscard]] ProjectedSet read_set(const SetArguments& arguments,
                                    SingularSum singular_sum = SingularSum::kRefused,
                                    FactorForm factor_form = FactorForm::kMadeMatrices);

// "note: ..." with its newline, or nothing where no matrix was changed.
[[nodiscard]] std::string change_note(const SemidefiniteChange& changed);
// Adds the object "semidefinite_projection" where a matrix was changed.
void add_change(const SemidefiniteChange& changed, nlohmann::ordered_json& line);

}  // namespace graybox::cli
