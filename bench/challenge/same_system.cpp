#include "bench/challenge/same_system.hpp"

#include <algorithm>
#include <set>

namespace graybox::bench {
namespace {

bool is_actuator(const std::string& place) { return place.starts_with("actuator "); }
bool is_sensor(const std::string& place) { return place.starts_with("sensor "); }
bool is_signal(const std::string& place) { return is_actuator(place) || is_sensor(place); }

bool is_friction(const std::string& law) {
  static const std::set<std::string> kFrictions{
      "coulomb",        "asymmetric_coulomb", "stribeck", "viscous", "asymmetric_viscous",
      "quadratic_drag", "sublinear_friction", "dahl",     "lugre",   "offset"};
  return kFrictions.contains(law);
}

// Whether a law is the same at all places of a group.
bool serves(const std::string& law, bool at_signal, const std::vector<std::string>& group) {
  const auto signals = std::ranges::count_if(group, is_signal);
  if (law == "late") return signals == static_cast<std::ptrdiff_t>(group.size());
  if (law == "offset") return std::ranges::none_of(group, is_sensor);
  return !at_signal && signals == 0 && is_friction(law);
}

}  // namespace

std::string system_of(const CaseTruth& truth, const std::string& place, const std::string& law) {
  if (set_of(truth.family) == kPeriodicSet) return law + " at " + place;
  const bool at_signal = is_signal(place);
  std::string name = law, where = place;
  if (at_signal && (law == "delay" || law == "lag")) name = "late";
  if (!at_signal && (law == "backlash" || law == "dead_zone")) name = "play";
  // The groups are a chain: the first of one may be in another.
  for (std::size_t pass = 0; pass < truth.same_places.size(); ++pass) {
    for (const auto& group : truth.same_places) {
      if (serves(name, at_signal, group) && std::ranges::find(group, where) != group.end()) {
        where = group.front();
      }
    }
  }
  return name + " at " + where;
}

}  // namespace graybox::bench
