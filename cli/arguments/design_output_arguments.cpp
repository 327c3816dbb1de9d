#include "cli/arguments/design_output_arguments.hpp"

#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/report/design_table.hpp"

namespace graybox::cli {

void add_report_option(CLI::App& command, DesignOutputArguments& arguments) {
  command.add_option("--report", arguments.page,
                     "write a page with design, proof and errors (HTML)");
}

void add_design_output_options(CLI::App& command, DesignOutputArguments& arguments) {
  add_report_option(command, arguments);
  command.add_option("--model", arguments.model, "robot that the page draws: a file, or default");
  command.add_option("--format", arguments.format,
                     "print a table to run from: csv, markdown or latex");
}

void require_design_output(const DesignOutputArguments& arguments, bool json) {
  if (!arguments.format.empty()) {
    static_cast<void>(table_format(arguments.format));
    if (json) throw InputError("--format and --json both print: choose one");
  }
  if (!arguments.model.empty() && arguments.page.empty()) {
    throw InputError("--model names the robot that the page draws: add --report FILE");
  }
  if (!arguments.page.empty()) require_writable(arguments.page);
}

}  // namespace graybox::cli
