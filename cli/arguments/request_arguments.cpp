#include "cli/arguments/request_arguments.hpp"

#include <filesystem>
#include <utility>

#include "cli/arguments/option_groups.hpp"

namespace graybox::cli {
namespace {

// Options are relative to the working folder; in a request from elsewhere they must say so.
std::string from_here(const std::string& name) {
  std::error_code error;
  if (!std::filesystem::exists(name, error)) return name;
  return std::filesystem::absolute(name).string();
}

}  // namespace

DesignRequest RequestArguments::read() const {
  if (file.empty()) return options;
  DesignRequest request = read_design_request(file);
  if (options.experiments.has_value()) request.experiments = options.experiments;
  if (options.budget.has_value()) request.budget = options.budget;
  const auto replace = [](const std::string& by, std::string& text, bool is_file) {
    if (!by.empty()) text = is_file ? from_here(by) : by;
  };
  replace(options.prior, request.prior, true);
  replace(options.done, request.done, true);
  replace(options.costs, request.costs, true);
  replace(options.stock, request.stock, true);
  replace(options.require, request.require, false);
  replace(options.forbid, request.forbid, false);
  replace(options.block_sizes, request.block_sizes, false);
  replace(options.constraints_file, request.constraints_file, true);
  return request;
}

bool RequestArguments::has_prior() const { return read().has_prior(); }

void add_request_options(CLI::App& command, RequestArguments& arguments,
                         ExperimentsOption experiments) {
  DesignRequest& options = arguments.options;
  const auto add = [&](const char* name, auto& value, const char* text) {
    command.add_option(name, value, text)->group(kConstraintOptions);
  };
  add("--request", arguments.file, "all of this in one file, graybox-request/1");
  if (experiments == ExperimentsOption::kAdded) {
    add("--experiments", options.experiments, "how many experiments come next");
  }
  add("--prior", options.prior, "information that is there already: a set of one matrix");
  add("--done", options.done, "experiments already run: a design with counts, or CSV index,count");
  add("--costs", options.costs, "cost of each candidate: CSV, a number or a coordinate's name");
  add("--budget", options.budget, "what the experiments may cost together");
  add("--stock", options.stock, "how often each candidate may be run: a number or CSV");
  add("--require", options.require, "candidates to run at least: '12:2, 40-45'");
  add("--forbid", options.forbid, "candidates not to run: '3, 10-19, q1 > 90 & q2 < 0'");
  if (experiments != ExperimentsOption::kFound) {
    add("--block-sizes", options.block_sizes, "experiments in each block: 4,4,4 or 3-5,3-5");
  }
  add("--constraints", options.constraints_file,
      "limits on groups and other linear constraints: YAML or CSV");
}

}  // namespace graybox::cli
