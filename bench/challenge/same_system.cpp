#include "bench/challenge/same_system.hpp"

#include <algorithm>

namespace graybox::bench {
namespace {

bool is_signal(const std::string& place) {
  return place.starts_with("actuator ") || place.starts_with("sensor ");
}

}  // namespace

std::string system_of(const CaseTruth& truth, const std::string& place, const std::string& law) {
  if (set_of(truth.family) == kPeriodicSet) return law + " at " + place;
  const bool at_signal = is_signal(place);
  std::string name = law;
  if (at_signal && (law == "delay" || law == "lag")) name = "late";
  if (!at_signal && (law == "backlash" || law == "dead_zone")) name = "play";
  const std::string kind = name == "late" || name == "offset" ? name : at_signal ? "" : "force";
  const auto group = truth.same_places.find(kind);
  const bool is_one_of_them = group != truth.same_places.end() &&
                              std::ranges::find(group->second, place) != group->second.end();
  const std::string& where = is_one_of_them ? group->second.front() : place;
  return name + " at " + where;
}

}  // namespace graybox::bench
