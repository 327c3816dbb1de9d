// The rules for options that many commands share, in one place: whatever command has an option of
// this name is held to them.
//
//   --gap      a positive number, neither infinite nor NaN
//   --seed     not negative (a negative number would wrap round to a huge one)
//   --threads  a whole number from 1 to 1024
//
// An option that may be given several times takes one value each time, where the command has
// arguments without a name: these would be swallowed else.
//
// And whatever takes a value is given one: --format '' would pass for --format left out.
#pragma once

#include <CLI/CLI.hpp>

namespace graybox::cli {

// Adds the rules to every command below `app`.
void check_common_options(CLI::App& app);

// Asks the commands that were parsed. Throws InputError naming the option without a value.
void require_values(const CLI::App& app);

}  // namespace graybox::cli
