#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cli/commands/commands.hpp"
#include "solvers/registry.hpp"

namespace graybox::cli {
namespace {

std::vector<std::string_view> criteria(const SolverRegistry::Entry& entry) {
  std::vector<std::string_view> names;
  if (entry.solver == nullptr) return names;
  for (const CriterionKind kind : entry.solver->traits().criteria) names.push_back(to_string(kind));
  return names;
}

void print_json(const SolverRegistry& registry) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& entry : registry.entries()) {
    list.push_back({{"name", entry.name},
                    {"description", entry.description},
                    {"criteria", criteria(entry)},
                    {"takes_start", entry.solver != nullptr && entry.solver->traits().takes_start},
                    {"available", entry.solver != nullptr},
                    {"reason", entry.unavailable_because}});
  }
  fmt::print("{}\n", list.dump());
}

std::string joined_criteria(const SolverRegistry::Entry& entry) {
  return fmt::format("{}", fmt::join(criteria(entry), " "));
}

void print_table(const SolverRegistry& registry) {
  std::size_t width = 0, criteria_width = std::string_view("criteria").size();
  for (const auto& entry : registry.entries()) {
    width = std::max(width, entry.name.size());
    criteria_width = std::max(criteria_width, joined_criteria(entry).size());
  }
  fmt::print("{:<{}}  {:<{}}  {}\n", "solver", width, "criteria", criteria_width, "how it works");
  for (const auto& entry : registry.entries()) {
    fmt::print("{:<{}}  {:<{}}  {}\n", entry.name, width, joined_criteria(entry), criteria_width,
               entry.description);
    if (entry.solver == nullptr) {
      fmt::print("{:<{}}  {:<{}}  not available: {}\n", "", width, "", criteria_width,
                 entry.unavailable_because);
    }
  }
}

}  // namespace

void add_solvers_command(CLI::App& app, Invocation& /*invocation*/) {
  auto* command = app.add_subcommand("solvers", "List the back-ends of this build");
  auto json = std::make_shared<bool>(false);
  command->add_flag(
      "--json", *json,
      "one line: [{name, description, criteria, takes_start, available, reason}, ...]");
  command->footer("Example:\n  graybox solvers --json");
  command->callback([json] {
    const SolverRegistry registry = make_registry();
    if (*json) {
      print_json(registry);
    } else {
      print_table(registry);
    }
  });
}

}  // namespace graybox::cli
