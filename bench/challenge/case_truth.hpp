// CaseTruth: what a challenge case hides, and the sealed file that says so (graybox-truth/1).
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "bench/challenge/case_system.hpp"
#include "bench/challenge/hidden_laws.hpp"

namespace graybox::bench {

enum class CaseKind : std::int8_t { kNothing, kOneEffect, kTwoEffects, kOutside };
[[nodiscard]] std::string_view to_string(CaseKind kind);

struct TrueParameter {
  std::string name, unit;
  double value = 0.0;
  bool compared = false;  // the catalogue's law has it
};

struct HiddenEffect {
  std::string place, law;
  bool at_signal = false;
  bool in_catalogue = true;
  std::vector<TrueParameter> parameters{};
  double size = 0.0;           // hidden_laws.hpp
  double smallest_size = 0.0;  // that is detectable; 0 where none is
  double noncentrality = 0.0;  // of this effect alone
  bool detectable = false;

  // From 1, the smallest detectable, to 20.
  [[nodiscard]] double relative_size() const {
    return smallest_size > 0.0 ? size / smallest_size : 0.0;
  }
};

struct CaseTruth {
  std::string name;  // of the case, "case_017"
  Family family = Family::kRobot;
  CaseKind kind = CaseKind::kNothing;
  std::uint64_t seed = 0;
  std::vector<std::string> parameter_names;
  std::vector<double> parameter_factors;  // true over believed
  double degrees_of_freedom = 0.0;
  double required_noncentrality = 0.0;
  double noncentrality = 0.0;  // of all effects together
  std::vector<HiddenEffect> effects;
  // Places that the recordings can't tell apart by what is measured, by kind of law
  // (same_system.hpp); none in the periodic set.
  std::map<std::string, std::vector<std::string>> same_places{};

  // All of its effects are, each alone.
  [[nodiscard]] bool detectable() const;
};

[[nodiscard]] nlohmann::ordered_json to_json(const CaseTruth& truth);
// Throws InputError naming the file.
[[nodiscard]] CaseTruth truth_from_json(const nlohmann::ordered_json& json,
                                        const std::string& file);

// How a set of cases finds its laws by name and `at_signal`; null if there is none.
using LawFinder = std::function<const HiddenLaw*(std::string_view, bool)>;

// The elements that the effects are on a system with these places. Throws InputError where it has
// no such place, or the set no such law.
[[nodiscard]] std::vector<Element> elements_of(const CaseTruth& truth,
                                               const std::vector<ChallengePlace>& places,
                                               const LawFinder& find = find_hidden_law);
[[nodiscard]] Element element_of(const HiddenLaw& law, const ChallengePlace& place,
                                 const std::vector<double>& parameters);

}  // namespace graybox::bench
