#include "cli/arguments/option_checks.hpp"

#include <cmath>
#include <cstdlib>
#include <string>

#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

std::string check_gap(const std::string& text) {
  const double gap = std::strtod(text.c_str(), nullptr);
  if (gap > 0.0 && std::isfinite(gap)) return {};
  return text + " must be a positive number, as in 1e-6";
}

std::string check_seed(const std::string& text) {
  if (text.find('-') != 0) return {};
  return text + " must be a whole number from 0 on";
}

std::string check_threads(const std::string& text) {
  const double threads = std::strtod(text.c_str(), nullptr);
  if (threads >= 1.0 && threads <= 1024.0 && threads == std::floor(threads)) return {};
  return text + " must be a whole number from 1 to 1024";
}

bool has_positionals(const CLI::App& app) {
  return !app.get_options([](const CLI::Option* option) { return option->get_positional(); })
              .empty();
}

// "--column enc=position log.csv" is one column and one file.
void take_one_value_each(CLI::App& app) {
  if (!has_positionals(app)) return;
  for (CLI::Option* option : app.get_options()) {
    if (!option->get_positional()) option->allow_extra_args(false);
  }
}

}  // namespace

void check_common_options(CLI::App& app) {
  const auto hold = [&](const char* name, std::string (*rule)(const std::string&)) {
    if (CLI::Option* option = app.get_option_no_throw(name); option != nullptr) {
      option->check(CLI::Validator([rule](std::string& text) { return rule(text); }, ""));
    }
  };
  hold("--gap", check_gap);
  hold("--seed", check_seed);
  hold("--threads", check_threads);
  take_one_value_each(app);
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    check_common_options(*command);
  }
}

void require_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_expected_max() == 0) continue;  // a flag
    for (const std::string& value : option->results()) {
      if (value.find_first_not_of(" \t") != std::string::npos) continue;
      throw InputError(option->get_name(option->get_positional()) +
                       ": the value is empty; state one, or leave the option out");
    }
  }
  for (const CLI::App* command : app.get_subcommands()) require_values(*command);
}

}  // namespace graybox::cli
