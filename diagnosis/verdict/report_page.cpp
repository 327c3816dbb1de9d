#include "diagnosis/verdict/report_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/verdict/law_figure.hpp"
#include "diagnosis/verdict/reason_words.hpp"
#include "diagnosis/verdict/svg_chart.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/program_version.hpp"

namespace graybox {
namespace {

constexpr const char* kBlue = "#0072b2";
constexpr const char* kOrange = "#d55e00";
constexpr const char* kGrey = "#999999";
constexpr std::size_t kShownCurves = 14;
constexpr std::size_t kShownPoints = 4000;

constexpr const char* kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Diagnosis</title>
<style>
body { font-family: sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
  color: #202020;
       line-height: 1.45; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
table { border-collapse: collapse; margin: 0.6rem 0; }
th, td { padding: 0.25rem 0.8rem; text-align: left; border-bottom: 1px solid #d8d8d8; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
.verdict { background: #eef4fa; border-left: 5px solid #0072b2; padding: 0.7rem 1rem; }
.files { color: #606060; } svg { max-width: 100%; height: auto; }
</style></head><body>
)";

std::string paragraph(const std::string& text) { return "<p>" + html_escaped(text) + "</p>\n"; }

std::string heading(const std::string& text) { return "<h2>" + html_escaped(text) + "</h2>\n"; }

std::string end_of_page() {
  return "<p class=\"files\">" + html_escaped(written_by()) + "</p>\n</body></html>\n";
}

std::string number_cell(double value, const char* format = "{:.4g}") {
  return "<td class=\"n\">" +
         (std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string("–")) +
         "</td>";
}

// ---- the maps of residuals --------------------------------------------------------------------

struct MapPlace {
  std::string position;
  double level = 0.0;
  bool operator==(const MapPlace&) const = default;
};

template <typename Value>
std::size_t index_in(std::vector<Value>& list, const Value& value) {
  const auto found = std::find(list.begin(), list.end(), value);
  if (found != list.end()) return static_cast<std::size_t>(found - list.begin());
  list.push_back(value);
  return list.size() - 1;
}

std::string map_name(const MapPlace& place) {
  std::string name = place.position;
  if (place.level > 0.0) name += fmt::format("{}level {:g}", name.empty() ? "" : ", ", place.level);
  return name;
}

HeatMap residual_map(const std::vector<MismatchCell>& cells, const std::vector<bool>& rejected,
                     const MapPlace& place) {
  HeatMap map;
  std::vector<double> starts;
  for (const MismatchCell& cell : cells) {
    if (place == MapPlace{cell.position, cell.level}) starts.push_back(cell.from);
  }
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  for (const double start : starts) map.columns.push_back(fmt::format("{:.3g}", start));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const MismatchCell& cell = cells[i];
    if (!(place == MapPlace{cell.position, cell.level})) continue;
    const std::size_t row = index_in(map.rows, cell.channel);
    if (map.values.size() < map.rows.size()) {
      map.values.emplace_back(starts.size(), std::numeric_limits<double>::quiet_NaN());
      map.marked.emplace_back(starts.size(), false);
    }
    const auto column = static_cast<std::size_t>(
        std::lower_bound(starts.begin(), starts.end(), cell.from) - starts.begin());
    map.values[row][column] = 0.5 * std::log10(cell.statistic / cell.degrees_of_freedom);
    map.marked[row][column] = rejected[i];
  }
  map.lowest = 0.0;
  map.highest = 0.5;
  for (const auto& row : map.values) {
    for (const double value : row) {
      if (std::isfinite(value)) map.highest = std::max(map.highest, value);
    }
  }
  map.column_label = "frequency from, Hz";
  map.value_label = "log10 of rms residual over noise; framed: more than noise";
  return map;
}

std::vector<ReportFigure> residual_maps(const std::vector<MismatchCell>& cells,
                                        const std::string& when) {
  const std::vector<bool> rejected = rejected_cells(cells, kFramedRate);
  std::vector<MapPlace> places;
  for (const MismatchCell& cell : cells) (void)index_in(places, {cell.position, cell.level});
  std::vector<ReportFigure> figures;
  for (std::size_t i = 0; i < places.size(); ++i) {
    HeatMap map = residual_map(cells, rejected, places[i]);
    const std::string name = map_name(places[i]);
    map.title = "Residuals " + when + (name.empty() ? "" : ": " + name);
    figures.push_back({fmt::format("residuals_{}_{}", when, i + 1), svg_heat_map(map)});
  }
  return figures;
}

// ---- laws and curves --------------------------------------------------------------------------

// Every so many samples, so that a page stays small.
std::vector<double> thinned(const std::vector<double>& values) {
  const std::size_t stride = values.size() / kShownPoints + 1;
  std::vector<double> kept;
  for (std::size_t i = 0; i < values.size(); i += stride) kept.push_back(values[i]);
  return kept;
}

ReportFigure law_figure(const ForcePicture& picture, const std::string& name, bool over_rate,
                        std::size_t effect) {
  return {fmt::format("law_{}_over_{}", effect + 1, over_rate ? "rate" : "deflection"),
          svg_chart(law_chart(picture, name, over_rate))};
}

std::string curve_title(const ResidualCurve& curve) {
  return curve.channel + (curve.experiment.empty() ? "" : ", " + curve.experiment) +
         (curve.held_out ? ", kept out of the fit" : "");
}

ReportFigure curve_figure(const ResidualCurve& before, const ResidualCurve* after,
                          std::size_t number) {
  Chart chart;
  chart.title = curve_title(before);
  chart.x = {before.over_time ? "time, s" : "frequency, Hz", !before.over_time};
  chart.y = {fmt::format("{}, {}", before.over_time ? "signal" : "rms", before.unit),
             !before.over_time};
  chart.series.push_back(
      {"measured", thinned(before.axis), thinned(before.measured), kGrey, !before.over_time});
  chart.series.push_back(
      {"before", thinned(before.axis), thinned(before.residual), kOrange, false});
  if (after != nullptr) {
    chart.series.push_back({"after", thinned(after->axis), thinned(after->residual), kBlue, false});
  }
  if (!before.noise.empty()) {
    chart.series.push_back(
        {"noise", thinned(before.axis), thinned(before.noise), "#202020", false});
  }
  return {fmt::format("curve_{}", number + 1), svg_chart(chart)};
}

const ResidualCurve* same_curve(const std::vector<ResidualCurve>& curves,
                                const ResidualCurve& wanted) {
  for (const ResidualCurve& curve : curves) {
    if (curve.channel == wanted.channel && curve.experiment == wanted.experiment &&
        curve.held_out == wanted.held_out && curve.over_time == wanted.over_time) {
      return &curve;
    }
  }
  return nullptr;
}

std::vector<ReportFigure> curve_figures(const Diagnosis& diagnosis) {
  std::vector<ReportFigure> figures;
  for (const ResidualCurve& before : diagnosis.curves_before) {
    if (figures.size() >= kShownCurves) break;
    figures.push_back(curve_figure(
        before, diagnosis.effects.empty() ? nullptr : same_curve(diagnosis.curves_after, before),
        figures.size()));
  }
  return figures;
}

std::vector<ReportFigure> law_figures(const Diagnosis& diagnosis,
                                      std::span<const Hypothesis> hypotheses, std::size_t effect) {
  if (effect >= diagnosis.pictures.size()) return {};
  const ForcePicture& picture = diagnosis.pictures[effect];
  if (picture.law_force.empty()) return {};
  const std::string name = element_name(diagnosis.effects[effect], hypotheses);
  return {law_figure(picture, name, false, effect), law_figure(picture, name, true, effect)};
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

// ---- tables ------------------------------------------------------------------------------------

std::string fit_row(const std::string& name, const std::optional<Assessment>& before,
                    const std::optional<Assessment>& after, bool noise_is_known) {
  if (!before || !after) return "";
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  return "<tr><td>" + name + "</td>" +
         number_cell(noise_is_known ? before->chi_square_per_dof() : unknown) +
         number_cell(noise_is_known ? after->chi_square_per_dof() : unknown) +
         number_cell(before->nrmse) + number_cell(after->nrmse) +
         number_cell(before->variance_accounted_for, "{:.3f}") +
         number_cell(after->variance_accounted_for, "{:.3f}") + "</tr>\n";
}

std::string fit_table(const Diagnosis& diagnosis) {
  return "<table><tr><th rowspan=\"2\">recordings</th>"
         "<th class=\"n\" colspan=\"2\">chi-square per degree of freedom</th>"
         "<th class=\"n\" colspan=\"2\">error, % of the signal</th>"
         "<th class=\"n\" colspan=\"2\">variance accounted for, %</th></tr>\n"
         "<tr><th class=\"n\">before</th><th class=\"n\">after</th><th class=\"n\">before</th>"
         "<th class=\"n\">after</th><th class=\"n\">before</th><th class=\"n\">after</th></tr>\n" +
         fit_row("of the fit", diagnosis.before.estimation, diagnosis.after.estimation,
                 diagnosis.noise_is_known) +
         fit_row("kept out", diagnosis.validation_before, diagnosis.validation_after,
                 diagnosis.noise_is_known) +
         "</table>\n";
}

std::string law_rows(const FittedLaw& law, std::span<const Hypothesis> hypotheses, double bic,
                     const char* role) {
  std::string parameters;
  for (const LawParameterEstimate& estimate : law.parameters) {
    parameters += (parameters.empty() ? "" : "<br>") +
                  html_escaped(estimate.name + " " + estimate_words(estimate));
  }
  return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td>",
                     html_escaped(hypothesis_words(hypotheses[law.hypothesis])), role, parameters) +
         number_cell(bic, "{:+.3g}") + "</tr>\n";
}

const char* reason_of_exclusion(const Rival& rival) {
  if (rival.is_contradicted) return "contradicted by recordings kept out";
  if (rival.on_few_recordings) return "excluded by few recordings";
  const bool would_stand = rival.bic_difference <= SearchOptions{}.exclusion_margin;
  return would_stand && rival.held_out_difference ? "excluded with recordings kept out"
                                                  : "excluded";
}

std::string effect_table(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                         bool noise_is_known) {
  std::string rows =
      std::string("<table><tr><th>law and place</th><th></th><th>parameters</th><th class=\"n\">") +
      (noise_is_known ? "BIC" : "prediction, squared standard errors") + "</th></tr>\n" +
      law_rows(effect.law, hypotheses, 0.0, "found");
  const auto add_same_places = [&](const std::vector<FittedLaw>& laws, double bic) {
    for (const FittedLaw& law : laws) rows += law_rows(law, hypotheses, bic, "the same system");
  };
  const auto add_sum = [&](const Rival& rival) {
    for (const FittedLaw& law : rival.with) {
      rows += law_rows(law, hypotheses, rival.bic_difference, "together with the one above");
    }
  };
  add_same_places(effect.same_at, 0.0);
  for (const Rival& rival : effect.rivals) {
    rows += law_rows(rival.law, hypotheses, rival.bic_difference, "not excluded");
    add_sum(rival);
    add_same_places(rival.same_at, rival.bic_difference);
  }
  for (const Rival& rival : effect.generalisations) {
    rows += law_rows(rival.law, hypotheses, rival.bic_difference, "more general, not asked for");
  }
  for (const Rival& rival : effect.excluded) {
    rows += law_rows(rival.law, hypotheses, rival.bic_difference, reason_of_exclusion(rival));
    add_sum(rival);
  }
  return rows + "</table>\n";
}

std::string parameter_table(const Diagnosis& diagnosis) {
  const auto& before = diagnosis.before.model_parameters;
  const auto& after = diagnosis.after.model_parameters;
  if (after.empty()) return "";
  std::string rows = heading("The model's own parameters") +
                     "<table><tr><th>parameter</th><th>without the effects</th>"
                     "<th>with them</th></tr>\n";
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", html_escaped(after[i].name),
                        html_escaped(estimate_words(before[i])),
                        html_escaped(estimate_words(after[i])));
  }
  return rows + "</table>\n";
}

std::string detectable_table(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (diagnosis.detectable.empty()) return "";
  std::string rows = heading("The smallest effects that would have been seen") +
                     "<details><summary>all hypotheses</summary><table><tr><th>law and place</th>"
                     "<th class=\"n\">smallest amplitude</th><th>unit</th></tr>\n";
  for (const DetectableEffect& effect : diagnosis.detectable) {
    rows += "<tr><td>" + html_escaped(hypothesis_words(hypotheses[effect.hypothesis])) + "</td>" +
            (std::isfinite(effect.amplitude) ? number_cell(effect.amplitude)
                                             : "<td class=\"n\">can't be seen</td>") +
            "<td>" + html_escaped(effect.unit) + "</td></tr>\n";
  }
  return rows + "</table></details>\n";
}

std::string framed_words(const Diagnosis& diagnosis) {
  const std::string words = map_words(diagnosis);
  return words.empty() ? "" : paragraph(words);
}

void append(std::vector<ReportFigure>& all, std::vector<ReportFigure> more) {
  for (ReportFigure& figure : more) all.push_back(std::move(figure));
}

std::string drawn(const std::vector<ReportFigure>& figures) {
  std::string html;
  for (const ReportFigure& figure : figures) html += "<div>" + figure.svg + "</div>\n";
  return html;
}

}  // namespace

std::vector<ReportFigure> report_figures(const Diagnosis& diagnosis,
                                         std::span<const Hypothesis> hypotheses) {
  std::vector<ReportFigure> figures = residual_maps(diagnosis.mismatch_before, "before");
  if (diagnosis.time_variation) figures.push_back(change_figure(*diagnosis.time_variation));
  for (std::size_t effect = 0; effect < diagnosis.effects.size(); ++effect) {
    append(figures, law_figures(diagnosis, hypotheses, effect));
  }
  if (!diagnosis.effects.empty()) {
    append(figures, residual_maps(diagnosis.mismatch_after, "after"));
  }
  append(figures, curve_figures(diagnosis));
  return figures;
}

std::string report_page(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses,
                        const DiagnosedFiles& files) {
  const std::vector<std::string> words = verdict_words(diagnosis, hypotheses);
  std::string page = kHead;
  page += fmt::format("<h1>Verdict: {}</h1>\n<p class=\"files\">{}<br>{}</p>\n",
                      to_string(diagnosis.verdict), html_escaped(files.model),
                      html_escaped(files.campaign));
  page += "<div class=\"verdict\">\n";
  for (const std::string& line : words) page += paragraph(line);
  for (const std::string& line : files.warnings) page += paragraph("The recordings: " + line);
  page += "</div>\n" + reasons_table(diagnosis);
  if (!diagnosis.trouble.empty()) return page + end_of_page();
  page += heading("The fit before and after") + fit_table(diagnosis);
  if (!diagnosis.mismatch_before.empty()) {
    page += heading("Where it does not fit") +
            drawn(residual_maps(diagnosis.mismatch_before, "before"));
  }
  if (diagnosis.time_variation) {
    page += heading("What changes with time") + drawn({change_figure(*diagnosis.time_variation)});
  }
  for (std::size_t effect = 0; effect < diagnosis.effects.size(); ++effect) {
    page += heading("Effect " + std::to_string(effect + 1) + ": " +
                    element_name(diagnosis.effects[effect], hypotheses)) +
            effect_table(diagnosis.effects[effect], hypotheses, diagnosis.noise_is_known) +
            drawn(law_figures(diagnosis, hypotheses, effect));
  }
  if (!diagnosis.effects.empty() && !diagnosis.mismatch_after.empty()) {
    page += heading("What is left") + framed_words(diagnosis) +
            drawn(residual_maps(diagnosis.mismatch_after, "after"));
  }
  const std::vector<ReportFigure> curves = curve_figures(diagnosis);
  if (!curves.empty()) page += heading("Residuals against noise") + drawn(curves);
  page += parameter_table(diagnosis) + detectable_table(diagnosis, hypotheses);
  return page + end_of_page();
}

}  // namespace graybox
