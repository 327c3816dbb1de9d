#include "diagnosis/verdict/verdict_file.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/plausibility/plausibility_words.hpp"
#include "diagnosis/responses/distortion.hpp"
#include "diagnosis/verdict/error_places.hpp"
#include "diagnosis/verdict/reason_words.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/program_version.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

// The fields of a `location`, as physics.yaml has them: text, or a mapping of texts and numbers.
Json json_of(const YAML::Node& node) {
  if (node.IsMap()) {
    Json object = Json::object();
    for (const auto& entry : node) object[entry.first.as<std::string>()] = json_of(entry.second);
    return object;
  }
  if (node.IsSequence()) {
    Json list = Json::array();
    for (const YAML::Node& item : node) list.push_back(json_of(item));
    return list;
  }
  double value = 0.0;
  if (YAML::convert<double>::decode(node, value)) return value;
  return node.as<std::string>();
}

Json parameters_json(const FittedLaw& law) {
  Json parameters = Json::object();
  for (const LawParameterEstimate& estimate : law.parameters) {
    Json& parameter = parameters[estimate.name];
    parameter = {{"value", number(estimate.value)},
                 {"standard_error", number(estimate.standard_error)},
                 {"unit", estimate.unit}};
    if (estimate.sets_scale) parameter["sets_scale"] = true;
    if (std::isfinite(estimate.conditional_error)) {
      parameter["conditional_error"] = estimate.conditional_error;
    }
  }
  return parameters;
}

Json same_at_json(const std::vector<FittedLaw>& laws, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const FittedLaw& law : laws) {
    const Hypothesis& hypothesis = hypotheses[law.hypothesis];
    list.push_back({{"place", hypothesis.place},
                    {"location", json_of(YAML::Load(hypothesis.location))},
                    {"parameters", parameters_json(law)}});
  }
  return list;
}

// The other laws of a sum.
Json sum_json(const std::vector<FittedLaw>& laws, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const FittedLaw& law : laws) {
    list.push_back({{"place", hypotheses[law.hypothesis].place},
                    {"law", hypotheses[law.hypothesis].law},
                    {"parameters", parameters_json(law)}});
  }
  return list;
}

Json rivals_json(const std::vector<Rival>& rivals, std::span<const Hypothesis> hypotheses,
                 bool noise_is_known) {
  Json list = Json::array();
  for (const Rival& rival : rivals) {
    const Hypothesis& hypothesis = hypotheses[rival.law.hypothesis];
    list.push_back(
        {{"place", hypothesis.place},
         {"law", hypothesis.law},
         {"parameters", parameters_json(rival.law)},
         {"bic_difference", number(rival.bic_difference)},
         {"evidence_difference",
          noise_is_known ? number(rival.evidence_difference) : Json(nullptr)},
         {"held_out_difference",
          rival.held_out_difference ? number(*rival.held_out_difference) : Json(nullptr)},
         {"same_at", same_at_json(rival.same_at, hypotheses)},
         {"on_few_recordings", rival.on_few_recordings},
         {"with_free_motion", rival.on_other_noise},
         {"contradicted", rival.is_contradicted},
         {"with", sum_json(rival.with, hypotheses)}});
  }
  return list;
}

Json effect_json(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                 bool noise_is_known) {
  const Hypothesis& hypothesis = hypotheses[effect.law.hypothesis];
  return {{"name", element_name(effect, hypotheses)},
          {"place", hypothesis.place},
          {"location", json_of(YAML::Load(hypothesis.location))},
          {"law", hypothesis.law},
          {"parameters", parameters_json(effect.law)},
          {"explained_share", number(effect.explained_share)},
          {"bic_difference", number(effect.bic_difference)},
          {"held_out_gain", effect.held_out ? number(effect.held_out->gain) : Json(nullptr)},
          {"held_out_error_without",
           effect.held_out ? number(effect.held_out->error_without) : Json(nullptr)},
          {"same_at", same_at_json(effect.same_at, hypotheses)},
          {"alternatives", rivals_json(effect.rivals, hypotheses, noise_is_known)},
          {"generalisations", rivals_json(effect.generalisations, hypotheses, noise_is_known)},
          {"excluded", rivals_json(effect.excluded, hypotheses, noise_is_known)}};
}

Json assessment_json(const Assessment& assessment, bool noise_is_known) {
  return {{"chi_square_per_dof",
           noise_is_known ? number(assessment.chi_square_per_dof()) : Json(nullptr)},
          {"nrmse", number(assessment.nrmse)},
          {"variance_accounted_for", number(assessment.variance_accounted_for)}};
}

Json fit_json(const ExtendedFit& fit, const std::optional<Assessment>& validation,
              bool noise_is_known) {
  if (!fit.usable) return nullptr;
  return {
      {"estimation", assessment_json(fit.estimation, noise_is_known)},
      {"validation", validation ? assessment_json(*validation, noise_is_known) : Json(nullptr)}};
}

bool is_linear(const std::string& law) {
  static const std::set<std::string> kLinear = {"stiffness", "viscous",  "inertia", "payload",
                                                "gain",      "lag",      "delay",   "mode",
                                                "offset",    "resonance"};
  return kLinear.count(law) > 0;
}

Json nonlinear_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (diagnosis.effects.empty()) return nullptr;
  return std::any_of(
      diagnosis.effects.begin(), diagnosis.effects.end(),
      [&](const FoundEffect& effect) { return !is_linear(hypotheses[effect.law.hypothesis].law); });
}

Json detectable_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const DetectableEffect& effect : diagnosis.detectable) {
    const Hypothesis& hypothesis = hypotheses[effect.hypothesis];
    list.push_back({{"place", hypothesis.place},
                    {"law", hypothesis.law},
                    {"amplitude", number(effect.amplitude)},
                    {"unit", effect.unit}});
  }
  return list;
}

Json late_channels_json(const Diagnosis& diagnosis) {
  Json list = Json::array();
  for (const LateChannel& late : diagnosis.late_channels) {
    list.push_back({{"channel", late.moved.channel},
                    {"late_by_s", number(late.moved.seconds)},
                    {"nrmse_held_out_before", number(late.error_before)},
                    {"nrmse_held_out", number(late.error_after)}});
  }
  return list;
}

Json estimate_json(const LawParameterEstimate& estimate) {
  return {{"value", number(estimate.value)}, {"standard_error", number(estimate.standard_error)}};
}

Json kept_out_change_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (!diagnosis.kept_out_change) return nullptr;
  const KeptOutChange& change = *diagnosis.kept_out_change;
  Json sizes = Json::array();
  for (const ChangedSize& size : change.sizes) {
    const Hypothesis* law =
        size.law ? &hypotheses[diagnosis.after.laws[*size.law].hypothesis] : nullptr;
    sizes.push_back({{"law", law != nullptr ? Json(law->law) : Json(nullptr)},
                     {"place", law != nullptr ? Json(law->place) : Json(nullptr)},
                     {"parameter", size.in_fit.name},
                     {"unit", size.in_fit.unit},
                     {"in_fit", estimate_json(size.in_fit)},
                     {"kept_out", estimate_json(size.kept_out)},
                     {"standard_errors_apart", number(size.z)}});
  }
  return {{"nrmse_predicted", number(change.error_predicted)},
          {"nrmse_fitted", number(change.error_fitted)},
          {"sizes", std::move(sizes)}};
}

Json error_places_json(const Diagnosis& diagnosis) {
  Json list = Json::array();
  for (const ErrorPlace& place : error_places_of(diagnosis)) {
    const bool is_spell = place.kind == ErrorPlace::Kind::kSpell;
    list.push_back({{"kind", is_spell ? "spell" : "onset"},
                    {"recording", place.recording},
                    {"kept_out", place.held_out},
                    {"channel", place.channel},
                    {"unit", place.unit},
                    {"from_s", number(place.from)},
                    {"to_s", number(place.to)},
                    {"share", is_spell ? number(place.share) : Json(nullptr)},
                    {"ratio", is_spell ? Json(nullptr) : number(place.ratio)},
                    {"low", number(place.low)},
                    {"high", number(place.high)},
                    {"nowhere_else", place.is_new}});
  }
  return list;
}

Json channel_rests_json(const std::vector<ChannelRest>& before,
                        const std::vector<ChannelRest>& after) {
  const auto rest_json = [](const ChannelRest& rest) {
    return Json{
        {"nrmse", number(rest.nrmse)},
        {"nrmse_held_out", rest.held_out_nrmse ? number(*rest.held_out_nrmse) : Json(nullptr)},
        {"remaining_structure", number(rest.structure)},
        {"autocorrelated_error", number(rest.autocorrelated_error)},
        {"late_by_s", rest.late_by ? number(*rest.late_by) : Json(nullptr)}};
  };
  Json list = Json::array();
  for (std::size_t c = 0; c < before.size(); ++c) {
    list.push_back({{"channel", before[c].channel},
                    {"before", rest_json(before[c])},
                    {"after", c < after.size() ? rest_json(after[c]) : Json(nullptr)}});
  }
  return list;
}

Json mismatch_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  MismatchSummary summary = summarise_mismatch(diagnosis.mismatch_before);
  for (const ChannelRest& rest : diagnosis.channels_before) {
    if (is_more_than_noise(rest)) summary.channels.push_back(rest.channel);
  }
  Json bands = Json::array();
  for (const auto& [from, to] : summary.bands) bands.push_back({from, to});
  const Detection& detection = diagnosis.detection;
  return {
      {"detected", detection.detected},
      {"p_value", std::min(detection.lack_of_fit_p_value, detection.smallest_p_value)},
      {"lack_of_fit_p_value",
       diagnosis.noise_is_known ? number(detection.lack_of_fit_p_value) : Json(nullptr)},
      {"smallest_p_value", detection.smallest_p_value},
      {"threshold", detection.threshold},
      {"channels", summary.channels},
      {"rest_by_channel", channel_rests_json(diagnosis.channels_before, diagnosis.channels_after)},
      {"bands_hz", bands},
      {"positions", summary.positions},
      {"levels", summary.levels},
      {"nonlinear", nonlinear_json(diagnosis, hypotheses)},
      {"smallest_detectable", detectable_json(diagnosis, hypotheses)}};
}

Json time_variation_json(const std::optional<TimeVariation>& variation) {
  if (!variation) return nullptr;
  return {{"place", variation->place},
          {"coefficient", variation->coefficient},
          {"deviation", variation->deviation},
          {"unit", variation->unit},
          {"frequency_hz", variation->frequency},
          {"duration_s", variation->duration},
          {"p_value", variation->p_value},
          {"alternatives", variation->alternatives}};
}

std::string covariate_name(LawTrend::On on) {
  switch (on) {
    case LawTrend::On::kTime:
      return "time";
    case LawTrend::On::kPosition:
      return "position";
    case LawTrend::On::kSpeed:
      return "speed";
    case LawTrend::On::kDirection:
      return "direction";
  }
  return {};
}

Json trends_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const LawTrend& trend : diagnosis.trends) {
    if (trend.law >= diagnosis.effects.size()) continue;
    const FittedLaw& law = diagnosis.effects[trend.law].law;
    const Hypothesis& hypothesis = hypotheses[law.hypothesis];
    const LawParameterEstimate& parameter = law.parameters[trend.parameter];
    list.push_back({{"place", hypothesis.place},
                    {"law", hypothesis.law},
                    {"parameter", parameter.name},
                    {"unit", parameter.unit},
                    {"with", covariate_name(trend.on)},
                    {"from", number(trend.from)},
                    {"to", number(trend.to)},
                    {"standard_errors", number(std::abs(trend.z))},
                    {"of_signal", number(trend.of_signal)}});
  }
  return list;
}

Json departures_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const Departure& departure : diagnosis.departures) {
    const Hypothesis& hypothesis = hypotheses[departure.start.hypothesis];
    list.push_back({{"place", hypothesis.place},
                    {"law", hypothesis.law},
                    {"chi_square", number(departure.statistic)},
                    {"degrees_of_freedom", number(departure.degrees_of_freedom)},
                    {"p_value", number(departure.p_value)},
                    {"share", number(departure.share)}});
  }
  return list;
}

Json shared_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const SharedCharacteristic& shared : diagnosis.shared_characteristics) {
    Json laws = Json::array();
    for (const std::size_t hypothesis : shared.hypotheses)
      laws.push_back(hypotheses[hypothesis].law);
    const bool is_spring = shared.characteristic == Characteristic::kSpring;
    list.push_back({{"place", shared.place},
                    {"characteristic", is_spring ? "spring" : "friction"},
                    {"laws", std::move(laws)}});
  }
  return list;
}

Json channel_faults_json(const Diagnosis& diagnosis) {
  Json list = Json::array();
  for (const ChannelFault& fault : diagnosis.channel_faults) {
    list.push_back({{"channels", fault.channels},
                    {"message", fault.statement()},
                    {"rivals", fault.rivals},
                    {"sure", fault.rivals.empty()}});
  }
  return list;
}

Json shares_json(const NextExperiment& next) {
  Json list = Json::array();
  for (const NextExperiment::Share& share : next.shares) {
    if (!share.option.recording.empty()) {
      list.push_back({{"recording", share.option.recording},
                      {"amplitude", share.option.amplitude},
                      {"speed", share.option.speed},
                      {"alone", share.option.alone},
                      {"weight", share.weight}});
      continue;
    }
    list.push_back({{"position", share.option.position_degrees},
                    {"level", share.option.level},
                    {"band_hz", {share.option.from, share.option.to}},
                    {"weight", share.weight}});
  }
  return list;
}

Json next_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  const NextQuestion question = next_question(diagnosis);
  if (question.rival == nullptr) return nullptr;
  const NextExperiment& next = *question.rival->next;
  return {{"between",
           {hypothesis_words(hypotheses[question.effect->law.hypothesis]),
            hypothesis_words(hypotheses[question.rival->law.hypothesis])}},
          {"shares", shares_json(next)},
          {"duality_gap", next.duality_gap},
          {"distance_now", next.distance_now},
          {"distance_then", next.distance_then},
          {"distance_needed", next.distance_needed},
          {"recordings", next.recordings},
          {"recordings_needed", number(next.recordings_needed)}};
}

Json model_parameters_json(const Diagnosis& diagnosis) {
  Json list = Json::array();
  const auto& before = diagnosis.before.model_parameters;
  const auto& after = diagnosis.after.model_parameters;
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    list.push_back({{"name", after[i].name},
                    {"before", number(before[i].value)},
                    {"after", number(after[i].value)},
                    {"standard_error", number(after[i].standard_error)},
                    {"unit", after[i].unit}});
  }
  return list;
}

template <typename Value>
void add_once(std::vector<Value>& list, const Value& value) {
  if (std::find(list.begin(), list.end(), value) == list.end()) list.push_back(value);
}

std::vector<std::pair<double, double>> merged(std::vector<std::pair<double, double>> bands) {
  std::sort(bands.begin(), bands.end());
  std::vector<std::pair<double, double>> result;
  for (const auto& band : bands) {
    if (!result.empty() && band.first <= result.back().second) {
      result.back().second = std::max(result.back().second, band.second);
    } else {
      result.push_back(band);
    }
  }
  return result;
}

}  // namespace

double cell_p_value(const MismatchCell& cell) {
  if (!(cell.degrees_of_freedom > 0.0)) return 1.0;
  const double effective = cell.effective > 0.0 ? cell.effective : cell.degrees_of_freedom;
  return chi_square_tail(cell.statistic * effective / cell.degrees_of_freedom, effective);
}

std::vector<bool> rejected_cells(const std::vector<MismatchCell>& cells, double rate) {
  std::vector<double> p_values;
  for (const MismatchCell& cell : cells) p_values.push_back(cell_p_value(cell));
  return discoveries(p_values, rate);
}

MismatchSummary summarise_mismatch(const std::vector<MismatchCell>& cells, double rate) {
  MismatchSummary summary;
  const std::vector<bool> rejected = rejected_cells(cells, rate);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!rejected[i]) continue;
    add_once(summary.channels, cells[i].channel);
    add_once(summary.positions, cells[i].position);
    add_once(summary.levels, cells[i].level);
    summary.bands.emplace_back(cells[i].from, cells[i].to);
  }
  summary.bands = merged(std::move(summary.bands));
  return summary;
}

NextQuestion next_question(const Diagnosis& diagnosis) {
  for (const FoundEffect& effect : diagnosis.effects) {
    for (const Rival& rival : effect.rivals) {
      if (rival.next && std::isfinite(rival.next->recordings_needed)) return {&effect, &rival};
    }
  }
  return {};
}

std::string element_name(const FoundEffect& effect, std::span<const Hypothesis> hypotheses) {
  return hypothesis_words(hypotheses[effect.law.hypothesis]);
}

Json verdict_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses,
                  const DiagnosedFiles& files) {
  Json physics = Json::array();
  for (const FoundEffect& effect : diagnosis.effects) {
    physics.push_back(effect_json(effect, hypotheses, diagnosis.noise_is_known));
  }
  return {
      {"format", "graybox-verdict/1"},
      {"written_by", written_by()},
      {"model", files.model},
      {"campaign", files.campaign},
      {"verdict", to_string(diagnosis.verdict)},
      {"reasons", reasons_json(diagnosis)},
      {"checked_range", range_json(diagnosis.checked)},
      {"plausibility", plausibility_json(diagnosis.implausible)},
      {"interrupted", diagnosis.interrupted},
      {"noise_is_known", diagnosis.noise_is_known},
      {"verified", diagnosis.verified},
      {"predicts_kept_out", predicts_kept_out(diagnosis)},
      {"rivals_weighed", diagnosis.rivals_weighed},
      {"remaining_structure",
       diagnosis.remaining_structure ? number(*diagnosis.remaining_structure) : Json(nullptr)},
      {"autocorrelated_error",
       diagnosis.autocorrelated_error ? number(*diagnosis.autocorrelated_error) : Json(nullptr)},
      {"words", verdict_words(diagnosis, hypotheses)},
      {"channel_faults", channel_faults_json(diagnosis)},
      {"channels_checked", diagnosis.channels_checked},
      {"recording_warnings", files.warnings},
      {"mismatch", mismatch_json(diagnosis, hypotheses)},
      {"time_variation", time_variation_json(diagnosis.time_variation)},
      {"time_variation_tested", diagnosis.time_variation_was_tested},
      {"trends", trends_json(diagnosis, hypotheses)},
      {"physics", physics},
      {"rejected", rejected_json(diagnosis, hypotheses)},
      {"late_channels", late_channels_json(diagnosis)},
      {"kept_out_change", kept_out_change_json(diagnosis, hypotheses)},
      {"error_places", error_places_json(diagnosis)},
      {"freed_model", freed_model_json(diagnosis.freed_model)},
      {"doubted_model", freed_model_json(diagnosis.doubted_model)},
      {"shapes_compared", diagnosis.shapes_compared},
      {"departures", departures_json(diagnosis, hypotheses)},
      {"shared_characteristics", shared_json(diagnosis, hypotheses)},
      {"fit",
       {{"before",
         fit_json(diagnosis.before, diagnosis.validation_before, diagnosis.noise_is_known)},
        {"after", fit_json(diagnosis.after, diagnosis.validation_after, diagnosis.noise_is_known)},
        {"seconds_ahead", diagnosis.after.seconds_ahead},
        {"validation_within_errors",
         diagnosis.validation_within_errors && diagnosis.noise_is_known
             ? number(diagnosis.validation_within_errors->chi_square_per_dof())
             : Json(nullptr)}}},
      {"parameters", model_parameters_json(diagnosis)},
      {"next_experiment", next_json(diagnosis, hypotheses)}};
}

}  // namespace graybox
