// The options --criterion, --weights, --interest, --combination, --region, --p and --floor,
// shared by the commands that solve and check.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/floors/efficiency_floor.hpp"

namespace graybox::cli {

struct CriterionArguments {
  std::string name;              // "D", ..., or "D=0.5,A=0.5" (compound), or empty
  std::string weights = {};      // L: a file, or "name=weight,..."
  std::string interest = {};     // Ds: "name,..."
  std::string combination = {};  // c: a file, or "name=factor,...;name=factor,..."
  std::string region = {};       // I, G: a file; empty: the candidates
  std::string p = {};            // phi_p: a number, or "inf"
  std::string floor = {};        // "A=0.9,..."

  // Throws InputError for an unknown criterion, or an option without its criterion.
  void require_consistent() const;
  // The criterion asked for; none where --criterion was not given. Throws InputError where it does
  // not fit the set.
  [[nodiscard]] std::optional<Criterion> read(const InformationSet& set) const;
  [[nodiscard]] std::vector<EfficiencyFloor> read_floors(const InformationSet& set) const;
};

void add_criterion_options(CLI::App& command, CriterionArguments& arguments);
// --floor, of the commands that know floors.
void add_floor_option(CLI::App& command, CriterionArguments& arguments);

}  // namespace graybox::cli
