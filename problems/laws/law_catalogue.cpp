#include "problems/laws/law_catalogue.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "problems/base/units.hpp"
#include "problems/laws/law_lists.hpp"

namespace graybox {
namespace {

std::deque<LawEntry>& mutable_catalogue() {
  static std::deque<LawEntry> catalogue = [] {
    std::deque<LawEntry> all;
    for (auto part :
         {spring_laws(), friction_laws(), hysteresis_laws(), inertia_laws(), signal_laws()}) {
      std::ranges::move(part, std::back_inserter(all));
    }
    return all;
  }();
  return catalogue;
}

}  // namespace

const std::deque<LawEntry>& law_catalogue() { return mutable_catalogue(); }

const std::deque<LawEntry>& supplementary_laws() {
  static const std::deque<LawEntry> laws = [] {
    std::deque<LawEntry> all;
    for (auto part : {supplementary_spring_laws(), supplementary_friction_laws(),
                      supplementary_hysteresis_laws(), supplementary_signal_laws()}) {
      std::ranges::move(part, std::back_inserter(all));
    }
    return all;
  }();
  return laws;
}

bool keeps_order(const LawEntry& law, std::span<const double> parameters) {
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    if (law.parameters[i].at_least.empty()) continue;
    const auto other =
        std::ranges::find(law.parameters, law.parameters[i].at_least, &LawParameter::name);
    const double least = other == law.parameters.end()
                             ? std::stod(law.parameters[i].at_least)
                             : parameters[static_cast<std::size_t>(other - law.parameters.begin())];
    if (parameters[i] < least) return false;
  }
  return true;
}

void add_law(LawEntry entry) {
  if (const LawEntry* present = find_law(entry.name, entry.use == LawUse::kSignal)) {
    if (!present->definition.empty() && present->definition == entry.definition) return;
    throw std::invalid_argument(present->definition.empty()
                                    ? "is the name of a law of graybox's own"
                                    : "is the name of another law that a file has defined");
  }
  mutable_catalogue().push_back(std::move(entry));
}

const LawEntry* find_law(std::string_view name, bool at_signal) {
  for (const auto* list : {&law_catalogue(), &supplementary_laws()}) {
    for (const LawEntry& entry : *list) {
      const bool is_signal = entry.use == LawUse::kSignal || entry.use == LawUse::kDelay;
      if (entry.name == name && is_signal == at_signal) return &entry;
    }
  }
  return nullptr;
}

std::string unit_below(const std::string& unit) {
  return unit.find_first_of(" /") == std::string::npos ? unit : "(" + unit + ")";
}

std::string unit_at(std::string_view unit, const PlaceUnits& place) {
  if (unit == "F/s") return unit_of_derivative(place.force);
  std::string text;
  for (const char letter : unit) {
    switch (letter) {
      case 'F':
        text += place.force;
        break;
      case 'x':
        text += place.deflection;
        break;
      case 'I':
        text += place.inertia;
        break;
      case 'D':
        text += place.driver;
        break;
      default:
        text += letter;
    }
  }
  return text;
}

}  // namespace graybox
