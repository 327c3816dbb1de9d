#include "diagnosis/final_fit/held_out_judging.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>

#include "diagnosis/final_fit/size_errors.hpp"
#include "diagnosis/prediction_error/search_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStands = 3.0;  // noises, of what is kept out

// The relative standard error of each output's mean square, by blocks.
Eigen::ArrayXd relative_errors(const LastFit& last, const PredictionFit& fit) {
  const Index outputs = last.data->output_count();
  const auto blocks = static_cast<Index>(fit.edges.size()) - 1;
  Eigen::ArrayXXd squares = Eigen::ArrayXXd::Zero(outputs, blocks);
  for (Index b = 0; b < blocks; ++b) {
    const Index from = fit.edges[static_cast<std::size_t>(b)];
    const Index to = fit.edges[static_cast<std::size_t>(b) + 1];
    for (Index i = from; i < to; ++i) squares(i % outputs, b) += std::pow(fit.residuals(i), 2);
  }
  const auto count = static_cast<double>(blocks);
  const Eigen::ArrayXd mean = squares.rowwise().mean().max(1e-300);
  return ((squares.colwise() - mean).square().rowwise().sum() / count / std::max(count - 1.0, 1.0))
             .sqrt() /
         mean;
}

// A free run starts from a state that the filter finds by the model that runs, as in predict.
PredictionFitter judge_of(const LastFit& last, const ExtendedLumpedModel& model,
                          const PredictionTask& ahead, bool runs_free) {
  if (!runs_free || last.disturbance.is_there()) return last.fitter(ahead);
  return {*last.data, ahead, start_intensity(model, *last.data, last.threads), last.threads};
}

// The scales of the outputs kept out, and which of them stand still.
void take_held_out_scale(const LastFit& last, const PredictionTask& task, JudgedModel& model) {
  const VectorXd &noise = last.data->noise(), &scale = last.data->output_scale();
  VectorXd squares = VectorXd::Zero(last.data->output_count());
  double samples = 0.0;
  for (const PredictionRun& one : task.runs) {
    const MatrixXd& outputs = last.data->recording(one.recording).outputs;
    const Eigen::RowVectorXd mean = outputs.colwise().mean();
    squares += (outputs.rowwise() - mean).colwise().squaredNorm().transpose();
    samples += static_cast<double>(outputs.rows());
  }
  VectorXd size = (squares / samples).cwiseSqrt();
  model.stands_held_out.clear();
  for (Index j = 0; j < size.size(); ++j) {
    const bool stands = size(j) < kStands * noise(j);
    if (stands) size(j) = scale(j);
    model.stands_held_out.push_back(stands);
  }
  model.held_out_scale = size;
}

}  // namespace

PredictionTask held_out_task(const LastFit& last, const PredictionTask& task) {
  return task.is_free() ? last.data->free_after_start(ExperimentRole::kValidation)
                        : last.data->windows(task.horizon, ExperimentRole::kValidation);
}

std::optional<HeldOutError> held_out_by(const LastFit& last, const ExtendedLumpedModel& model,
                                        const PredictionTask& task) {
  if (!last.data->has_validation()) return {};
  const PredictionTask kept_out = held_out_task(last, task);
  if (kept_out.counted() == 0) return {};
  const PredictionFitter ahead = judge_of(last, model, kept_out, task.is_free());
  const PredictionFit run = ahead.fit(model, last.weights, {}, 0, false);
  if (!run.usable) return {};
  return HeldOutError{task.horizon, ahead.errors(run, last.weights)};
}

std::optional<HeldOutError> law_error_held_out(const LastFit& last, const JudgedModel& model) {
  if (!model.fit.usable) return {};
  return held_out_by(last, model.fit.model,
                     last.disturbance.is_there() ? last.task : last.judged_by);
}

bool raises_held_out(const LastFit& last, const JudgedModel& without, const JudgedModel& with,
                     double least) {
  const auto after = law_error_held_out(last, with), before = law_error_held_out(last, without);
  if (!after || !before) return false;
  const VectorXd& scale = last.data->output_scale();
  return relative_size(after->error, scale) > least * relative_size(before->error, scale);
}

void judge_held_out(const LastFit& last, JudgedModel& model) {
  if (!last.data->has_validation() || !model.fit.usable) return;
  const PredictionTask task = held_out_task(last, last.judged_by);
  take_held_out_scale(last, task, model);
  model.held_out_trouble.clear();
  if (task.counted() == 0) {
    model.held_out_trouble = "the recordings kept out are shorter than what the fit was judged by";
    return;
  }
  const PredictionFitter whole = judge_of(last, model.fit.model, task, last.judged_by.is_free());
  const PredictionFit run = whole.fit(model.fit.model, last.weights, {}, 0, false);
  if (run.usable) {
    model.held_out_error = whole.errors(run, last.weights);
  } else {
    model.held_out_trouble = "the simulation of the recordings kept out leaves all bounds";
  }
}

JudgedModel fit_of_kept_out(const LastFit& last) {
  JudgedModel own;
  if (!last.data->has_validation() || !last.found.fit.usable) return own;
  const PredictionTask task = held_out_task(last, last.judged_by);
  const PredictionFitter whole =
      judge_of(last, last.found.fit.model, task, last.judged_by.is_free());
  own.fit = whole.fit(last.found.fit.model, last.weights, {}, kLastFitIterations);
  if (!own.fit.usable) return own;
  own.error = whole.errors(own.fit, last.weights);
  own.deviations = deviations_of(own.fit);
  return own;
}

std::optional<HeldOutError> error_held_out_ahead(const LastFit& last,
                                                 const ExtendedLumpedModel& model,
                                                 const UnmodelledForce& rest, double share) {
  const std::optional<Index> horizon = rest.foreseeable(share);
  if (!horizon || *horizon == 0 || !last.data->has_validation()) return {};
  const PredictionTask task = last.data->windows(*horizon, ExperimentRole::kValidation);
  const PredictionFitter ahead = last.fitter(task);
  const PredictionFit run = ahead.fit(model, last.weights, {}, 0, false);
  if (!run.usable || task.runs.front().counted() == 0) return {};
  return HeldOutError{*horizon, ahead.errors(run, last.weights)};
}

std::optional<HeldOutGrowth> growth_kept_out(const LastFit& last, const UnmodelledForce& rest) {
  if (!last.found.held_out_error) return {};
  const std::optional<Index> ahead = rest.foreseeable(kDisturbedShare);
  const Index horizon = last.findings->has_free_run || !ahead ? 0 : *ahead;
  if (horizon == 0 && !last.findings->has_free_run) return {};
  const auto errors = [&](ExperimentRole role, VectorXd& error) -> std::optional<Eigen::ArrayXd> {
    const PredictionTask task =
        horizon == 0 ? last.data->free_after_start(role) : last.data->windows(horizon, role);
    const PredictionFitter run = judge_of(last, last.found.fit.model, task, horizon == 0);
    const PredictionFit fit = run.fit(last.found.fit.model, last.weights, {}, 0, false);
    if (!fit.usable || task.counted() == 0) return {};
    error = run.errors(fit, last.weights);
    return relative_errors(last, fit);
  };
  VectorXd inside, outside;
  const auto of_fit = errors(ExperimentRole::kEstimation, inside);
  const auto kept_out = errors(ExperimentRole::kValidation, outside);
  if (!of_fit || !kept_out) return {};
  const VectorXd noise = last.data->noise();
  const Eigen::ArrayXd of_signals =
      last.found.held_out_scale.array() / last.data->output_scale().array();
  const double larger = std::max(1.0, last.data->growth_of_inputs());
  HeldOutGrowth growth;
  growth.ratio = (outside.array().max(noise.array()) / inside.array().max(noise.array()) /
                  of_signals.max(larger))
                     .matrix();
  growth.deviation = 0.5 * (of_fit->square() + kept_out->square()).sqrt().matrix();
  return growth;
}

std::vector<ResidualCurve> curves_of(const LastFit& last, const JudgedModel& model) {
  std::vector<ResidualCurve> curves;
  if (!model.fit.usable) return curves;
  const std::string how =
      last.judged_by.is_free()
          ? "in free run"
          : fmt::format("{:.3g} s ahead",
                        last.data->sample_time() * static_cast<double>(last.judged_by.horizon));
  if (last.data->has_validation()) {
    const PredictionTask task = held_out_task(last, last.judged_by);
    const PredictionFit run = judge_of(last, model.fit.model, task, last.judged_by.is_free())
                                  .fit(model.fit.model, last.weights, {}, 0, false);
    if (run.usable) add_prediction_curves(*last.data, task, run, last.weights, how, true, curves);
  }
  const bool is_far = last.judged_by.horizon != last.task.horizon;
  const PredictionFit run =
      is_far ? last.fitter(last.judged_by)
                   .fit(model.fit.model, last.weights, {}, kLastFitIterationsOfStates, false)
             : model.fit;
  if (run.usable) {
    add_prediction_curves(*last.data, is_far ? last.judged_by : last.task, run, last.weights, how,
                          false, curves);
  }
  return curves;
}

}  // namespace graybox
