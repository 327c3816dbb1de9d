#include "diagnosis/prediction/model_prediction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnosis/prediction/kinds.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

std::string percent(double value) {
  if (std::isnan(value)) return "too short";
  return std::isfinite(value) ? fmt::format("{:.3g}", value) : std::string("leaves all bounds");
}

PageTable table_of(const ModelPrediction& prediction) {
  PageTable table{"Errors",
                  {{"recording"},
                   {"role"},
                   {"channel"},
                   {"predicted"},
                   {"error, rms", true},
                   {"% of the signal", true}},
                  {}};
  for (const RecordingPrediction& recording : prediction.recordings) {
    for (const PredictedChannel& channel : recording.channels) {
      table.rows.push_back({{recording.recording},
                            {name_of(recording.role)},
                            {channel.name},
                            {prediction_words(prediction, recording.ahead)},
                            {fmt::format("{:.3g} {}", channel.error, channel.unit)},
                            {percent(channel.nrmse())}});
    }
  }
  return table;
}

// Of a channel over the longest horizon; null where its motion leaves all bounds.
const PredictedChannel* longest_of(const ModelPrediction& prediction, const PredictionCurve& curve,
                                   bool& is_kept_out) {
  for (const RecordingPrediction& recording : prediction.recordings) {
    if (recording.ahead > 0.0 || recording.recording != curve.recording) continue;
    is_kept_out = recording.role == ExperimentRole::kValidation;
    for (const PredictedChannel& channel : recording.channels) {
      if (channel.name == curve.channel) return &channel;
    }
  }
  return nullptr;
}

// The channel predicted worst, in one sentence.
std::string worst_sentence(const ModelPrediction& prediction) {
  const PredictedChannel* worst = nullptr;
  std::string recording;
  for (const RecordingPrediction& each : prediction.recordings) {
    for (const PredictedChannel& channel : each.channels) {
      if (each.ahead > 0.0 || !std::isfinite(channel.nrmse())) continue;
      if (worst != nullptr && channel.nrmse() <= worst->nrmse()) continue;
      worst = &channel;
      recording = each.recording;
    }
  }
  if (worst == nullptr) return "";
  return fmt::format("The largest error is that of {} in {}: {:.3g} % of its signal, {}.",
                     worst->name, recording, worst->nrmse(), prediction_words(prediction, 0.0));
}

}  // namespace

std::string prediction_words(const ModelPrediction& prediction, double ahead) {
  if (prediction.of == "forces") return "at measured motion";
  return ahead > 0.0 ? fmt::format("{:.3g} s ahead", ahead) : std::string("free run");
}

ModelPrediction predict_recordings(const std::filesystem::path& model, const Campaign& campaign,
                                   const std::vector<std::filesystem::path>& physics, int threads,
                                   FreeRunStart start) {
  const YamlField format = YamlField::load(model).at("format");
  if (format.text() == "graybox-rigid-robot/1") {
    if (start == FreeRunStart::kEstimated) {
      throw InputError(fmt::format(
          "{}: a rigid robot's forces are predicted at the measured motion and have no initial "
          "state; leave --initial-state out",
          model.string()));
    }
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
  return predict_outputs(load_lumped_model(model, more), campaign, threads, start);
}

std::vector<Trace> prediction_traces(const ModelPrediction& prediction) {
  std::vector<Trace> traces;
  for (const PredictionCurve& curve : prediction.curves) {
    Trace trace{.recording = curve.recording, .channel = curve.channel, .unit = curve.unit};
    const PredictedChannel* error = longest_of(prediction, curve, trace.is_kept_out);
    if (error != nullptr && std::isfinite(error->nrmse())) {
      trace.words = fmt::format("Error {:.4g} % of the signal, {}.", error->nrmse(),
                                prediction_words(prediction, 0.0));
    }
    trace.time.assign(curve.time.begin(), curve.time.end());
    trace.series.push_back({"measured", {curve.measured.begin(), curve.measured.end()}});
    trace.series.push_back({"predicted", {curve.predicted.begin(), curve.predicted.end()}});
    traces.push_back(std::move(trace));
  }
  return traces;
}

std::string words_of_measure(const ModelPrediction& prediction) {
  const std::string words = "error (rms) over the standard deviation of the recording";
  const bool runs_free =
      prediction.of == "outputs" &&
      std::ranges::any_of(prediction.recordings,
                          [](const RecordingPrediction& each) { return !(each.ahead > 0.0); });
  if (!runs_free) return words;
  if (prediction.start == FreeRunStart::kEstimated) {
    return words +
           "; free runs begin in the state by which the whole recording is met best, which a "
           "prediction does not know";
  }
  return words +
         "; the first samples only tell the state and are not counted (in free run 200, at "
         "most half; those at rest where a short recording begins so)";
}

std::string prediction_page(const ModelPrediction& prediction, const std::string& model,
                            const std::string& campaign, const PageOrigin& origin) {
  ReportPage page;
  page.title = "Prediction by " + std::filesystem::path(model).filename().string();
  page.verdict = fmt::format("Predicted: {}", prediction.of);
  page.sentences = {"The model was taken as it stands; nothing was fitted."};
  if (std::string worst = worst_sentence(prediction); !worst.empty()) {
    page.sentences.push_back(std::move(worst));
  }
  page.traces = prediction_traces(prediction);
  if (!page.traces.empty()) {
    page.sections.push_back({.id = "traces",
                             .title = "Measured against predicted",
                             .paragraphs = {"Grey, wide: measured. Orange, dashed: predicted."},
                             .has_traces = true});
  }
  PageSection errors{.id = "errors",
                     .title = "Errors",
                     .paragraphs = {"The " + words_of_measure(prediction) + "."}};
  errors.tables.push_back(table_of(prediction));
  page.sections.push_back(std::move(errors));
  if (!prediction.notes.empty()) {
    page.sections.push_back({.id = "notes", .title = "What to know", .points = prediction.notes});
  }
  page.origin = origin;
  if (page.origin.files.empty()) page.origin.files = {{model, "model"}, {campaign, "campaign"}};
  return html_page(page);
}

}  // namespace graybox
