#include "bench/challenge/case_truth.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "bench/challenge/detectability.hpp"
#include "problems/base/error.hpp"
#include "problems/files/file_message.hpp"

namespace graybox::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 4> kKinds{"nothing", "one_effect", "two_effects",
                                                 "outside_catalogue"};

Json effect_json(const HiddenEffect& effect) {
  Json parameters = Json::object();
  for (const TrueParameter& parameter : effect.parameters) {
    parameters[parameter.name] = {
        {"value", parameter.value}, {"unit", parameter.unit}, {"in_catalogue", parameter.compared}};
  }
  return {{"place", effect.place},
          {"law", effect.law},
          {"at_signal", effect.at_signal},
          {"in_catalogue", effect.in_catalogue},
          {"parameters", parameters},
          {"size", effect.size},
          {"smallest_size", effect.smallest_size},
          {"relative_size", effect.relative_size()},
          {"noncentrality", effect.noncentrality},
          {"detectable", effect.detectable},
          {"directed_test_detects", effect.noncentrality >= kDirectedNoncentrality}};
}

HiddenEffect effect_from(const nlohmann::ordered_json& json) {
  HiddenEffect effect;
  effect.place = json.at("place").get<std::string>();
  effect.law = json.at("law").get<std::string>();
  effect.at_signal = json.at("at_signal").get<bool>();
  effect.in_catalogue = json.at("in_catalogue").get<bool>();
  effect.size = json.at("size").get<double>();
  effect.smallest_size = json.at("smallest_size").get<double>();
  effect.noncentrality = json.at("noncentrality").get<double>();
  effect.detectable = json.at("detectable").get<bool>();
  for (const auto& [name, entry] : json.at("parameters").items()) {  // in the order of the law
    effect.parameters.push_back({name, entry.at("unit").get<std::string>(),
                                 entry.at("value").get<double>(),
                                 entry.at("in_catalogue").get<bool>()});
  }
  return effect;
}

template <typename Names>
std::size_t index_in(const Names& names, const std::string& name) {
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) throw InputError(fmt::format("unknown word '{}'", name));
  return static_cast<std::size_t>(found - names.begin());
}

Family family_from(const std::string& name) {
  const auto family = family_named(name);
  if (!family) throw InputError(fmt::format("unknown family '{}'", name));
  return *family;
}

}  // namespace

std::string_view to_string(CaseKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

bool CaseTruth::detectable() const {
  return !effects.empty() && std::ranges::all_of(effects, &HiddenEffect::detectable);
}

Json to_json(const CaseTruth& truth) {
  Json factors = Json::object();
  for (std::size_t p = 0; p < truth.parameter_names.size(); ++p) {
    factors[truth.parameter_names[p]] = truth.parameter_factors[p];
  }
  Json effects = Json::array();
  for (const HiddenEffect& effect : truth.effects) effects.push_back(effect_json(effect));
  Json json{{"format", "graybox-truth/1"},
            {"case", truth.name},
            {"family", to_string(truth.family)},
            {"kind", to_string(truth.kind)},
            {"seed", truth.seed},
            {"true_over_believed", factors},
            {"degrees_of_freedom", truth.degrees_of_freedom},
            {"required_noncentrality", truth.required_noncentrality},
            {"noncentrality", truth.noncentrality},
            {"effects", effects}};
  if (!truth.same_places.empty()) json["same_places"] = truth.same_places;
  return json;
}

CaseTruth truth_from_json(const Json& json, const std::string& file) {
  try {
    if (json.at("format") != "graybox-truth/1") throw InputError("is no graybox-truth/1 file");
    CaseTruth truth;
    truth.name = json.at("case").get<std::string>();
    truth.family = family_from(json.at("family").get<std::string>());
    truth.kind = static_cast<CaseKind>(index_in(kKinds, json.at("kind").get<std::string>()));
    truth.seed = json.at("seed").get<std::uint64_t>();
    for (const auto& [name, factor] : json.at("true_over_believed").items()) {
      truth.parameter_names.push_back(name);
      truth.parameter_factors.push_back(factor.get<double>());
    }
    truth.degrees_of_freedom = json.at("degrees_of_freedom").get<double>();
    truth.required_noncentrality = json.at("required_noncentrality").get<double>();
    truth.noncentrality = json.at("noncentrality").get<double>();
    for (const Json& effect : json.at("effects")) truth.effects.push_back(effect_from(effect));
    truth.same_places = json.value("same_places", truth.same_places);
    return truth;
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: is no truth of a case: {}", file, error.what()));
  } catch (const InputError& error) {
    throw InputError(in_file(file, error.what()));
  }
}

Element element_of(const HiddenLaw& law, const ChallengePlace& place,
                   const std::vector<double>& parameters) {
  Element element;
  element.name = law.name + " at " + place.location.name;
  element.location = place.location;
  element.law_name = law.name;
  element.use = law.use;
  element.parameters = parameters;
  if (law.make) element.law = law.make(parameters);
  return element;
}

std::vector<Element> elements_of(const CaseTruth& truth, const std::vector<ChallengePlace>& places,
                                 const LawFinder& find) {
  std::vector<Element> elements;
  for (const HiddenEffect& effect : truth.effects) {
    const auto place = std::ranges::find_if(
        places, [&](const ChallengePlace& each) { return each.location.name == effect.place; });
    if (place == places.end()) {
      throw InputError(fmt::format("{}: no place '{}'", truth.name, effect.place));
    }
    const HiddenLaw* law = find(effect.law, effect.at_signal);
    if (law == nullptr || law->parameters.size() != effect.parameters.size()) {
      throw InputError(fmt::format("{}: no hidden law '{}'", truth.name, effect.law));
    }
    std::vector<double> parameters;
    for (const TrueParameter& parameter : effect.parameters) parameters.push_back(parameter.value);
    elements.push_back(element_of(*law, *place, parameters));
  }
  return elements;
}

}  // namespace graybox::bench
