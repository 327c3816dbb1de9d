#include "diagnosis/final_fit/disturbance_beside.hpp"

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/final_fit/held_out_judging.hpp"
#include "diagnosis/prediction_error/unmodelled_force.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// A fit whose filter follows a disturbance.
struct DisturbedFit {
  PredictionTask task;
  VectorXd weights;
  DisturbanceForce disturbance;
  JudgedModel found;
  double log_likelihood = 0.0;
};

// Whether the laws foretell whole recordings: what a disturbance does to them is next to nothing.
bool runs_true(const LastFit& last) {
  constexpr double kNext = 0.02;  // of the signal
  return last.judged_by.is_free() && !last.found.fit.model.laws.empty() &&
         (last.found.error.array() < kNext * last.data->output_scale().array()).all();
}

// The force is estimated anew with the laws that it leaves: what they lacked, it had.
std::optional<DisturbedFit> follow_disturbance(LastFit& last, const JudgedModel& from,
                                               const UnmodelledForce& rest, Index horizon) {
  constexpr int kRounds = 2;
  constexpr double kSettled = 0.05;  // of its size
  std::optional<DisturbedFit> result;
  DisturbanceForce disturbance = rest.force()->disturbance;
  ExtendedLumpedModel model = from.fit.model;
  for (int round = 0; round < kRounds; ++round) {
    last.task = last.data->windows(horizon);
    last.disturbance = disturbance;
    JudgedModel found = last.weighed(model);
    if (!found.fit.usable) return result;
    const auto force =
        likeliest_force(*last.data, found.fit.model, last.findings->intensity, last.threads);
    if (!force) return result;
    model = found.fit.model;
    const double change = std::abs(force->disturbance.deviation - disturbance.deviation);
    const bool is_settled = change < kSettled * disturbance.deviation;
    if (!result || force->log_likelihood > result->log_likelihood) {
      result = DisturbedFit{last.task, last.weights, disturbance, std::move(found),
                            force->log_likelihood};
    }
    if (is_settled) return result;
    disturbance = force->disturbance;
  }
  return result;
}

}  // namespace

void fit_beside_disturbance(LastFit& last) {
  constexpr double kWorse = 1.5, kWorseFree = 4.0;
  if (last.findings->has_free_run) return;
  const UnmodelledForce rest(*last.data, *last.findings, last.found.fit.model, last.threads);
  if (rest.force() == nullptr || rest.multiple_of_noise() <= kNoiseMultiple) return;
  if (runs_true(last)) return;
  const Index first = last.data->first_horizon();
  const Index longest = rest.foreseeable(kDisturbedShare).value_or(first);
  last.remaining = rest.force()->disturbance;
  const JudgedModel before = last.found;
  DisturbedFit best{last.task, last.weights, {}, last.found, rest.force()->log_likelihood};
  for (const Index ahead : {first, 3 * first}) {
    const Index horizon = last.findings->samples_of(*last.data, ahead);
    if (horizon > longest && ahead > first) break;
    std::optional<DisturbedFit> beside = follow_disturbance(last, before, rest, horizon);
    if (!beside || !(beside->log_likelihood > best.log_likelihood)) continue;
    const double limit = last.judged_by.is_free() ? kWorseFree : kWorse;
    const bool is_worse = (beside->found.error.array() > limit * before.error.array()).any();
    if (!is_worse) best = *std::move(beside);
  }
  last.task = best.task;
  last.weights = best.weights;
  last.disturbance = best.disturbance;
  last.found = std::move(best.found);
}

}  // namespace graybox
