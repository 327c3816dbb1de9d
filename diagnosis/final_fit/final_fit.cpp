#include "diagnosis/final_fit/final_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "diagnosis/final_fit/disturbance_beside.hpp"
#include "diagnosis/final_fit/idle_laws.hpp"
#include "diagnosis/final_fit/plainer_laws.hpp"
#include "diagnosis/final_fit/short_ripples.hpp"
#include "diagnosis/final_fit/size_errors.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

constexpr double kSkill = 0.5, kFreeSkill = 0.2;  // of the signal; in free run

// Whether this error is small beside every output's signal.
bool has_skill(const LastFit& last, const VectorXd& error) {
  const bool is_only_way = last.findings->has_free_run;
  const double limit = last.judged_by.is_free() && !is_only_way ? kFreeSkill : kSkill;
  return (error.array() < limit * last.data->output_scale().array()).all();
}

// In free run from where the search began, too: short windows may lead to another valley.
JudgedModel judged_from_both(const LastFit& last, const ExtendedLumpedModel& model) {
  JudgedModel result = last.judged(model, kLastFitIterations);
  const std::vector<double> began = last.findings->started.values();
  std::vector<double> values = model.values();
  if (!last.task.is_free() || began.size() < model.own_parameters()) return result;
  std::copy_n(began.begin(), model.own_parameters(), values.begin());
  JudgedModel other = last.judged(with_values(model, values), kLastFitIterations);
  const bool is_better =
      other.fit.usable && (!result.fit.usable || (other.fit.cost < result.fit.cost &&
                                                  z_between(result.fit, other.fit) > kMissedLaw));
  return is_better ? std::move(other) : std::move(result);
}

// The farthest ahead that has skill, with the model of the search fitted there.
void choose_horizon(LastFit& last) {
  last.found = judged_from_both(last, last.findings->found);
  if (last.found.fit.usable && has_skill(last, last.found.error)) return;
  for (auto rung = last.findings->rungs.rbegin(); rung != last.findings->rungs.rend(); ++rung) {
    last.task = last.judged_by =
        last.data->windows(last.findings->samples_of(*last.data, rung->horizon));
    last.found = last.judged(last.findings->found, kLastFitIterations);
    if (last.found.fit.usable && has_skill(last, last.found.error)) return;
  }
  if (!last.found.fit.usable) last.found = last.judged(last.findings->as_given, kLastFitIterations);
}

// Thinned inputs lead a little beside the optimum, and from there long runs over dry friction find
// no way. So the model is fitted to all samples over short windows first, too.
void climb_again(LastFit& last) {
  JudgedModel again = last.judged(last.climbed(last.found.fit.model), kLastFitIterations);
  if (again.fit.usable && again.fit.cost < last.found.fit.cost) last.found = std::move(again);
}

// A long run may say nothing of a law that shows in short ones.
void fit_where_laws_are_told(LastFit& last) {
  if (!last.task.is_free() || last.findings->has_free_run) return;
  const auto tells_all = [&](const PredictionFit& fit) {
    return std::ranges::all_of(fit.model.laws,
                               [&](const PlacedFinding& law) { return is_told(fit, law); });
  };
  if (tells_all(last.found.fit)) return;
  const PredictionTask free = last.task;
  const VectorXd weights = last.weights;
  for (auto rung = last.findings->rungs.rbegin(); rung != last.findings->rungs.rend(); ++rung) {
    last.task = last.data->windows(last.findings->samples_of(*last.data, rung->horizon));
    JudgedModel nearer = last.weighed(last.findings->found);
    if (!nearer.fit.usable || !tells_all(nearer.fit)) continue;
    last.found = std::move(nearer);
    return;
  }
  last.task = free;
  last.weights = weights;
}

void fit_as_judged(LastFit& last) {
  last.weights = last.found.error.cwiseMax(1e-9 * last.data->output_scale());
  last.found = last.judged(last.found.fit.model, kLastFitIterations);
  if (last.found.fit.usable && last.is_thinned()) climb_again(last);
  if (!last.found.fit.usable) return;
  fit_beside_disturbance(last);
  fit_where_laws_are_told(last);
}

// One sample ahead, where the search found its laws.
void fit_innovations(LastFit& last) {
  last.task = last.data->windows(1);
  last.disturbance = last.remaining = *last.findings->followed;
  last.found = last.weighed(last.findings->found);
}

// A model with laws contains the one as given: where its fit ended worse, it is fitted again from
// there, and over longer and longer windows. Laws that still gain nothing only made up for another
// valley.
void fit_again_or_drop_laws(LastFit& last) {
  const std::vector<double> given = last.as_given.fit.model.values();
  std::vector<double> values = last.found.fit.model.values();
  std::copy_n(given.begin(), last.found.fit.model.own_parameters(), values.begin());
  JudgedModel best = last.as_given;
  for (const ExtendedLumpedModel& start :
       {with_values(last.found.fit.model, values), last.climbed(last.found.fit.model)}) {
    JudgedModel again = last.judged(start, kManyLastFitIterations);
    if (again.fit.usable && again.fit.cost < best.fit.cost) best = std::move(again);
  }
  last.found = std::move(best);
}

// Without laws both are fits of one model, from other starts: the one that foretells better.
void take_better_start(LastFit& last) {
  const VectorXd& scale = last.data->output_scale();
  const bool is_better =
      last.found.fit.model.laws.empty() && last.as_given.fit.usable &&
      relative_size(last.as_given.error, scale) < relative_size(last.found.error, scale);
  if (!is_better) return;
  last.found = last.as_given;
  last.found.deviations = deviations_with_disagreement(last);
}

// The laws of the search, beside the model as given: those that stay, in their plainest form.
void choose_laws(LastFit& last) {
  last.as_given = judged_from_both(last, last.findings->as_given);
  // Laws that only made up for another valley.
  const bool is_no_better =
      last.as_given.fit.usable && last.as_given.fit.cost <= last.found.fit.cost;
  if (is_no_better) fit_again_or_drop_laws(last);
  drop_idle_laws(last);
  if (take_better_places(last)) drop_idle_laws(last);
  if (take_plainer_laws(last)) drop_idle_laws(last);
  add_short_ripples(last);
  do {
    last.found.deviations = deviations_with_disagreement(last);
  } while (drop_undetermined_law(last));
  take_better_start(last);
}

}  // namespace

FinalFit::FinalFit(const PredictionData& data, const PredictionHypotheses& hypotheses,
                   const PredictionFindings& findings, int threads)
    : last_{.data = &data,
            .hypotheses = &hypotheses,
            .findings = &findings,
            .threads = threads,
            .judged_by = data.windows(0),
            .task = data.windows(0),
            .disturbance = {},
            .remaining = {},
            .weights = data.output_scale(),
            .found = {},
            .as_given = {}} {
  choose_horizon(last_);
  if (!last_.found.fit.usable) return;
  if (findings.followed) {
    fit_innovations(last_);
  } else {
    fit_as_judged(last_);
  }
  if (!last_.found.fit.usable) return;  // its motion leaves all bounds at this horizon
  choose_laws(last_);
  judge_held_out(last_, last_.found);
  rest_.emplace(data, findings, last_.found.fit.model, threads);
  judge_held_out(last_, last_.as_given);
}

JudgedModel FinalFit::without(std::size_t law) const {
  JudgedModel result = refitted_without(last_, last_.found.fit.model.laws[law]);
  judge_held_out(last_, result);
  return result;
}

JudgedModel FinalFit::exchanged(std::size_t law, const ExtendedLumpedModel& rival) const {
  const ExtendedLumpedModel& model = last_.found.fit.model;
  return last_.judged(with_last_law_of(rival, without_part(model, model.laws[law].part)),
                      kLastFitIterations);
}

JudgedModel FinalFit::in_place_of(std::size_t law, std::size_t hypothesis) const {
  const ExtendedLumpedModel& model = last_.found.fit.model;
  JudgedModel best = last_.best_of_starts(model, hypothesis, model.laws[law].part);
  if (best.fit.usable) judge_held_out(last_, best);
  return best;
}

JudgedModel FinalFit::beside(std::size_t hypothesis) const {
  JudgedModel richer = last_.with_law(last_.found, hypothesis);
  if (richer.fit.usable) richer.deviations = steady_deviations(last_, richer.fit);
  return richer;
}

JudgedModel FinalFit::weight_in_place_of(std::size_t law) const {
  return fit_with_weight_for_spring(last_, law);
}

std::vector<std::size_t> FinalFit::elsewhere(std::size_t hypothesis) const {
  return places_elsewhere(last_, hypothesis);
}

std::vector<LawTrend> FinalFit::trends() const { return size_trends(last_); }

}  // namespace graybox
