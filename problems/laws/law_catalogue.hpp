// The catalogue of laws: every law with its parameters, their units and ranges, by name.
//
//   const LawEntry& entry = *find_law("cubic_spring", false);
//   const std::shared_ptr<const Law> law = entry.make({4e9});
//   law->force(1e-3, 0.0, {})                       // 4 N m
//
// A unit is written with F, x and I for the units of force, deflection and inertia of the place:
// "F/x^3" is N m/rad^3 about a rotation and N/m^3 along a translation (unit_at). At an actuator or
// sensor F is the unit of the signal.
//
// Adding a law: a class in the file of its kind (springs, friction, hysteresis, ...) and one entry
// in that file's list. Reader, simulator, documentation (`graybox simulate --laws`) and the
// property tests take it from there. Without C++, by a file: law_file.hpp.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/laws/law.hpp"

namespace graybox {

// What a law is used for.
enum class LawUse : std::int8_t {
  kForce,    // force between the coordinates of its place
  kSignal,   // added to a torque or a measurement: s -> s + f(s)
  kInertia,  // adds its one parameter to the inertia at its place; no Law object
  kDelay,    // delays a signal by its one parameter, s; no Law object
  kPayload,  // a body fixed to the flange; no Law object
};

enum class ParameterRange : std::int8_t { kAny, kPositive, kNonNegative, kUnitInterval };

// Values of a parameter of a user's law that the search for missing physics starts from.
struct ParameterTrials {
  std::vector<double> deflection_shares;  // quantiles of the recorded |z|
  std::vector<double> rate_shares;        // of the recorded |z'|
  std::vector<double> values;
};

struct LawParameter {
  std::string name;
  std::string unit;  // with F, x, I and D: PlaceUnits
  ParameterRange range = ParameterRange::kAny;
  bool is_linear = false;  // the force is linear in all parameters marked so, taken together
  ParameterTrials trials = {};
  // The value that files may leave out; fits leave it as it is then.
  std::optional<double> if_absent = {};
  // For any value of it others make the same force: the diagnosis leaves it as it is.
  bool sets_scale = false;
  // A size that recordings tell for a given value of that one only, so that it has no standard
  // error by itself. (The level of a friction is none: it is stated at the velocity given.)
  bool is_relative = false;
  // What it is not below in any machine: another parameter of the law, since friction at rest that
  // is less than when sliding is no Stribeck effect, or a number. Files may say otherwise; a
  // diagnosis does not.
  std::string at_least = {};
};

struct LawEntry {
  std::string name;
  std::string description;  // one line, with the formula
  LawUse use = LawUse::kForce;
  std::vector<LawParameter> parameters;
  // From the parameters in the order above, within their ranges. Empty where there is no Law
  // object.
  std::function<std::shared_ptr<const Law>(std::span<const double>)> make;
  // YAML, as law_file.hpp reads it, of a law that a file has added; empty for graybox's own.
  std::string definition = {};
};

// Whether no parameter is below what it is at least.
[[nodiscard]] bool keeps_order(const LawEntry& law, std::span<const double> parameters);

// References to entries stay valid.
[[nodiscard]] const std::deque<LawEntry>& law_catalogue();

// Laws that models and files may use like those of the catalogue, but that the search for missing
// physics does not try by itself: they have more parameters than it tells apart, or a further
// signal.
[[nodiscard]] const std::deque<LawEntry>& supplementary_laws();

// For all of the process; not while other threads use the catalogue. Nothing happens if the same
// definition is there already. Throws std::invalid_argument if another law has the name.
void add_law(LawEntry entry);

// The law of this name, of either list, for a place with forces (also inertia and payload) or with
// a signal (also delay); null if there is none.
[[nodiscard]] const LawEntry* find_law(std::string_view name, bool at_signal);

struct PlaceUnits {
  std::string force;        // "N m", "N", or the unit of a signal
  std::string deflection;   // "rad" or "m"
  std::string inertia;      // "kg m^2" or "kg"
  std::string driver = {};  // of the input that drives a force law, in brackets where composed
};

// As it stands below a line: "(N m)", "s".
[[nodiscard]] std::string unit_below(const std::string& unit);

// "F/x^3" -> "N m/rad^3".
[[nodiscard]] std::string unit_at(std::string_view unit, const PlaceUnits& place);

}  // namespace graybox
