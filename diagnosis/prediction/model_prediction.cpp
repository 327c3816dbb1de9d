#include "diagnosis/prediction/model_prediction.hpp"

#include <fmt/format.h>

#include <cmath>

#include "diagnosis/prediction/kinds.hpp"
#include "diagnosis/verdict/svg_chart.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kDrawn = 1500;  // samples of a curve

ChartSeries series_of(const std::string& name, const PredictionCurve& curve,
                      const Eigen::VectorXd& values, const std::string& colour) {
  ChartSeries series;
  series.name = name;
  series.colour = colour;
  const Eigen::Index stride = values.size() / kDrawn + 1;
  for (Eigen::Index k = 0; k < values.size(); k += stride) {
    series.x.push_back(curve.time(k));
    series.y.push_back(values(k));
  }
  return series;
}

std::string chart_of(const PredictionCurve& curve) {
  Chart chart;
  chart.title = curve.recording + ": " + curve.channel;
  chart.x.label = "time [s]";
  chart.y.label = fmt::format("{} [{}]", curve.channel, curve.unit);
  chart.series.push_back(series_of("measured", curve, curve.measured, "#777777"));
  chart.series.push_back(series_of("predicted", curve, curve.predicted, "#0072b2"));
  return svg_chart(chart);
}

std::string percent(double value) {
  if (std::isnan(value)) return "too short";
  return std::isfinite(value) ? fmt::format("{:.3g}", value) : std::string("leaves all bounds");
}

std::string table_of(const ModelPrediction& prediction) {
  std::string rows =
      "<table><tr><th>recording</th><th>role</th><th>channel</th><th>predicted</th>"
      "<th>error (rms)</th><th>NRMSE [%]</th></tr>\n";
  for (const RecordingPrediction& recording : prediction.recordings) {
    for (const PredictedChannel& channel : recording.channels) {
      rows += fmt::format(
          "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.3g} {}</td><td>{}</td></tr>\n",
          html_escaped(recording.recording), name_of(recording.role), html_escaped(channel.name),
          prediction_words(prediction, recording.ahead), channel.error, html_escaped(channel.unit),
          percent(channel.nrmse()));
    }
  }
  return rows + "</table>\n";
}

}  // namespace

std::string prediction_words(const ModelPrediction& prediction, double ahead) {
  if (prediction.of == "forces") return "at measured motion";
  return ahead > 0.0 ? fmt::format("{:.3g} s ahead", ahead) : std::string("free run");
}

ModelPrediction predict_recordings(const std::filesystem::path& model, const Campaign& campaign,
                                   const std::vector<std::filesystem::path>& physics, int threads) {
  const YamlField format = YamlField::load(model).at("format");
  if (format.text() == "graybox-rigid-robot/1") {
    return predict_forces(load_rigid_robot(model, physics), campaign);
  }
  if (format.text() != "graybox-lumped/1") {
    format.fail(fmt::format(
        "is '{}'; recordings are predicted by graybox-lumped/1 and graybox-rigid-robot/1 models",
        format.text()));
  }
  if (physics.size() > 1) {
    throw InputError("--physics: a lumped model takes one file of further elements");
  }
  std::optional<std::filesystem::path> more;
  if (!physics.empty()) more = physics.front();
  return predict_outputs(load_lumped_model(model, more), campaign, threads);
}

std::string prediction_page(const ModelPrediction& prediction, const std::string& model,
                            const std::string& campaign) {
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<title>Prediction by {0}</title>\n<style>body {{font-family: sans-serif; max-width: 60em; "
      "margin: 2em auto;}} td, th {{padding: 0.2em 0.8em; text-align: left;}} svg {{max-width: "
      "100%;}}</style></head><body>\n<h1>What {0} predicts</h1>\n<p>Of the recordings of {1}, as "
      "the model stands: nothing was fitted. NRMSE is the root mean square of the error over the "
      "standard deviation of what was measured.</p>\n",
      html_escaped(model), html_escaped(campaign));
  page += table_of(prediction);
  for (const PredictionCurve& curve : prediction.curves) page += chart_of(curve) + "\n";
  return page + "</body></html>\n";
}

}  // namespace graybox
