// The options --criterion, --weights and --interest, shared by the commands that solve and check.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox::cli {

struct CriterionArguments {
  std::string name;      // "D", "A", "E", "L", "Ds", or empty
  std::string weights;   // L: a file, or "name=weight,..."
  std::string interest;  // Ds: "name,..."

  // Throws InputError for an unknown criterion, or weights or interest without theirs.
  void require_consistent() const;
  // The criterion asked for; none where --criterion was not given. Throws InputError where it does
  // not fit the set.
  [[nodiscard]] std::optional<Criterion> read(const InformationSet& set) const;
};

void add_criterion_options(CLI::App& command, CriterionArguments& arguments);

}  // namespace graybox::cli
