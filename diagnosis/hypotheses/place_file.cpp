#include "diagnosis/hypotheses/place_file.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

std::string in_flow_style(const YamlField& field) {
  YAML::Emitter emitter;
  emitter.SetMapFormat(YAML::Flow);
  emitter.SetSeqFormat(YAML::Flow);
  emitter << YAML::Load(field.dump());
  return emitter.c_str();
}

CandidatePlace candidate(const YamlField& field, const Places& model) {
  CandidatePlace place;
  place.location = model.resolve(field);
  place.yaml = in_flow_style(field);
  Location& location = place.location;
  if (location.driver >= 0)
    field.at("driven_by").fail("signals that drive laws are not looked for");
  if (location.kind != LocationKind::kElement || location.is_flange) return place;
  const bool is_one_coordinate = (location.output.array() != 0.0).count() == 1;
  place.is_coupling = location.input != location.output;
  place.turns = location.units.deflection == "rad" && (is_one_coordinate || place.is_coupling);
  location.takes_inertia = location.takes_inertia && is_one_coordinate;
  return place;
}

}  // namespace

std::span<CandidatePlace> add_places(const std::filesystem::path& file, const Places& model,
                                     std::vector<CandidatePlace>& places) {
  const std::size_t known = places.size();
  const YamlField root = YamlField::load(file);
  root.allow_keys({"format", "places"});
  static_cast<void>(root.at("format").choice({"graybox-places/1"}));
  for (const YamlField& field : root.at("places").items()) {
    CandidatePlace place = candidate(field, model);
    const auto there = std::ranges::find_if(places, [&](const CandidatePlace& other) {
      return are_one_place(other.location, place.location);
    });
    if (there != places.end()) {
      field.fail(
          fmt::format("is searched without being named here, as '{}'", there->location.name));
    }
    places.push_back(std::move(place));
  }
  return std::span(places).subspan(known);
}

}  // namespace graybox
