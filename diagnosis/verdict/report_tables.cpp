#include "diagnosis/verdict/report_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "diagnosis/evidence/search_options.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {
namespace {

using Row = std::vector<PageCell>;

std::string number(double value, const char* format = "{:.4g}") {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string("–");
}

std::string spaced(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

// An estimate whose value and error stay on one line.
std::string unbroken(std::string words) {
  const std::string sign = " ± ";
  if (const std::size_t at = words.find(sign); at != std::string::npos) {
    words.replace(at, sign.size(), "\u00a0±\u00a0");
  }
  return words;
}

PageCell estimate_cell(const LawParameterEstimate& estimate) {
  return with_band({unbroken(estimate_words(estimate))}, estimate.value, estimate.standard_error);
}

PageMark mark_of(const VerdictReason& reason) {
  if (!reason.not_tested.empty()) return PageMark::kOpen;
  return reason.passed ? PageMark::kPassed : PageMark::kFailed;
}

const char* result_of(const VerdictReason& reason) {
  if (!reason.not_tested.empty()) return "not tested";
  return reason.passed ? "passed" : "failed";
}

Row reason_row(const VerdictReason& reason) {
  std::string note;
  if (!reason.not_tested.empty()) note = reason.not_tested;
  if (has_failed(reason) && !reason.next.empty()) note = "Next: " + reason.next;
  const std::string limit = !reason.value           ? "–"
                            : reason.is_lower_limit ? fmt::format("≥\u00a0{:.4g}", reason.limit)
                                                    : fmt::format("≤\u00a0{:.4g}", reason.limit);
  return {{reason.test, note},
          {result_of(reason), {}, mark_of(reason)},
          {reason.value ? fmt::format("{:.3g}", *reason.value) : "–"},
          {limit}};
}

// The flaw of a parameter, of the model or of a law at a place; null if it has none.
const Implausibility* flaw_of(const Diagnosis& diagnosis, const std::string& name,
                              const std::string& place) {
  for (const Implausibility& flaw : diagnosis.implausible) {
    const bool is_own = place.empty() && flaw.quantity == name;
    const bool is_law = !place.empty() && flaw.quantity.starts_with(name + " of ") &&
                        flaw.quantity.find(place) != std::string::npos;
    if (is_own || is_law) return &flaw;
  }
  return nullptr;
}

// Whether a machine has such a parameter, and the recordings tell it.
PageCell plausibility_cell(const Diagnosis& diagnosis, const LawParameterEstimate& estimate,
                           const std::string& place) {
  if (estimate.sets_scale) return {"stated", {}, PageMark::kNone};
  if (const Implausibility* flaw = flaw_of(diagnosis, estimate.name, place)) {
    return {flaw->excludes ? "no machine has that" : "not determined", flaw->words,
            PageMark::kFailed};
  }
  if (!std::isfinite(estimate.error())) return {"no standard error", {}, PageMark::kOpen};
  if (!is_determined(estimate)) return {"not determined", {}, PageMark::kFailed};
  if (!diagnosis.plausibility_judged) return {"not judged", {}, PageMark::kOpen};
  return {"plausible", {}, PageMark::kPassed};
}

std::string gain_words(const FoundEffect& effect) {
  if (!effect.held_out) return "not tested: no recordings kept out";
  return fmt::format("{:.3g} % → {:.3g} %", effect.held_out->error_without,
                     effect.held_out->error_with);
}

std::string gain_note(const FoundEffect& effect) {
  if (!effect.held_out) return "";
  if (effect.held_out->misleads) return "it raises the error";
  std::string words = fmt::format("takes {:.3g} % of the square", 100.0 * effect.held_out->gain);
  if (!effect.held_out->channels.empty()) words += ", " + effect.held_out->channels;
  return words;
}

std::string parameters_of(const FittedLaw& law) {
  std::string words;
  for (const LawParameterEstimate& estimate : law.parameters) {
    words += (words.empty() ? "" : "; ") + spaced(estimate.name) + " " + estimate_words(estimate);
  }
  return words;
}

// Evidence against it.
std::string evidence_of(double difference, bool noise_is_known) {
  if (!std::isfinite(difference)) return "–";
  if (noise_is_known) return fmt::format("{:+.3g}", difference);
  constexpr double kCounted = 1000.0;  // beyond, blocks could not be predicted at all
  const double errors = std::sqrt(std::abs(difference));
  if (!(errors < kCounted)) return difference < 0.0 ? "far better" : "far worse";
  return fmt::format("{}{:.2g}", difference < 0.0 ? "−" : "+", errors);
}

std::string exclusion_of(const Rival& rival) {
  if (rival.is_contradicted) return "contradicted by recordings kept out";
  if (rival.on_few_recordings) return "excluded by few recordings";
  const bool would_stand = rival.bic_difference <= SearchOptions{}.exclusion_margin;
  return would_stand && rival.held_out_difference ? "excluded with recordings kept out"
                                                  : "excluded";
}

class RivalRows {
 public:
  RivalRows(Hypotheses hypotheses, bool noise_is_known)
      : hypotheses_(hypotheses), noise_is_known_(noise_is_known) {}

  void add(const FittedLaw& law, const std::string& role, double difference) {
    rows_.push_back({{hypothesis_words(hypotheses_[law.hypothesis])},
                     {role},
                     {evidence_of(difference, noise_is_known_)},
                     {parameters_of(law)}});
  }
  void add(const Rival& rival, const std::string& role) {
    add(rival.law, role, rival.bic_difference);
    for (const FittedLaw& law : rival.with) {
      add(law, "together with the one above", rival.bic_difference);
    }
    for (const FittedLaw& law : rival.same_at) add(law, "the same system", rival.bic_difference);
  }
  [[nodiscard]] std::vector<Row> take() { return std::move(rows_); }

 private:
  Hypotheses hypotheses_;
  bool noise_is_known_;
  std::vector<Row> rows_;
};

Row errors_row(const std::string& name, const std::optional<Assessment>& before,
               const std::optional<Assessment>& after, bool noise_is_known) {
  Row row{{name}, {number(before->nrmse)}, {number(after->nrmse)}};
  if (noise_is_known) {
    row.push_back({number(before->chi_square_per_dof())});
    row.push_back({number(after->chi_square_per_dof())});
  }
  return row;
}

std::string held_out_error(const ChannelRest* rest) {
  return rest != nullptr && rest->held_out_nrmse ? number(*rest->held_out_nrmse) : "–";
}

}  // namespace

PageTable reasons_table(const Diagnosis& diagnosis) {
  PageTable table{"Tests that the verdict follows from",
                  {{"test"}, {"result"}, {"value", true}, {"limit", true}},
                  {}};
  for (const VerdictReason& reason : diagnosis.reasons) table.rows.push_back(reason_row(reason));
  return table;
}

PageTable laws_table(const Diagnosis& diagnosis, Hypotheses hypotheses) {
  PageTable table{"Laws found",
                  {{"law and place"},
                   {"parameter"},
                   {"value ± standard error", true},
                   {"plausible?"},
                   {"error kept out without it → with it"}},
                  {}};
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& hypothesis = hypotheses[effect.law.hypothesis];
    bool is_first = true;
    for (const LawParameterEstimate& estimate : effect.law.parameters) {
      const PageCell law =
          is_first ? PageCell{hypothesis_words(hypothesis),
                              (is_doubtful(effect, diagnosis) ? "not confirmed: " : "") +
                                  effect_sentence(hypothesis, effect)}
                   : PageCell{""};
      const PageCell gain =
          is_first ? PageCell{gain_words(effect), gain_note(effect)} : PageCell{""};
      table.rows.push_back({law,
                            {spaced(estimate.name)},
                            estimate_cell(estimate),
                            plausibility_cell(diagnosis, estimate, hypothesis.place),
                            gain});
      is_first = false;
    }
  }
  return table;
}

PageTable parameters_table(const Diagnosis& diagnosis) {
  const auto& before = diagnosis.before.model_parameters;
  const auto& after = diagnosis.after.model_parameters;
  const bool has_laws = !diagnosis.effects.empty();
  PageTable table{
      "Parameters of the model",
      {{"parameter"}, {has_laws ? "without the laws found" : "value ± standard error", true}},
      {}};
  if (has_laws) table.columns.push_back({"with them", true});
  table.columns.push_back({"plausible?"});
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    Row row{{after[i].name}, estimate_cell(before[i])};
    if (has_laws) row.push_back(estimate_cell(after[i]));
    row.push_back(plausibility_cell(diagnosis, after[i], ""));
    table.rows.push_back(std::move(row));
  }
  return table;
}

PageTable errors_table(const Diagnosis& diagnosis) {
  PageTable table{"Errors before and after",
                  {{"recordings"}, {"error before, % of the signal", true}, {"after", true}},
                  {}};
  if (diagnosis.noise_is_known) {
    table.columns.push_back({"χ² per degree of freedom before", true});
    table.columns.push_back({"after", true});
  }
  table.rows.push_back(errors_row("of the fit", diagnosis.before.estimation,
                                  diagnosis.after.estimation, diagnosis.noise_is_known));
  if (diagnosis.validation_before && diagnosis.validation_after) {
    table.rows.push_back(errors_row("kept out of the fit", diagnosis.validation_before,
                                    diagnosis.validation_after, diagnosis.noise_is_known));
  }
  return table;
}

PageTable channels_table(const Diagnosis& diagnosis) {
  PageTable table{"Errors by channel, % of its signal",
                  {{"channel"}, {"fit, before", true}, {"fit, after", true}},
                  {}};
  const bool is_kept_out =
      std::ranges::any_of(diagnosis.channels_after,
                          [](const ChannelRest& rest) { return rest.held_out_nrmse.has_value(); });
  if (is_kept_out) {
    table.columns.push_back({"kept out, before", true});
    table.columns.push_back({"kept out, after", true});
  }
  for (const ChannelRest& after : diagnosis.channels_after) {
    const auto before =
        std::ranges::find(diagnosis.channels_before, after.channel, &ChannelRest::channel);
    const bool is_there = before != diagnosis.channels_before.end();
    Row row{{after.channel}, {is_there ? number(before->nrmse) : "–"}, {number(after.nrmse)}};
    if (is_kept_out) {
      row.push_back({held_out_error(is_there ? &*before : nullptr)});
      row.push_back({held_out_error(&after)});
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

PageTable rivals_table(const FoundEffect& effect, Hypotheses hypotheses, bool noise_is_known) {
  RivalRows rows(hypotheses, noise_is_known);
  rows.add(effect.law, "found", 0.0);
  for (const FittedLaw& law : effect.same_at) rows.add(law, "the same system", 0.0);
  for (const Rival& rival : effect.rivals) rows.add(rival, "not excluded");
  for (const Rival& rival : effect.generalisations) rows.add(rival, "more general, not asked for");
  for (const Rival& rival : effect.excluded) rows.add(rival, exclusion_of(rival));
  return {"In place of " + hypothesis_words(hypotheses[effect.law.hypothesis]),
          {{"law and place"},
           {"what became of it"},
           {noise_is_known ? "BIC" : "prediction worse by, standard errors", true},
           {"parameters"}},
          rows.take()};
}

PageTable rejected_table(const Diagnosis& diagnosis, Hypotheses hypotheses) {
  PageTable table{"Tried and rejected",
                  {{"law and place"}, {"error kept out without it → with it"}, {"why"}},
                  {}};
  for (const RejectedLaw& rejected : diagnosis.rejected) {
    const std::string change =
        rejected.held_out ? fmt::format("{:.4g} % → {:.4g} %", rejected.held_out->error_without,
                                        rejected.held_out->error_with)
                          : "–";
    table.rows.push_back(
        {{hypothesis_words(hypotheses[rejected.law.hypothesis])}, {change}, {rejected.reason}});
  }
  return table;
}

PageTable detectable_table(const Diagnosis& diagnosis, Hypotheses hypotheses) {
  PageTable table{"The smallest effects that would have been seen",
                  {{"law and place"}, {"smallest size", true}, {"unit"}},
                  {}};
  for (const DetectableEffect& effect : diagnosis.detectable) {
    table.rows.push_back(
        {{hypothesis_words(hypotheses[effect.hypothesis])},
         {std::isfinite(effect.amplitude) ? number(effect.amplitude) : "can't be seen"},
         {effect.unit}});
  }
  return table;
}

}  // namespace graybox
