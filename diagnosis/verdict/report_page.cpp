#include "diagnosis/verdict/report_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/verdict/curve_traces.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "diagnosis/verdict/law_figure.hpp"
#include "diagnosis/verdict/report_tables.hpp"
#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {
namespace {

constexpr std::size_t kShownSpectra = 14;
constexpr std::size_t kNamedLaws = 3;

// ---- figures ----------------------------------------------------------------------------------

// Over the axes that its force follows from; over both where none is enough.
std::vector<ReportFigure> law_figures(const Diagnosis& diagnosis,
                                      std::span<const Hypothesis> hypotheses, std::size_t effect) {
  if (effect >= diagnosis.pictures.size()) return {};
  const ForcePicture& picture = diagnosis.pictures[effect];
  if (picture.law_force.empty()) return {};
  const std::string name = element_name(diagnosis.effects[effect], hypotheses);
  const bool by_rate = is_function_of_axis(picture, true);
  const bool by_deflection = is_function_of_axis(picture, false);
  std::vector<ReportFigure> figures;
  const auto add = [&](bool over_rate) {
    figures.push_back({fmt::format("law_{}_over_{}", effect + 1, over_rate ? "rate" : "deflection"),
                       svg_chart(law_chart(picture, name, over_rate))});
  };
  if (by_deflection || !by_rate) add(false);
  if (by_rate || !by_deflection) add(true);
  return figures;
}

ReportFigure spectrum_figure(const ResidualCurve& before, const ResidualCurve* after,
                             std::size_t number) {
  Chart chart;
  chart.title = before.channel + (before.experiment.empty() ? "" : ", " + before.experiment) +
                (before.held_out ? ", kept out of the fit" : "");
  chart.x = {"frequency, Hz", true};
  chart.y = {fmt::format("rms, {}", before.unit), true};
  chart.series.push_back({"measured", before.axis, before.measured, "#777777", true});
  chart.series.push_back({"left before", before.axis, before.residual, "#d55e00", true});
  if (after != nullptr) {
    chart.series.push_back({"left after", after->axis, after->residual, "#0072b2", true});
  }
  if (!before.noise.empty()) {
    chart.series.push_back({"noise", before.axis, before.noise, "#202020", false});
  }
  return {fmt::format("spectrum_{}", number + 1), svg_chart(chart)};
}

std::vector<ReportFigure> spectrum_figures(const Diagnosis& diagnosis) {
  std::vector<ReportFigure> figures;
  for (const ResidualCurve& before : diagnosis.curves_before) {
    if (before.over_time) continue;
    if (figures.size() >= kShownSpectra) break;
    figures.push_back(spectrum_figure(
        before, diagnosis.effects.empty() ? nullptr : same_curve(diagnosis.curves_after, before),
        figures.size()));
  }
  return figures;
}

std::vector<ReportFigure> trace_figures(const Diagnosis& diagnosis) {
  std::vector<ReportFigure> figures;
  for (const Trace& trace : diagnosis_traces(diagnosis)) {
    figures.push_back({fmt::format("trace_{}", figures.size() + 1), svg_chart(trace_chart(trace))});
  }
  return figures;
}

ReportFigure change_figure(const TimeVariation& change) {
  std::vector<double> times;
  for (std::size_t i = 0; i < change.course.size(); ++i) {
    times.push_back(change.duration * static_cast<double>(i) /
                    static_cast<double>(change.course.size() - 1));
  }
  Chart chart;
  chart.title = "What changes: " + change.coefficient + " at " + change.place;
  chart.x.label = "time in the recording that tells most, s";
  chart.y.label =
      "change of " + change.coefficient + (change.unit == "1" ? "" : ", " + change.unit);
  chart.series = {{"", times, change.course}};
  return {"time_variation", svg_chart(chart)};
}

std::vector<ReportFigure> all_maps(const Diagnosis& diagnosis) {
  const double highest = highest_of(diagnosis.mismatch_before);
  std::vector<ReportFigure> maps = band_maps(diagnosis.mismatch_before, "before", highest);
  if (!diagnosis.effects.empty()) {
    std::ranges::move(band_maps(diagnosis.mismatch_after, "after", highest),
                      std::back_inserter(maps));
  }
  std::ranges::move(time_maps(diagnosis), std::back_inserter(maps));
  return maps;
}

void add_figures(std::vector<ReportFigure> figures, PageSection& section) {
  for (ReportFigure& figure : figures) section.figures.push_back({std::move(figure.svg)});
}

// ---- the verdict ------------------------------------------------------------------------------

std::string error_sentence(const Diagnosis& diagnosis) {
  const bool is_kept_out = diagnosis.validation_before && diagnosis.validation_after;
  const double before =
      is_kept_out ? diagnosis.validation_before->nrmse : diagnosis.before.estimation.nrmse;
  const double after =
      is_kept_out ? diagnosis.validation_after->nrmse : diagnosis.after.estimation.nrmse;
  const char* const where =
      is_kept_out ? "recordings kept out of the fit" : "the recordings of the fit, the only ones,";
  if (diagnosis.effects.empty()) {
    return fmt::format("On {} the model's error is {:.3g} % of the signal.", where, after);
  }
  return fmt::format("On {} the error {} from {:.3g} % to {:.3g} % of the signal.", where,
                     after <= before ? "falls" : "rises", before, after);
}

std::string laws_words(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  std::string names;
  const std::size_t shown = std::min(kNamedLaws, diagnosis.effects.size());
  for (std::size_t i = 0; i < shown; ++i) {
    const std::size_t at = diagnosis.effects[i].law.hypothesis;
    names += (i == 0                              ? ""
              : i + 1 == diagnosis.effects.size() ? " and "
                                                  : ", ") +
             hypothesis_words(hypotheses[at]);
  }
  if (shown < diagnosis.effects.size()) {
    names += fmt::format(" and {} more", diagnosis.effects.size() - shown);
  }
  return names;
}

std::string change_sentence(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (!diagnosis.kept_out_change) return "";
  const KeptOutChange& change = *diagnosis.kept_out_change;
  return fmt::format(
      "Fitted by themselves, recordings kept out ask for other sizes: {} ({:.3g} %).",
      changed_size_words(diagnosis, change.sizes.front(), hypotheses), change.error_fitted);
}

std::string tests_sentence(const Diagnosis& diagnosis) {
  if (diagnosis.verdict == Verdict::kNone) return "";
  const auto failed = std::ranges::find_if(diagnosis.reasons, has_failed);
  const auto asked = std::ranges::count_if(
      diagnosis.reasons, [](const VerdictReason& each) { return each.not_tested.empty(); });
  if (asked == 0) return "";
  const auto count = std::ranges::count_if(diagnosis.reasons, has_failed);
  if (count == 0) return fmt::format("It passes all {} tests that could be asked.", asked);
  std::string sentence = fmt::format("It fails {} of {} tests", count, asked);
  if (failed->value) {
    sentence +=
        fmt::format(", first: {}, {:.3g} where {} {:.4g} is allowed", failed->test, *failed->value,
                    failed->is_lower_limit ? "at least" : "at most", failed->limit);
  }
  return sentence + ".";
}

PageMark tone_of(Verdict verdict) {
  if (verdict == Verdict::kUnknown) return PageMark::kFailed;
  return verdict == Verdict::kAmbiguous ? PageMark::kOpen : PageMark::kPassed;
}

std::vector<PageBar> error_bars(const Diagnosis& diagnosis) {
  const bool is_kept_out = diagnosis.validation_before && diagnosis.validation_after;
  const double before =
      is_kept_out ? diagnosis.validation_before->nrmse : diagnosis.before.estimation.nrmse;
  const double after =
      is_kept_out ? diagnosis.validation_after->nrmse : diagnosis.after.estimation.nrmse;
  const double whole = std::max({before, after, 1e-9});
  if (!std::isfinite(whole)) return {};
  if (diagnosis.effects.empty()) return {};
  return {{"before", before / whole, fmt::format("{:.3g} %", before)},
          {"after", after / whole, fmt::format("{:.3g} %", after)}};
}

// ---- sections ---------------------------------------------------------------------------------

PageSection reasons_section(const Diagnosis& diagnosis) {
  PageSection section{.id = "reasons", .title = "Why this verdict"};
  section.tables.push_back(reasons_table(diagnosis));
  return section;
}

PageSection next_section(const Diagnosis& diagnosis, const DiagnosedFiles& files,
                         const ReportContext& context) {
  PageSection section{.id = "next", .title = "What to do next"};
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (!has_failed(reason) || reason.next.empty()) continue;
    if (diagnosis.verdict == Verdict::kNone) continue;
    std::string point = reason.test + ": " + reason.next + ".";
    point[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(point[0])));
    section.points.push_back(std::move(point));
  }
  const NextQuestion question = next_question(diagnosis);
  if (question.rival != nullptr) {
    section.points.push_back(next_experiment_words(*question.rival->next));
  }
  section.downloads = context.plans;
  if (!context.plans.empty() && context.plans.front().name.ends_with(".yaml")) {
    section.commands.push_back(
        fmt::format("graybox simulate {} {} -o next", files.model, context.plans.front().name));
  }
  std::ranges::copy(context.models, std::back_inserter(section.downloads));
  if (diagnosis.verdict == Verdict::kNone) {
    section.paragraphs.push_back(
        "Nothing: the model as it is will do for motion like the recorded one.");
  } else if (section.points.empty()) {
    section.paragraphs.push_back("No test asks for more recordings.");
  }
  return section;
}

PageSection traces_section(bool has_laws) {
  return {
      .id = "traces",
      .title = "Measured against predicted",
      .paragraphs = {has_laws ? "Grey, wide: measured. Orange, dashed: predicted by the model as "
                                "it was stated. Blue: with the laws found."
                              : "Grey, wide: measured. Orange, dashed: predicted."},
      .has_traces = true};
}

PageSection laws_section(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  PageSection section{.id = "laws", .title = "What was found"};
  section.tables.push_back(laws_table(diagnosis, hypotheses));
  section.paragraphs.push_back(
      "A bar below a value: the value and one standard error to either side, on a line from zero "
      "to "
      "twice the value.");
  for (std::size_t effect = 0; effect < diagnosis.effects.size(); ++effect) {
    add_figures(law_figures(diagnosis, hypotheses, effect), section);
  }
  if (!section.figures.empty()) {
    section.paragraphs.push_back(
        "Points: the measured force less all the rest of the model. Line and band: the fitted law, "
        "and the rms distance of the points from it. Without points the recordings say too little "
        "of "
        "the force.");
  }
  return section;
}

PageSection misfit_section(const Diagnosis& diagnosis) {
  PageSection section{.id = "misfit", .title = "Where it does not fit"};
  if (diagnosis.effects.empty()) section.paragraphs.push_back("No law was found.");
  if (const std::string words = map_words(diagnosis); !words.empty()) {
    section.paragraphs.push_back(words);
  }
  section.tables.push_back(errors_table(diagnosis));
  if (!diagnosis.channels_after.empty()) section.tables.push_back(channels_table(diagnosis));
  add_figures(all_maps(diagnosis), section);
  if (diagnosis.time_variation) {
    add_figures({change_figure(*diagnosis.time_variation)}, section);
  }
  add_figures(spectrum_figures(diagnosis), section);
  return section;
}

PageSection rivals_section(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  PageSection section{.id = "rivals", .title = "What was tried and rejected", .is_folded = true};
  if (!diagnosis.rejected.empty()) section.tables.push_back(rejected_table(diagnosis, hypotheses));
  for (const FoundEffect& effect : diagnosis.effects) {
    section.tables.push_back(rivals_table(effect, hypotheses, diagnosis.noise_is_known));
  }
  return section;
}

std::vector<PageSection> sections_of(const Diagnosis& diagnosis,
                                     std::span<const Hypothesis> hypotheses,
                                     const DiagnosedFiles& files, const ReportContext& context,
                                     bool has_traces) {
  std::vector<PageSection> sections;
  if (!diagnosis.reasons.empty() && diagnosis.verdict != Verdict::kNone) {
    sections.push_back(reasons_section(diagnosis));
  }
  sections.push_back(next_section(diagnosis, files, context));
  if (diagnosis.trouble.empty()) {
    if (has_traces) sections.push_back(traces_section(!diagnosis.effects.empty()));
    if (!diagnosis.effects.empty()) sections.push_back(laws_section(diagnosis, hypotheses));
    if (!diagnosis.after.model_parameters.empty()) {
      PageSection own{.id = "parameters", .title = "The model's own parameters"};
      own.tables.push_back(parameters_table(diagnosis));
      sections.push_back(std::move(own));
    }
    if (diagnosis.before.usable) sections.push_back(misfit_section(diagnosis));
    PageSection rivals = rivals_section(diagnosis, hypotheses);
    if (!rivals.tables.empty()) sections.push_back(std::move(rivals));
    if (!diagnosis.detectable.empty()) {
      PageSection seen{.id = "detectable", .title = "What would have been seen", .is_folded = true};
      seen.tables.push_back(detectable_table(diagnosis, hypotheses));
      sections.push_back(std::move(seen));
    }
  }
  PageSection words{.id = "words", .title = "The verdict in full", .is_folded = true};
  words.points = verdict_words(diagnosis, hypotheses);
  for (const std::string& line : files.warnings) words.points.push_back("The recordings: " + line);
  sections.push_back(std::move(words));
  return sections;
}

}  // namespace

std::vector<std::string> verdict_in_short(const Diagnosis& diagnosis,
                                          std::span<const Hypothesis> hypotheses) {
  std::string first = headline(diagnosis);
  if (!diagnosis.effects.empty() && diagnosis.verdict != Verdict::kUnknown) {
    first.pop_back();
    first += ": " + laws_words(diagnosis, hypotheses) + ".";
  } else if (!diagnosis.effects.empty()) {
    const std::size_t end = first.find_first_of(".;");
    const bool is_any_found = std::ranges::any_of(
        diagnosis.effects, [&](const auto& effect) { return !is_doubtful(effect, diagnosis); });
    first = first.substr(0, end) + (is_any_found ? "; found " : "; not confirmed: ") +
            laws_words(diagnosis, hypotheses) + ".";
  }
  std::vector<std::string> sentences{std::move(first)};
  if (!diagnosis.trouble.empty() || !diagnosis.before.usable) return sentences;
  sentences.push_back(error_sentence(diagnosis));
  for (const std::string& more :
       {change_sentence(diagnosis, hypotheses), tests_sentence(diagnosis)}) {
    if (!more.empty()) sentences.push_back(more);
  }
  return sentences;
}

std::vector<ReportFigure> report_figures(const Diagnosis& diagnosis,
                                         std::span<const Hypothesis> hypotheses) {
  std::vector<ReportFigure> figures = trace_figures(diagnosis);
  for (std::size_t effect = 0; effect < diagnosis.effects.size(); ++effect) {
    std::ranges::move(law_figures(diagnosis, hypotheses, effect), std::back_inserter(figures));
  }
  std::ranges::move(all_maps(diagnosis), std::back_inserter(figures));
  if (diagnosis.time_variation) figures.push_back(change_figure(*diagnosis.time_variation));
  std::ranges::move(spectrum_figures(diagnosis), std::back_inserter(figures));
  return figures;
}

std::string report_page(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses,
                        const DiagnosedFiles& files, const ReportContext& context) {
  ReportPage page;
  page.title = "Diagnosis of " + std::filesystem::path(files.model).filename().string();
  page.verdict = fmt::format("Verdict: {}", to_string(diagnosis.verdict));
  page.tone = tone_of(diagnosis.verdict);
  page.sentences = verdict_in_short(diagnosis, hypotheses);
  page.traces = diagnosis.trouble.empty() ? diagnosis_traces(diagnosis) : std::vector<Trace>{};
  if (diagnosis.trouble.empty() && diagnosis.before.usable) {
    page.bars = error_bars(diagnosis);
    page.bars_title = fmt::format(
        "Error on {}{}, % of the signal",
        diagnosis.validation_after ? "recordings kept out" : "the recordings of the fit",
        ahead_words(diagnosis.after));
  }
  page.sections = sections_of(diagnosis, hypotheses, files, context, !page.traces.empty());
  page.origin = context.origin;
  if (page.origin.files.empty()) {
    page.origin.files = {{files.model, "model"}, {files.campaign, "campaign"}};
  }
  return html_page(page);
}

}  // namespace graybox
