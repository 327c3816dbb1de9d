#include "diagnosis/final_fit/last_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "diagnosis/predictor/left_out_blocks.hpp"
#include "diagnosis/predictor/residual_whitener.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

}  // namespace

PredictionFitter LastFit::fitter(const PredictionTask& ahead) const {
  return {*data, ahead, findings->filter_intensity(), threads, disturbance};
}

JudgedModel LastFit::judged(const ExtendedLumpedModel& model, int iterations) const {
  JudgedModel result;
  result.horizon = judged_by.horizon;
  const PredictionFitter near = fitter(task);
  result.fit = near.fit(model, weights, {}, iterations);
  if (!result.fit.usable) return result;
  result.error = near.errors(result.fit, weights);
  if (judged_by.horizon == task.horizon) return result;
  const PredictionFitter far = fitter(judged_by);
  const PredictionFit run =
      far.fit(result.fit.model, weights, {}, kLastFitIterationsOfStates, false);
  result.error = run.usable ? far.errors(run, weights) : 1e3 * data->output_scale();
  return result;
}

// By what a first fit leaves.
JudgedModel LastFit::weighed(const ExtendedLumpedModel& model) {
  const VectorXd& scale = data->output_scale();
  const PredictionFitter near = fitter(task);
  const PredictionFit fit = near.fit(model, scale, {}, kLastFitIterations);
  if (!fit.usable) return {};
  weights = near.errors(fit, scale).cwiseMax(1e-9 * scale);
  return judged(fit.model, kLastFitIterations);
}

ExtendedLumpedModel LastFit::climbed(ExtendedLumpedModel model) const {
  const VectorXd& scale = data->output_scale();
  std::vector<double> intensities{findings->intensity};
  if (!(findings->intensity > 0.0)) intensities = force_noise_intensities(*data);
  for (const Index times : {1, 3, 10, 30, 100}) {
    const Index samples = findings->samples_of(*data, times * data->first_horizon());
    if (!task.is_free() && samples >= task.horizon) break;
    if (data->window_count(samples) < kFewestHorizonWindows) break;
    const PredictionTask rung = data->windows(samples);
    PredictionFit best;
    for (const double intensity : intensities) {
      const PredictionFitter windows(*data, rung, intensity, threads, disturbance);
      PredictionFit fit = windows.fit(model, scale, {}, kLastFitIterations);
      if (!fit.usable || (best.usable && best.cost <= fit.cost)) continue;
      best = std::move(fit);
    }
    if (!best.usable) break;
    model = std::move(best.model);
  }
  return model;
}

bool LastFit::is_thinned() const { return findings->sample_time > 1.5 * data->sample_time(); }

JudgedModel LastFit::best_of_starts(const ExtendedLumpedModel& model, std::size_t hypothesis,
                                    std::optional<std::size_t> replaced) const {
  constexpr double kStart = 0.1;       // of what acts at all
  constexpr int kFirstIterations = 6;  // from each; the best goes on
  std::vector<LawExtension> starts = hypotheses->extensions(model, motion());
  std::erase_if(starts, [&](const LawExtension& start) {
    return start.hypothesis != hypothesis || start.replaces != replaced;
  });
  JudgedModel best;
  for (const LawExtension& start : starts) {
    JudgedModel each = judged(extended(model, start, kStart * start.unit),
                              starts.size() > 1 ? kFirstIterations : kLastFitIterations);
    if (each.fit.usable && (!best.fit.usable || each.fit.cost < best.fit.cost)) {
      best = std::move(each);
    }
  }
  if (best.fit.usable && starts.size() > 1) best = judged(best.fit.model, kLastFitIterations);
  return best;
}

JudgedModel LastFit::with_law(const JudgedModel& poorer, std::size_t hypothesis) const {
  return best_of_starts(poorer.fit.model, hypothesis, {});
}

double LastFit::z_over(const JudgedModel& poorer) const { return z_between(poorer.fit, found.fit); }

MatrixXd LastFit::motion() const { return fitter(task).motion(found.fit); }

double LastFit::evidence_over(const JudgedModel& poorer) const {
  return white_evidence(task, data->output_count(), poorer.fit.residuals, found.fit.residuals);
}

std::size_t LastFit::accepted_as(std::size_t hypothesis) const {
  const auto at = accepted.find(hypothesis);
  return at == accepted.end() ? hypothesis : at->second;
}

}  // namespace graybox
