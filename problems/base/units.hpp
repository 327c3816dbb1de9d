// The units of recorded signals and what one of each is in the unit of its kind that graybox
// computes with: SI, angles in radians. The names are those of the laws (law_catalogue.hpp).
//
//   const Unit& unit = *find_unit("rpm");      // unit.base == "rad/s", unit.factor == 2 pi / 60
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace graybox {

struct Unit {
  std::string_view name;
  std::string_view base;  // unit of the same kind with factor 1
  double factor;          // value in base = factor * value in this unit
};

[[nodiscard]] std::span<const Unit> known_units();
// Null for a unit that is not known.
[[nodiscard]] const Unit* find_unit(std::string_view name);
[[nodiscard]] std::string known_unit_names();  // "s, ms, us, ..."

// The base unit of the derivative with respect to time: rad -> rad/s -> rad/s^2.
[[nodiscard]] std::string unit_of_derivative(std::string_view base);

}  // namespace graybox
