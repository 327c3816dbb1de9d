// How commands hand a design to a reader: as a page, or as a table to paste.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace graybox::cli {

struct DesignOutputArguments {
  std::string page;    // file of the page; empty: none
  std::string format;  // of the table; empty: no table
  std::string model;   // robot whose poses the page draws; empty: none
};

void add_report_option(CLI::App& command, DesignOutputArguments& arguments);  // --report
// --report, --format and --model.
void add_design_output_options(CLI::App& command, DesignOutputArguments& arguments);

// Throws InputError for what does not go together, and where the page can't be written.
void require_design_output(const DesignOutputArguments& arguments, bool json);

}  // namespace graybox::cli
