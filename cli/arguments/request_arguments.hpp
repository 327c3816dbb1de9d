// The options that say what the next experiments have to obey, shared by solve, check and exact:
// --request, --experiments, --prior, --done, --costs, --budget, --stock, --require, --forbid,
// --block-sizes and --constraints (solvers/constrained/design_request.hpp).
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "solvers/constrained/design_request.hpp"

namespace graybox::cli {

struct RequestArguments {
  std::string file;
  DesignRequest options;

  // The file's request, with what the options say in its place. Throws InputError.
  [[nodiscard]] DesignRequest read() const;
  // Whether there is information before the first experiment, so that a set may be singular.
  [[nodiscard]] bool has_prior() const;
};

// kOwn: the command has one already; kFound: it finds their number.
enum class ExperimentsOption : std::int8_t { kAdded, kOwn, kFound };

void add_request_options(CLI::App& command, RequestArguments& arguments,
                         ExperimentsOption experiments = ExperimentsOption::kAdded);

}  // namespace graybox::cli
