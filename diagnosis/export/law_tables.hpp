// A model as tables (CSV): one of all its numbers, and one for each place where laws act.
//
//   parameters.csv            element, law, place, parameter, value, unit
//   friction_<place>.csv      velocity; the force of each law of the velocity; their sum
//   spring_<place>.csv        deflection; the force of each law of the deflection; their sum
//   damping_<place>.csv       deflection, velocity, force: laws of both, on a grid
//
// Laws with memory, of actuators and of sensors have no such curve: their parameters are listed.
// The header has units in brackets.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/export/exported_model.hpp"

namespace graybox {

struct TableRange {
  // The tables go from minus this to this; none: ten times the largest velocity (deflection) among
  // the laws' own parameters, 1 where they have none.
  std::optional<double> velocity = {}, deflection = {};
  int points = 201;
};

struct ModelTable {
  std::string file;  // its name, with ending
  std::string text;
};

// parameters.csv first.
[[nodiscard]] std::vector<ModelTable> model_tables(const ExportedModel& model,
                                                   const TableRange& range);

}  // namespace graybox
