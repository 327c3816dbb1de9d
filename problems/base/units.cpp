#include "problems/base/units.hpp"

#include <algorithm>
#include <array>
#include <numbers>

namespace graybox {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kInch = 0.0254;                 // exact since 1959
constexpr double kPoundForce = 4.4482216152605;  // 0.45359237 kg at standard gravity
constexpr double kStandardGravity = 9.80665;

constexpr std::array kUnits = {
    Unit{"s", "s", 1.0},
    Unit{"ms", "s", 1e-3},
    Unit{"us", "s", 1e-6},
    Unit{"ns", "s", 1e-9},
    Unit{"min", "s", 60.0},
    Unit{"rad", "rad", 1.0},
    Unit{"mrad", "rad", 1e-3},
    Unit{"deg", "rad", kDegree},
    Unit{"arcsec", "rad", kDegree / 3600.0},
    Unit{"turn", "rad", kTurn},
    Unit{"rad/s", "rad/s", 1.0},
    Unit{"deg/s", "rad/s", kDegree},
    Unit{"turn/s", "rad/s", kTurn},
    Unit{"rpm", "rad/s", kTurn / 60.0},
    Unit{"rad/s^2", "rad/s^2", 1.0},
    Unit{"deg/s^2", "rad/s^2", kDegree},
    Unit{"m", "m", 1.0},
    Unit{"mm", "m", 1e-3},
    Unit{"um", "m", 1e-6},
    Unit{"in", "m", kInch},
    Unit{"m/s", "m/s", 1.0},
    Unit{"mm/s", "m/s", 1e-3},
    Unit{"in/s", "m/s", kInch},
    Unit{"m/s^2", "m/s^2", 1.0},
    Unit{"g", "m/s^2", kStandardGravity},
    Unit{"N", "N", 1.0},
    Unit{"kN", "N", 1e3},
    Unit{"lbf", "N", kPoundForce},
    Unit{"kip", "N", 1e3 * kPoundForce},
    Unit{"N m", "N m", 1.0},
    Unit{"mN m", "N m", 1e-3},
    Unit{"kN m", "N m", 1e3},
    Unit{"A", "A", 1.0},
    Unit{"mA", "A", 1e-3},
    Unit{"V", "V", 1.0},
    Unit{"mV", "V", 1e-3},
    Unit{"Pa", "Pa", 1.0},
    Unit{"bar", "Pa", 1e5},
    Unit{"degC", "degC", 1.0},  // as a thermometer reads; differences are those of K
    Unit{"K", "K", 1.0},
    Unit{"counts", "counts", 1.0},
    Unit{"%", "1", 1e-2},
    Unit{"1", "1", 1.0},
};

}  // namespace

std::span<const Unit> known_units() { return kUnits; }

const Unit* find_unit(std::string_view name) {
  const auto* const found = std::ranges::find(kUnits, name, &Unit::name);
  return found == kUnits.end() ? nullptr : found;
}

std::string known_unit_names() {
  std::string names;
  for (const Unit& unit : kUnits) {
    if (!names.empty()) names += ", ";
    names += unit.name;
  }
  return names;
}

std::string unit_of_derivative(std::string_view base) {
  if (base.ends_with("/s^2")) return std::string(base.substr(0, base.size() - 1)) + "3";
  if (base.ends_with("/s")) return std::string(base) + "^2";
  return std::string(base) + "/s";
}

}  // namespace graybox
