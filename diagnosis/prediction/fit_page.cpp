#include "diagnosis/prediction/fit_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

namespace graybox {
namespace {

const Implausibility* flaw_of(const FitReport& report, const std::string& parameter) {
  const auto flaw = std::ranges::find(report.implausible, parameter, &Implausibility::quantity);
  return flaw == report.implausible.end() ? nullptr : &*flaw;
}

PageCell plausibility_cell(const FitReport& report, std::size_t p) {
  if (const Implausibility* flaw = flaw_of(report, report.parameters[p].name)) {
    return {flaw->excludes ? "no machine has that" : "not determined", flaw->words,
            PageMark::kFailed};
  }
  if (!std::isfinite(report.standard_error(p))) return {"not told", {}, PageMark::kOpen};
  return {"plausible", {}, PageMark::kPassed};
}

PageTable parameters_table(const FitReport& report) {
  PageTable table{"Parameters",
                  {{"parameter"},
                   {"value", true},
                   {"standard error", true},
                   {"unit"},
                   {"start", true},
                   {"plausible?"}},
                  {}};
  for (std::size_t p = 0; p < report.parameters.size(); ++p) {
    const FittedParameter& each = report.parameters[p];
    const double error = report.standard_error(p);
    table.rows.push_back(
        {{each.name},
         with_band({fmt::format("{:.5g}", each.value)}, each.value, error),
         {std::isfinite(error) ? fmt::format("{:.2g}", error) : "–"},
         {each.unit},
         {std::isfinite(each.start) ? fmt::format("{:.4g}", each.start) : std::string("–")},
         plausibility_cell(report, p)});
  }
  return table;
}

std::vector<PageCell> quality_row(const std::string& name, const FitQuality& quality) {
  return {
      {name},
      {std::to_string(quality.recordings)},
      {fmt::format("{:.4g}", quality.nrmse)},
      {fmt::format("{:.4f}", quality.variance_accounted_for)},
      {std::isfinite(quality.chi_square_per_dof) ? fmt::format("{:.3f}", quality.chi_square_per_dof)
                                                 : std::string("–")}};
}

PageTable quality_table(const FitReport& report) {
  PageTable table{"How well it fits",
                  {{"recordings"},
                   {"how many", true},
                   {"error, % of the signal", true},
                   {"variance accounted for, %", true},
                   {"χ² per degree of freedom", true}},
                  {}};
  table.rows.push_back(quality_row("of the fit", report.estimation));
  if (report.validation) {
    table.rows.push_back(quality_row("kept out of the fit", *report.validation));
  }
  return table;
}

// The traces of the fitted model with those of the stated one between, where there is one.
std::vector<Trace> traces_of(const FitPredictions& predictions) {
  if (!predictions.after) return {};
  std::vector<Trace> traces = prediction_traces(*predictions.after);
  std::vector<Trace> before;
  if (predictions.before) before = prediction_traces(*predictions.before);
  for (Trace& trace : traces) {
    const auto same = std::ranges::find_if(before, [&trace](const Trace& other) {
      return other.recording == trace.recording && other.channel == trace.channel &&
             other.time.size() == trace.time.size();
    });
    trace.series[1].name = "predicted after";
    if (same == before.end()) continue;
    trace.series.insert(trace.series.begin() + 1,
                        {"predicted before", std::move(same->series[1].values)});
    if (!same->words.empty()) trace.words += " As stated: " + same->words;
  }
  std::ranges::stable_partition(traces, [](const Trace& trace) { return trace.is_kept_out; });
  return traces;
}

std::vector<std::string> sentences_of(const FitReport& report) {
  const std::size_t told = static_cast<std::size_t>(
      std::ranges::count_if(report.parameters, [&report](const FittedParameter& each) {
        return std::isfinite(
            report.standard_error(static_cast<std::size_t>(&each - report.parameters.data())));
      }));
  std::vector<std::string> sentences{
      fmt::format("The recordings tell {} of {} parameters.", told, report.parameters.size())};
  const FitQuality& judged = report.validation ? *report.validation : report.estimation;
  sentences.push_back(fmt::format("On {} the error is {:.3g} % of the signal.",
                                  report.validation ? "recordings kept out of the fit"
                                                    : "the recordings of the fit, the only ones,",
                                  judged.nrmse));
  if (const std::size_t flaws = excluding(report.implausible); flaws > 0) {
    sentences.push_back(fmt::format("{} of the values {} none that a machine has.", flaws,
                                    flaws == 1 ? "is" : "are"));
  }
  return sentences;
}

PageSection next_section(const FitReport& report, const std::string& model_text) {
  PageSection section{.id = "next", .title = "What to do next"};
  for (const UnseenCombination& each : report.identifiability.unseen) {
    section.points.push_back("Not told by the recordings: " + each.words +
                             ". Record motion that shows it, or state one of them.");
  }
  for (const std::string& name : report.identifiability.weak) {
    section.points.push_back("Told badly: " + name + ".");
  }
  for (const Implausibility& flaw : report.implausible) {
    section.points.push_back(flaw.words + " " + flaw.remedy);
  }
  section.points.push_back("Find out whether physics is missing:");
  section.commands.push_back(fmt::format("graybox diagnose {} {} -o report",
                                         model_text.empty() ? report.model : "fitted_model.yaml",
                                         report.campaign));
  if (!model_text.empty()) {
    section.downloads.push_back({"fitted_model.yaml", model_text, "the model with these values"});
  }
  return section;
}

}  // namespace

std::string fit_page(const FitReport& report, const FitPredictions& predictions,
                     const std::string& model_text, const PageOrigin& origin) {
  ReportPage page;
  page.title = "Fit of " + std::filesystem::path(report.model).filename().string();
  page.verdict = "Fit: " + report.status;
  page.tone = !report.converged() || excluding(report.implausible) > 0 ? PageMark::kFailed
                                                                       : PageMark::kPassed;
  page.sentences = sentences_of(report);
  PageSection parameters{.id = "parameters", .title = "Parameters"};
  parameters.paragraphs.push_back(
      "A bar below a value: the value and one standard error to either side, on a line from zero "
      "to "
      "twice the value.");
  parameters.tables = {parameters_table(report), quality_table(report)};
  parameters.paragraphs.push_back("Method: " + report.method + ".");
  page.sections.push_back(std::move(parameters));
  page.traces = traces_of(predictions);
  if (!page.traces.empty()) {
    page.sections.push_back(
        {.id = "traces",
         .title = "Measured against predicted",
         .paragraphs = {"Grey, wide: measured. Orange, dashed: predicted by the model as it was "
                        "stated. Blue: with the fitted values. Their errors are those of graybox "
                        "predict, which starts from what it sees first."},
         .has_traces = true});
  }
  page.sections.push_back(next_section(report, model_text));
  if (!report.notes.empty()) {
    page.sections.push_back({.id = "notes", .title = "What to know", .points = report.notes});
  }
  page.origin = origin;
  return html_page(page);
}

}  // namespace graybox
