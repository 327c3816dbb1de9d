#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "graybox/solvers/registry.hpp"

namespace graybox::cli {
namespace {

void print_json(const SolverRegistry& registry) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& entry : registry.entries()) {
    list.push_back({{"name", entry.name},
                    {"description", entry.description},
                    {"available", entry.solver != nullptr},
                    {"reason", entry.unavailable_because}});
  }
  fmt::print("{}\n", list.dump());
}

void print_table(const SolverRegistry& registry) {
  std::size_t width = 0;
  for (const auto& entry : registry.entries()) width = std::max(width, entry.name.size());
  for (const auto& entry : registry.entries()) {
    fmt::print("{:<{}}  {}\n", entry.name, width, entry.description);
    if (entry.solver == nullptr) {
      fmt::print("{:<{}}  not available: {}\n", "", width, entry.unavailable_because);
    }
  }
}

}  // namespace

void add_solvers_command(CLI::App& app, Invocation& /*invocation*/) {
  auto* command = app.add_subcommand("solvers", "List the back-ends of this build");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "one line: [{name, description, available, reason}, ...]");
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
