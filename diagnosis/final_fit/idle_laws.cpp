#include "diagnosis/final_fit/idle_laws.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <utility>

#include "diagnosis/final_fit/held_out_judging.hpp"
#include "diagnosis/final_fit/size_errors.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"
#include "diagnosis/predictor/residual_whitener.hpp"
#include "diagnosis/predictor/told_law.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

constexpr double kMissedNearby = 3.0;  // z
constexpr double kToldFromNone = 2.5;  // standard errors of a law's size

// One sample ahead a law must predict what was kept out, too: there a better state is no excuse.
bool is_borne_out(const LastFit& last, const JudgedModel& without) {
  constexpr double kHeldOutEvidence = 25.0;  // chi-square
  if (last.evidence_over(without) < kInnovationEvidence) return false;
  if (!last.data->has_validation()) return true;
  const PredictionTask task = last.data->windows(last.task.horizon, ExperimentRole::kValidation);
  const PredictionFitter ahead = last.fitter(task);
  const PredictionFit poorer = ahead.fit(without.fit.model, last.weights, {}, 0, false);
  const PredictionFit richer = ahead.fit(last.found.fit.model, last.weights, {}, 0, false);
  if (!poorer.usable || !richer.usable) return false;
  return white_evidence(task, last.data->output_count(), poorer.residuals, richer.residuals) >
         kHeldOutEvidence;
}

// A law without which the fit does as well; or one that few machines have and that takes less
// than its share of the cost. Recordings kept out have no say here: after the samples that are
// seen their error is that of the state, of which the best law may have more than a poor one.
bool is_worth_nothing(const LastFit& last, std::size_t hypothesis, const JudgedModel& without) {
  if (last.findings->followed) return !is_borne_out(last, without);
  if (is_idle(without.fit, last.found.fit)) return true;
  const double gain = 1.0 - last.found.fit.cost / without.fit.cost;
  return !last.hypotheses->is_plain(hypothesis) && gain < kRareGain;
}

// Whether the fit needs the law for most of what it explains.
bool takes_most_of_cost(const LastFit& last, const JudgedModel& without, double z) {
  return takes_most(1.0 - last.found.fit.cost / without.fit.cost, last.evidence_over(without), z);
}

// z that a law must have to stay.
double least_z(const LastFit& last) {
  if (!last.findings->followed) return kMissedLaw;
  return last.data->has_validation() ? kInnovationErrors : kMissedNearby;
}

// Friction at one speed and one standstill has a least size and hardly a largest: its error says
// that its size is not told, and the fit without it that it is there. A channel that would be later
// than the search allows is something else.
bool is_surely_there(const LastFit& last, const PlacedFinding& law, const JudgedModel& without) {
  constexpr double kNearlyAll = 0.9, kSure = 100.0;  // of the cost, chi-square
  return last.hypotheses->acts_in_moments(law.hypothesis) &&
         !is_late_at_bound(last.found.fit, law) && !turns_its_drive(last.found.fit, law) &&
         1.0 - last.found.fit.cost / without.fit.cost > kNearlyAll &&
         last.evidence_over(without) > kSure;
}

// z of a law on the rung where it was accepted, beside the others found.
double missed_nearby(const LastFit& last, const PlacedFinding& law) {
  const auto accepted = std::ranges::find(last.findings->laws, last.accepted_as(law.hypothesis),
                                          &AcceptedLaw::hypothesis);
  if (accepted == last.findings->laws.end() || accepted->horizon == 0) return -kMissedLaw;
  const PredictionTask task =
      last.data->windows(last.findings->samples_of(*last.data, accepted->horizon));
  const PredictionFitter near(*last.data, task, last.findings->intensity, last.threads,
                              last.remaining);
  const VectorXd& scale = last.data->output_scale();
  const PredictionFit present = near.fit(last.found.fit.model, scale, {}, 0);
  if (!present.usable) return -kMissedLaw;
  const VectorXd weights = near.errors(present, scale).cwiseMax(1e-9 * scale);
  const PredictionFit with = near.fit(last.found.fit.model, weights, {}, kLastFitIterations);
  const PredictionFit without =
      near.fit(without_part(with.model, law.part), weights, with.initials, kLastFitIterations);
  if (!with.usable || !without.usable || is_idle(without, with)) return -kMissedLaw;
  if (!is_told(with, law)) return -kMissedLaw;
  return last.hypotheses->z_of_law(law.hypothesis, without, with);
}

// Whether whole recordings need a law that short windows beside a disturbance do not: these are
// foretold with it, and not without it, however the rest is fitted.
bool is_needed_in_free_run(const LastFit& last, const JudgedModel& without) {
  constexpr double kWell = 0.05, kTimes = 3.0;  // of the signal, and of the error
  if (!last.judged_by.is_free() || last.task.is_free()) return false;
  const VectorXd& scale = last.data->output_scale();
  const double with = relative_size(last.found.error, scale);
  if (with > kWell || relative_size(without.error, scale) < kTimes * with) return false;
  const PredictionFitter whole = last.fitter(last.judged_by);
  const PredictionFit refit = whole.fit(without.fit.model, scale, {}, kLastFitIterations);
  return !refit.usable || relative_size(whole.errors(refit, scale), scale) > kTimes * with;
}

}  // namespace

bool is_told(const PredictionFit& fit, const PlacedFinding& law) {
  return has_told_parameter(fit, deviations_of(fit), law, kToldFromNone);
}

// Without a law a model may leave its valley: where it does worse than the model as given, which it
// contains, or where a law that few machines have seems to be worth nearly all. Then it is fitted
// again over longer and longer windows.
JudgedModel refitted_without(const LastFit& last, const PlacedFinding& law) {
  constexpr double kNearlyAll = 4.0;  // times the cost
  const ExtendedLumpedModel model = without_part(last.found.fit.model, law.part);
  JudgedModel direct = last.judged(model, kLastFitIterations);
  const VectorXd& scale = last.data->output_scale();
  const bool is_poor = !direct.fit.usable ||
                       (last.as_given.fit.usable && relative_size(direct.error, scale) >
                                                        relative_size(last.as_given.error, scale));
  const bool is_doubtful = !last.hypotheses->is_plain(law.hypothesis) &&
                           !(direct.fit.cost < kNearlyAll * last.found.fit.cost);
  if (!is_poor && !is_doubtful) return direct;
  const ExtendedLumpedModel climbing = last.climbed(model);
  JudgedModel again = last.judged(climbing, kManyLastFitIterations);
  const bool is_better =
      again.fit.usable && (!direct.fit.usable || again.fit.cost < direct.fit.cost);
  return is_better ? std::move(again) : std::move(direct);
}

void drop_idle_laws(LastFit& last) {
  while (!last.found.fit.model.laws.empty()) {
    std::optional<JudgedModel> poorest;
    double least = least_z(last);
    for (const PlacedFinding& law : last.found.fit.model.laws) {
      JudgedModel poorer = refitted_without(last, law);
      if (!poorer.fit.usable) continue;
      const bool is_plain = last.hypotheses->is_plain(law.hypothesis);  // others must predict, too
      const bool is_nothing =
          is_worth_nothing(last, law.hypothesis, poorer) ||
          (!is_told(last.found.fit, law) && !is_surely_there(last, law, poorer)) ||
          (!is_plain && raises_held_out(last, poorer, last.found));
      const double z = is_nothing
                           ? -kMissedLaw
                           : last.hypotheses->z_of_law(law.hypothesis, poorer.fit, last.found.fit);
      const bool may_be_hidden = last.task.is_free() && !last.findings->has_free_run;
      if (z >= least || (may_be_hidden && missed_nearby(last, law) >= kMissedNearby)) continue;
      if (last.hypotheses->acts_in_moments(law.hypothesis) && takes_most_of_cost(last, poorer, z) &&
          !raises_held_out(last, poorer, last.found, 1.0)) {
        continue;
      }
      if (is_needed_in_free_run(last, poorer)) continue;
      least = z;
      poorest = std::move(poorer);
    }
    if (!poorest) return;
    last.found = std::move(*poorest);
  }
}

bool drop_undetermined_law(LastFit& last) {
  const PredictionFit& fit = last.found.fit;
  for (const PlacedFinding& law : fit.model.laws) {
    const bool is_wave = fit.model.model.parts[law.part].law_name == "ripple";
    const ToldSize size = told_size(fit, last.found.deviations, law, is_wave ? kToldFromNone : 1.0);
    const bool has_told_size =
        size.is_told && !has_loose_frequency(fit, last.found.deviations, law) &&
        !swings_too_slowly(fit, law, *last.data) && !is_late_at_bound(fit, law) &&
        !turns_its_drive(fit, law) && !is_longer_than_the_way(fit, law, last.motion());
    if (!size.is_free || has_told_size) continue;
    JudgedModel without = last.judged(without_part(fit.model, law.part), kLastFitIterations);
    if (!without.fit.usable || is_surely_there(last, law, without)) continue;
    last.found = std::move(without);
    return true;
  }
  return false;
}

}  // namespace graybox
