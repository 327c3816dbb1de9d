#include "cli/front/command_tree.hpp"

#include <algorithm>
#include <sstream>

#include "problems/families/families.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/exact/exact_method.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/design_table.hpp"

namespace graybox::cli {
namespace {

// "TEXT:{c,csv,urdf}": what CLI::IsMember tells of itself.
std::vector<std::string> members_of(const std::string& type) {
  const std::size_t from = type.find('{'), to = type.find('}');
  std::vector<std::string> members;
  if (from == std::string::npos || to == std::string::npos || to < from) return members;
  std::istringstream words(type.substr(from + 1, to - from - 1));
  for (std::string word; std::getline(words, word, ',');) members.push_back(word);
  return members;
}

std::vector<std::string> solver_names() {
  std::vector<std::string> names;
  const SolverRegistry registry = make_registry();
  for (const auto& entry : registry.entries()) {
    if (entry.solver != nullptr) names.push_back(entry.name);
  }
  return names;
}

std::vector<std::string> family_names() {
  std::vector<std::string> names;
  for (const Family& family : families()) names.emplace_back(family.name);
  return names;
}

std::vector<std::string> exact_method_names() {
  std::vector<std::string> names;
  for (const auto& method : exact_methods()) names.emplace_back(method->name());
  return names;
}

// All that are named alone: a compound criterion is written as its parts.
std::vector<std::string> criterion_names() {
  std::vector<std::string> names;
  for (int kind = 0; kind < static_cast<int>(CriterionKind::kCompound); ++kind) {
    names.emplace_back(to_string(static_cast<CriterionKind>(kind)));
  }
  return names;
}

std::vector<std::string> table_format_names() {
  std::vector<std::string> names;
  for (const std::string_view name : table_formats()) names.emplace_back(name);
  return names;
}

// Words that a command checks itself, since its message says more than CLI::IsMember's would.
std::vector<std::string> words_checked_later(const std::string& option) {
  if (option == "--solver" || option == "--solvers") return solver_names();
  if (option == "--family") return family_names();
  if (option == "--method") return exact_method_names();
  if (option == "--criterion") return criterion_names();
  if (option == "--format") return table_format_names();
  if (option == "--objective") return {"average", "worst_case"};
  if (option == "--reference") return {"optimum", "none"};
  return {};
}

// Texts that name no file.
bool is_of_words(const std::string& option) {
  constexpr std::string_view kWords[] = {
      "--interest", "--weights",  "--require",     "--forbid", "--column",      "--base",
      "--tip",      "--without",  "--load",        "--name",   "--refine",      "--stock",
      "--seed",     "--variable", "--experiments", "--p",      "--floor",       "--target",
      "--detect",   "--command",  "--joint-limit", "--at",     "--solver-name", "--block-sizes",
  };
  return std::ranges::find(kWords, option) != std::end(kWords);
}

CommandNode node_of(const CLI::App& app, const std::string& path) {
  CommandNode node;
  node.name = app.get_name();
  node.description = app.get_description();
  node.path = path;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    auto& list = option->get_positional() ? node.positionals : node.options;
    list.push_back(option_node(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_group().empty()) continue;
    node.commands.push_back(node_of(*command, path + " " + command->get_name()));
  }
  return node;
}

}  // namespace

OptionNode option_node(const CLI::Option& option) {
  OptionNode node;
  for (const std::string& name : option.get_snames()) node.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) node.names.push_back("--" + name);
  node.description = option.get_description();
  const std::string type = option.get_type_name();
  if (option.get_expected_max() == 0) return node;
  const std::string longest = node.names.empty() ? std::string() : node.names.back();
  node.values = members_of(type);
  if (node.values.empty()) node.values = words_checked_later(longest);
  if (!node.values.empty()) {
    node.takes = OptionValue::kWords;
  } else if (type.starts_with("TEXT") && !is_of_words(longest)) {
    node.takes = OptionValue::kFile;
  } else {
    node.takes = OptionValue::kNumber;
  }
  return node;
}

CommandNode command_tree(const CLI::App& app) { return node_of(app, ""); }

}  // namespace graybox::cli
