#include "diagnosis/verdict/reason_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kNamedFiles = 4;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json held_out_json(const std::optional<HeldOutEffect>& effect) {
  if (!effect) return nullptr;
  return {{"error_without", number(effect->error_without)},
          {"error_with", number(effect->error_with)},
          {"gain", number(effect->gain)},
          {"seconds_ahead", effect->seconds_ahead}};
}

std::string result_words(const VerdictReason& reason) {
  if (!reason.not_tested.empty()) return "not tested: " + reason.not_tested;
  return reason.passed ? "passed" : "failed";
}

std::string value_words(const VerdictReason& reason) {
  if (!reason.value) return "";
  std::string value = fmt::format("{:.3g}", *reason.value);
  const std::string limit = fmt::format("{:.3g}", reason.limit);
  if (value == limit && !reason.passed) value = fmt::format("{:.6g}", *reason.value);
  return fmt::format(" {}, limit {} {}", value, reason.is_lower_limit ? "at least" : "at most",
                     limit);
}

std::string listed(const std::vector<std::string>& names) {
  std::string words;
  for (std::size_t i = 0; i < std::min(names.size(), kNamedFiles); ++i) {
    words += (i > 0 ? ", " : "") + names[i];
  }
  if (names.size() > kNamedFiles) words += fmt::format(" and {} more", names.size() - kNamedFiles);
  return words;
}

std::string errors_words(const HeldOutEffect& effect) {
  const std::string ahead =
      effect.seconds_ahead > 0.0 ? fmt::format("{:.3g} s ahead ", effect.seconds_ahead) : "";
  return fmt::format("{}from {:.4g} % to {:.4g} %", ahead, effect.error_without, effect.error_with);
}

}  // namespace

std::vector<std::string> reason_lines(const Diagnosis& diagnosis) {
  std::vector<std::string> lines;
  if (diagnosis.verdict == Verdict::kNone) return lines;
  for (const VerdictReason& reason : diagnosis.reasons) {
    std::string line =
        fmt::format("Test: {}{}: {}.", reason.test, value_words(reason), result_words(reason));
    if (has_failed(reason) && !reason.next.empty()) line += " Next: " + reason.next + ".";
    lines.push_back(std::move(line));
  }
  return lines;
}

std::vector<std::string> rejected_lines(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses) {
  constexpr std::size_t kTold = 5;  // with their reasons
  std::vector<std::string> lines;
  std::string others;
  for (std::size_t i = 0; i < diagnosis.rejected.size(); ++i) {
    const RejectedLaw& rejected = diagnosis.rejected[i];
    if (i >= kTold) {
      const std::string name = hypothesis_words(hypotheses[rejected.law.hypothesis]);
      if (others.find(name) == std::string::npos) others += (others.empty() ? "" : "; ") + name;
      continue;
    }
    std::string line =
        fmt::format("Tried and rejected: {}: {}",
                    hypothesis_words(hypotheses[rejected.law.hypothesis]), rejected.reason);
    if (rejected.held_out) {
      line += fmt::format(" (error kept out {})", errors_words(*rejected.held_out));
    }
    lines.push_back(line + ".");
  }
  if (!others.empty()) lines.push_back("Tried and rejected, too: " + others + ".");
  return lines;
}

namespace {

std::string departures_words(const std::vector<std::string>& departures) {
  constexpr std::size_t kMost = 5;  // that are named
  const std::size_t shown = std::min(kMost, departures.size());
  const std::span<const std::string> named(departures.data(), shown);
  return fmt::format(
      "Off most: {}{}.", fmt::join(named, "; "),
      shown < departures.size() ? fmt::format("; and {} more", departures.size() - shown) : "");
}

}  // namespace

std::vector<std::string> freed_model_lines(const Diagnosis& diagnosis) {
  std::vector<std::string> lines;
  if (diagnosis.doubted_model) {
    const FreedModel& doubted = *diagnosis.doubted_model;
    lines.push_back(fmt::format(
        "The bodies of the links {} as the model states them: with these free{}, the error on "
        "recordings kept out falls from {:.4g} % to {:.4g} %. Check masses and centres of mass; "
        "`body_uncertainty: 0.1` in the model has a diagnosis take them along.",
        doubted.instead_of.empty() ? "are not" : "may not be",
        doubted.instead_of.empty()
            ? ""
            : fmt::format(" and without {}", fmt::join(doubted.instead_of, ", ")),
        doubted.error_stated, doubted.error_freed));
    if (!doubted.departures.empty()) lines.push_back(departures_words(doubted.departures));
  }
  if (!diagnosis.freed_model) return lines;
  const FreedModel& freed = *diagnosis.freed_model;
  lines.push_back(fmt::format(
      "The bodies of the links were free within their uncertainty (body_uncertainty in the model): "
      "beside plain laws that changes the error on {} from {:.4g} % to {:.4g} %.",
      freed.on_kept_out ? "recordings kept out" : "the recordings of the fit", freed.error_stated,
      freed.error_freed));
  if (!freed.departures.empty()) lines.push_back(departures_words(freed.departures));
  return lines;
}

std::string held_out_words(const FoundEffect& effect, const Diagnosis& diagnosis) {
  if (!diagnosis.validation_after && !diagnosis.after.trouble.empty()) {
    return fmt::format(" What it predicts was not tested: {}.", diagnosis.after.trouble);
  }
  if (!diagnosis.validation_after && diagnosis.interrupted) {
    return " It was stopped before what it predicts was tested.";
  }
  if (!diagnosis.validation_after) {
    return " Nothing was kept out of the fit, so what it predicts was not tested.";
  }
  if (!effect.held_out) return "";
  const HeldOutEffect& held_out = *effect.held_out;
  if (held_out.gain > 0.0) {
    return fmt::format(
        " On recordings kept out it changes the error{} {}, {:.3g} % of its square{}.",
        held_out.channels.empty() ? "" : " of " + held_out.channels, errors_words(held_out),
        100.0 * held_out.gain, held_out.channels.empty() ? " over the noise" : "");
  }
  return fmt::format(" On recordings kept out it {} ({}).",
                     held_out.misleads ? "raises the error" : "makes no difference beyond chance",
                     errors_words(held_out));
}

std::string range_words(const CheckedRange& range) {
  if (range.files.empty()) return "";
  std::string words =
      fmt::format("Checked on {} ({}), within",
                  range.kept_out ? "recordings kept out of the fit" : "the fit's own recordings",
                  listed(range.files));
  constexpr std::size_t kShown = 6;  // of more than one over
  const std::size_t shown = range.spans.size() > kShown + 1 ? kShown : range.spans.size();
  for (std::size_t i = 0; i < shown; ++i) {
    const CheckedRange::Span& span = range.spans[i];
    words += fmt::format("{} {} {:.3g} to {:.3g}{}", i > 0 ? "," : "", span.quantity, span.from,
                         span.to, span.unit.empty() ? "" : " " + span.unit);
  }
  if (shown < range.spans.size()) {
    words +=
        fmt::format(", and {} more (checked_range in verdict.json)", range.spans.size() - shown);
  }
  if (!range.positions.empty()) words += ", positions " + listed(range.positions);
  return words + ". Nothing is said beyond.";
}

Json reasons_json(const Diagnosis& diagnosis) {
  Json list = Json::array();
  for (const VerdictReason& reason : diagnosis.reasons) {
    Json& each = list.emplace_back();
    each = {{"test", reason.test},
            {"value", reason.value ? number(*reason.value) : Json(nullptr)},
            {"limit", number(reason.limit)},
            {"limit_is", reason.is_lower_limit ? "at_least" : "at_most"},
            {"passed", reason.not_tested.empty() ? Json(reason.passed) : Json(nullptr)},
            {"otherwise", to_string(reason.otherwise)}};
    if (!reason.not_tested.empty()) each["not_tested"] = reason.not_tested;
    if (has_failed(reason)) each["next"] = reason.next;
  }
  return list;
}

Json freed_model_json(const std::optional<FreedModel>& model) {
  if (!model) return nullptr;
  const FreedModel& freed = *model;
  return {{"error_stated", freed.error_stated},
          {"error_freed", freed.error_freed},
          {"on_kept_out", freed.on_kept_out},
          {"departures", freed.departures},
          {"instead_of", freed.instead_of}};
}

Json rejected_json(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  Json list = Json::array();
  for (const RejectedLaw& rejected : diagnosis.rejected) {
    const Hypothesis& hypothesis = hypotheses[rejected.law.hypothesis];
    list.push_back({{"place", hypothesis.place},
                    {"law", hypothesis.law},
                    {"reason", rejected.reason},
                    {"held_out", held_out_json(rejected.held_out)}});
  }
  return list;
}

Json range_json(const CheckedRange& range) {
  if (range.files.empty()) return nullptr;
  Json spans = Json::array();
  for (const CheckedRange::Span& span : range.spans) {
    spans.push_back({{"quantity", span.quantity},
                     {"unit", span.unit},
                     {"from", number(span.from)},
                     {"to", number(span.to)}});
  }
  return {{"kept_out", range.kept_out},
          {"files", range.files},
          {"positions", range.positions},
          {"spans", std::move(spans)}};
}

}  // namespace graybox
