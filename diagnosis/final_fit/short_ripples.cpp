#include "diagnosis/final_fit/short_ripples.hpp"

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/final_fit/held_out_judging.hpp"
#include "diagnosis/prediction_error/ripple_trials.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

// The model found with the best wave in this force; none where it does not predict better, on what
// was kept out, too.
std::optional<ExtendedLumpedModel> with_ripple(const LastFit& last, const LatentForce& force) {
  constexpr double kLeastForce = 0.01;  // amplitude over the forces that act
  constexpr double kLeastShare = 0.1, kErrors = 3.0;
  constexpr int kOfStarts = 3;  // iterations
  std::vector<RippleTrial> trials = ripple_trials(force);
  std::erase_if(trials, [&](const RippleTrial& trial) {
    return trial.share < kLeastShare ||
           std::sqrt(2.0 * trial.share) * force.rms() < kLeastForce * last.data->force_scale();
  });
  if (trials.empty()) return {};
  const PredictionTask task = last.data->windows(last.data->first_horizon());
  const PredictionFitter near(*last.data, task, last.findings->intensity, last.threads,
                              last.disturbance);
  const VectorXd& scale = last.data->output_scale();
  const PredictionFit present = near.fit(last.found.fit.model, scale, {}, 0);
  if (!present.usable) return {};
  const VectorXd weights = near.errors(present, scale).cwiseMax(1e-9 * scale);
  const PredictionFit poorer = near.fit(last.found.fit.model, weights, {}, kLastFitIterations);
  if (!poorer.usable) return {};
  PredictionFit best;
  for (const LawExtension& start :
       last.hypotheses->extensions(poorer.model, near.motion(poorer), trials)) {
    if (start.law != "ripple" || start.location.kind != LocationKind::kElement) continue;
    const double amplitude = std::sqrt(2.0 * trials.front().share) * force.rms();
    for (const double sign : {1.0, -1.0}) {
      PredictionFit fit = near.fit(extended(poorer.model, start, sign * amplitude), weights,
                                   poorer.initials, kOfStarts);
      if (fit.usable && (!best.usable || fit.cost < best.cost)) best = std::move(fit);
    }
  }
  if (best.usable) best = near.fit_on(best, weights, kLastFitIterations);
  if (!best.usable || !(z_between(poorer, best) > kErrors)) return {};
  if (is_idle(poorer, best)) return {};
  const auto before = held_out_by(last, poorer.model, task),
             after = held_out_by(last, best.model, task);
  if (before &&
      !(after && relative_size(after->error, scale) < relative_size(before->error, scale))) {
    return {};
  }
  return best.model;
}

}  // namespace

void add_short_ripples(LastFit& last) {
  constexpr int kMostRipples = 2;
  if (!last.is_thinned() || last.findings->stopped || !last.found.fit.usable) return;
  for (int k = 0; k < kMostRipples; ++k) {
    const auto force =
        likeliest_force(*last.data, last.found.fit.model, last.findings->intensity, last.threads);
    if (!force) return;
    std::optional<ExtendedLumpedModel> with = with_ripple(last, *force);
    if (!with) return;
    JudgedModel richer = last.judged(*with, kLastFitIterations);
    if (!richer.fit.usable || raises_held_out(last, last.found, richer)) return;
    last.found = std::move(richer);
  }
}

}  // namespace graybox
