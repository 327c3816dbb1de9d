#include "diagnosis/prediction_error/final_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "diagnosis/prediction_error/prediction_curves.hpp"
#include "diagnosis/prediction_error/ripple_trials.hpp"
#include "diagnosis/prediction_error/robust_covariance.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"
#include "diagnosis/predictor/parameter_trend.hpp"
#include "diagnosis/predictor/told_law.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSkill = 0.5, kFreeSkill = 0.2;  // of the signal; in free run
constexpr int kIterations = 25, kManyIterations = 75;
constexpr int kOfStates = 10;        // iterations of initial states alone
constexpr Index kSeenSamples = 200;  // of a recording kept out, before it runs free
constexpr double kMissed = 2.5;      // z of a law that stays
constexpr double kMissedNearby = 3.0;
constexpr double kDisturbed = 0.05;    // of the signal
constexpr double kStands = 3.0;        // noises, of what is kept out
constexpr double kToldFromNone = 2.5;  // standard errors of a law's size

}  // namespace

double relative_size(const VectorXd& error, const VectorXd& scale) {
  return std::sqrt((error.array() / scale.array()).square().mean());
}

FinalFit::FinalFit(const PredictionData& data, const PredictionHypotheses& hypotheses,
                   const PredictionFindings& findings, int threads)
    : data_(&data),
      hypotheses_(&hypotheses),
      findings_(&findings),
      threads_(threads),
      judged_by_(data.windows(0)),
      task_(judged_by_),
      weights_(data.output_scale()) {
  choose_horizon();
  if (!found_.fit.usable) return;
  if (findings.followed) {
    fit_innovations();
  } else {
    fit_as_judged();
  }
  if (!found_.fit.usable) return;  // its motion leaves all bounds at this horizon
  as_given_ = judged_from_both(findings.as_given);
  // Laws that only made up for another valley.
  if (as_given_.fit.usable && as_given_.fit.cost <= found_.fit.cost) fit_again_or_drop_laws();
  drop_idle_laws();
  if (take_better_places()) drop_idle_laws();
  if (take_plainer_laws()) drop_idle_laws();
  add_short_ripples();
  do {
    found_.deviations =
        with_disagreement(deviations_of(fitter(task_).with_steady_slopes(found_.fit, weights_)));
  } while (drop_undetermined_law());
  // Without laws both are fits of one model, from other starts: the one that foretells better.
  if (found_.fit.model.laws.empty() && as_given_.fit.usable &&
      relative_size(as_given_.error, data.output_scale()) <
          relative_size(found_.error, data.output_scale())) {
    found_ = as_given_;
    found_.deviations =
        with_disagreement(deviations_of(fitter(task_).with_steady_slopes(found_.fit, weights_)));
  }
  judge_held_out(found_);
  rest_.emplace(data, findings, found_.fit.model, threads);
  judge_held_out(as_given_);
}

// A model with laws contains the one as given: where its fit ended worse, it is fitted again from
// there, and over longer and longer windows. Laws that still gain nothing only made up for another
// valley.
void FinalFit::fit_again_or_drop_laws() {
  const std::vector<double> given = as_given_.fit.model.values();
  std::vector<double> values = found_.fit.model.values();
  std::copy_n(given.begin(), found_.fit.model.own_parameters(), values.begin());
  JudgedModel best = as_given_;
  for (const ExtendedLumpedModel& start :
       {with_values(found_.fit.model, values), climbed(found_.fit.model)}) {
    JudgedModel again = judged(start, kManyIterations);
    if (again.fit.usable && again.fit.cost < best.fit.cost) best = std::move(again);
  }
  found_ = std::move(best);
}

void FinalFit::fit_as_judged() {
  weights_ = found_.error.cwiseMax(1e-9 * data_->output_scale());
  found_ = judged(found_.fit.model, kIterations);
  if (found_.fit.usable && is_thinned()) climb_again();
  if (!found_.fit.usable) return;
  fit_beside_disturbance();
  fit_where_laws_are_told();
}

// One sample ahead, where the search found its laws.
void FinalFit::fit_innovations() {
  task_ = data_->windows(1);
  disturbance_ = remaining_ = *findings_->followed;
  found_ = weighed(findings_->found);
}

JudgedModel FinalFit::judged_from_both(const ExtendedLumpedModel& model) const {
  JudgedModel result = judged(model, kIterations);
  const std::vector<double> began = findings_->started.values();
  std::vector<double> values = model.values();
  if (!task_.is_free() || began.size() < model.own_parameters()) return result;
  std::copy_n(began.begin(), model.own_parameters(), values.begin());
  JudgedModel other = judged(with_values(model, values), kIterations);
  const bool is_better =
      other.fit.usable && (!result.fit.usable || (other.fit.cost < result.fit.cost &&
                                                  z_between(result.fit, other.fit) > kMissed));
  return is_better ? std::move(other) : std::move(result);
}

void FinalFit::choose_horizon() {
  found_ = judged_from_both(findings_->found);
  if (found_.fit.usable && has_skill(found_.error)) return;
  for (auto rung = findings_->rungs.rbegin(); rung != findings_->rungs.rend(); ++rung) {
    task_ = judged_by_ = data_->windows(findings_->samples_of(*data_, rung->horizon));
    found_ = judged(findings_->found, kIterations);
    if (found_.fit.usable && has_skill(found_.error)) return;
  }
  if (!found_.fit.usable) found_ = judged(findings_->as_given, kIterations);
}

PredictionFitter FinalFit::fitter(const PredictionTask& task) const {
  return {*data_, task, findings_->filter_intensity(), threads_, disturbance_};
}

bool FinalFit::has_skill(const VectorXd& error) const {
  const bool is_only_way = findings_->has_free_run;
  const double limit = judged_by_.is_free() && !is_only_way ? kFreeSkill : kSkill;
  return (error.array() < limit * data_->output_scale().array()).all();
}

// Whether the laws foretell whole recordings: what a disturbance does to them is next to nothing.
bool FinalFit::runs_true() const {
  constexpr double kNext = 0.02;  // of the signal
  return judged_by_.is_free() && !found_.fit.model.laws.empty() &&
         (found_.error.array() < kNext * data_->output_scale().array()).all();
}

// Whether whole recordings need a law that short windows beside a disturbance do not: these are
// foretold with it, and not without it, however the rest is fitted.
bool FinalFit::is_needed_in_free_run(const JudgedModel& without) const {
  constexpr double kWell = 0.05, kTimes = 3.0;  // of the signal, and of the error
  if (!judged_by_.is_free() || task_.is_free()) return false;
  const VectorXd& scale = data_->output_scale();
  const double with = relative_size(found_.error, scale);
  if (with > kWell || relative_size(without.error, scale) < kTimes * with) return false;
  const PredictionFitter whole = fitter(judged_by_);
  const PredictionFit refit = whole.fit(without.fit.model, scale, {}, kIterations);
  return !refit.usable || relative_size(whole.errors(refit, scale), scale) > kTimes * with;
}

// The likeliest of the fit as it is and the fits beside a disturbance is taken. One that leaves
// much more over longer runs is not: there more is missing than a disturbance.
void FinalFit::fit_beside_disturbance() {
  constexpr double kWorse = 1.5, kWorseFree = 4.0;
  if (findings_->has_free_run) return;
  const UnmodelledForce rest(*data_, *findings_, found_.fit.model, threads_);
  if (rest.force() == nullptr || rest.multiple_of_noise() <= kNoiseMultiple) return;
  if (runs_true()) return;
  const Index first = data_->first_horizon();
  const Index longest = rest.foreseeable(kDisturbed).value_or(first);
  remaining_ = rest.force()->disturbance;
  const JudgedModel before = found_;
  Beside best{task_, weights_, {}, found_, rest.force()->log_likelihood};
  for (const Index ahead : {first, 3 * first}) {
    const Index horizon = findings_->samples_of(*data_, ahead);
    if (horizon > longest && ahead > first) break;
    std::optional<Beside> beside = follow_disturbance(before, rest, horizon);
    if (!beside || !(beside->log_likelihood > best.log_likelihood)) continue;
    const double limit = judged_by_.is_free() ? kWorseFree : kWorse;
    const bool is_worse = (beside->found.error.array() > limit * before.error.array()).any();
    if (!is_worse) best = *std::move(beside);
  }
  task_ = best.task;
  weights_ = best.weights;
  disturbance_ = best.disturbance;
  found_ = std::move(best.found);
}

// The force is estimated anew with the laws that it leaves: what they lacked, it had.
std::optional<FinalFit::Beside> FinalFit::follow_disturbance(const JudgedModel& from,
                                                             const UnmodelledForce& rest,
                                                             Index horizon) {
  constexpr int kRounds = 2;
  constexpr double kSettled = 0.05;  // of its size
  std::optional<Beside> result;
  DisturbanceForce disturbance = rest.force()->disturbance;
  ExtendedLumpedModel model = from.fit.model;
  for (int round = 0; round < kRounds; ++round) {
    task_ = data_->windows(horizon);
    disturbance_ = disturbance;
    JudgedModel found = weighed(model);
    if (!found.fit.usable) return result;
    const auto force = likeliest_force(*data_, found.fit.model, findings_->intensity, threads_);
    if (!force) return result;
    model = found.fit.model;
    const double change = std::abs(force->disturbance.deviation - disturbance.deviation);
    const bool is_settled = change < kSettled * disturbance.deviation;
    if (!result || force->log_likelihood > result->log_likelihood) {
      result = Beside{task_, weights_, disturbance, std::move(found), force->log_likelihood};
    }
    if (is_settled) return result;
    disturbance = force->disturbance;
  }
  return result;
}

JudgedModel FinalFit::judged(const ExtendedLumpedModel& model, int iterations) const {
  JudgedModel result;
  result.horizon = judged_by_.horizon;
  const PredictionFitter near = fitter(task_);
  result.fit = near.fit(model, weights_, {}, iterations);
  if (!result.fit.usable) return result;
  result.error = near.errors(result.fit, weights_);
  if (judged_by_.horizon == task_.horizon) return result;
  const PredictionFitter far = fitter(judged_by_);
  const PredictionFit run = far.fit(result.fit.model, weights_, {}, kOfStates, false);
  result.error = run.usable ? far.errors(run, weights_) : 1e3 * data_->output_scale();
  return result;
}

// The model fitted over longer and longer windows, up to those of the fit.
ExtendedLumpedModel FinalFit::climbed(ExtendedLumpedModel model) const {
  const VectorXd& scale = data_->output_scale();
  std::vector<double> intensities{findings_->intensity};
  if (!(findings_->intensity > 0.0)) intensities = force_noise_intensities(*data_);
  for (const Index times : {1, 3, 10, 30, 100}) {
    const Index samples = findings_->samples_of(*data_, times * data_->first_horizon());
    if (!task_.is_free() && samples >= task_.horizon) break;
    if (data_->window_count(samples) < kFewestHorizonWindows) break;
    const PredictionTask task = data_->windows(samples);
    PredictionFit best;
    for (const double intensity : intensities) {
      const PredictionFitter windows(*data_, task, intensity, threads_, disturbance_);
      PredictionFit fit = windows.fit(model, scale, {}, kIterations);
      if (!fit.usable || (best.usable && best.cost <= fit.cost)) continue;
      best = std::move(fit);
    }
    if (!best.usable) break;
    model = std::move(best.model);
  }
  return model;
}

// Whether the search saw fewer samples than were recorded.
bool FinalFit::is_thinned() const { return findings_->sample_time > 1.5 * data_->sample_time(); }

// Thinned inputs lead a little beside the optimum, and from there long runs over dry friction find
// no way. So the model is fitted to all samples over short windows first, too.
void FinalFit::climb_again() {
  JudgedModel again = judged(climbed(found_.fit.model), kIterations);
  if (again.fit.usable && again.fit.cost < found_.fit.cost) found_ = std::move(again);
}

// Without a law a model may leave its valley: where it does worse than the model as given, which it
// contains, or where a law that few machines have seems to be worth nearly all. Then it is fitted
// again over longer and longer windows.
JudgedModel FinalFit::refitted_without(const PlacedFinding& law) const {
  constexpr double kNearlyAll = 4.0;  // times the cost
  const ExtendedLumpedModel model = without_part(found_.fit.model, law.part);
  JudgedModel direct = judged(model, kIterations);
  const VectorXd& scale = data_->output_scale();
  const bool is_poor = !direct.fit.usable ||
                       (as_given_.fit.usable &&
                        relative_size(direct.error, scale) > relative_size(as_given_.error, scale));
  const bool is_doubtful =
      !hypotheses_->is_plain(law.hypothesis) && !(direct.fit.cost < kNearlyAll * found_.fit.cost);
  if (!is_poor && !is_doubtful) return direct;
  const ExtendedLumpedModel climbing = climbed(model);
  JudgedModel again = judged(climbing, kManyIterations);
  const bool is_better =
      again.fit.usable && (!direct.fit.usable || again.fit.cost < direct.fit.cost);
  return is_better ? std::move(again) : std::move(direct);
}

// By what a first fit leaves.
JudgedModel FinalFit::weighed(const ExtendedLumpedModel& model) {
  const VectorXd& scale = data_->output_scale();
  const PredictionFitter near = fitter(task_);
  const PredictionFit fit = near.fit(model, scale, {}, kIterations);
  if (!fit.usable) return {};
  weights_ = near.errors(fit, scale).cwiseMax(1e-9 * scale);
  return judged(fit.model, kIterations);
}

VectorXd FinalFit::deviations_of(const PredictionFit& fit) const {
  const MatrixXd covariance = robust_covariance(fit.residuals, fit.jacobian, fit.edges);
  VectorXd deviations(static_cast<Index>(fit.free.size()));
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const ParameterSpace& space = fit.model.space[fit.free[i]];
    const double value = fit.model.model.parameters[fit.free[i]].value;
    const double slope = space.logarithmic ? std::abs(value) : space.scale;
    const auto at = static_cast<Index>(i);
    deviations(at) = slope * std::sqrt(covariance(at, at));
  }
  return deviations;
}

// The next shorter windows of the search, or the next longer ones.
std::optional<PredictionTask> FinalFit::another_horizon() const {
  if (findings_->followed) return {};  // a longer one hides what was found
  std::optional<Index> shorter, longer;
  for (const Rung& rung : findings_->rungs) {
    const Index horizon = findings_->samples_of(*data_, rung.horizon);
    if (horizon == 0) continue;
    if (task_.is_free() || horizon < task_.horizon) {
      shorter = std::max(shorter.value_or(0), horizon);
    } else if (horizon > task_.horizon) {
      longer = std::min(longer.value_or(horizon), horizon);
    }
  }
  const std::optional<Index> other = shorter ? shorter : longer;
  if (!other) return {};
  return data_->windows(*other);
}

PredictionFit FinalFit::fitted_at(const PredictionTask& task) const {
  const PredictionFitter other = fitter(task);
  const VectorXd& scale = data_->output_scale();
  const PredictionFit first = other.fit(found_.fit.model, scale, {}, 0);
  if (!first.usable) return {};
  const VectorXd weights = other.errors(first, scale).cwiseMax(1e-9 * scale);
  return other.fit(found_.fit.model, weights, {}, kIterations);
}

// By the fit's windows; where it runs free by shorter ones, since there what a parameter did early
// is still felt late.
std::vector<LawTrend> FinalFit::trends() const {
  std::optional<PredictionTask> task = task_;
  if (task_.is_free()) task = another_horizon();
  if (!task || found_.fit.model.laws.empty()) return {};
  const PredictionFit fit = task_.is_free() ? fitted_at(*task) : found_.fit;
  if (!fit.usable) return {};
  return law_trends(*task, data_->output_count(), fit, fitter(*task).motion(fit),
                    hypotheses_->hypotheses());
}

VectorXd FinalFit::with_disagreement(VectorXd deviations) const {
  const std::optional<PredictionTask> task = another_horizon();
  if (!task) return deviations;
  const PredictionFit fit = fitted_at(*task);
  if (!fit.usable || fit.free != found_.fit.free) return deviations;
  const VectorXd own = deviations_of(fit);
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const double apart = fit.model.model.parameters[fit.free[i]].value -
                         found_.fit.model.model.parameters[fit.free[i]].value;
    const double square = deviations(at) * deviations(at);
    const double beyond = apart * apart - square - own(at) * own(at);
    if (beyond > 0.0) deviations(at) = std::sqrt(square + beyond);
  }
  return deviations;
}

// Windows as long as the fit's, or whole runs, of the recordings kept out.
PredictionTask FinalFit::held_out_task(const PredictionTask& task) const {
  return task.is_free() ? data_->free_after(kSeenSamples, ExperimentRole::kValidation)
                        : data_->windows(task.horizon, ExperimentRole::kValidation);
}

std::optional<HeldOutError> FinalFit::held_out_by(const ExtendedLumpedModel& model,
                                                  const PredictionTask& task) const {
  if (!data_->has_validation()) return {};
  const PredictionTask kept_out = held_out_task(task);
  const PredictionFitter ahead = fitter(kept_out);
  const PredictionFit run = ahead.fit(model, weights_, {}, 0, false);
  if (!run.usable) return {};
  return HeldOutError{task.horizon, ahead.errors(run, weights_)};
}

std::vector<ResidualCurve> FinalFit::curves(const JudgedModel& model) const {
  std::vector<ResidualCurve> curves;
  if (!model.fit.usable) return curves;
  const std::string how =
      judged_by_.is_free()
          ? "in free run"
          : fmt::format("{:.3g} s ahead",
                        data_->sample_time() * static_cast<double>(judged_by_.horizon));
  if (data_->has_validation()) {
    const PredictionTask task = held_out_task(judged_by_);
    const PredictionFit run = fitter(task).fit(model.fit.model, weights_, {}, 0, false);
    if (run.usable) add_prediction_curves(*data_, task, run, weights_, how, true, curves);
  }
  const bool is_far = judged_by_.horizon != task_.horizon;
  const PredictionFit run =
      is_far ? fitter(judged_by_).fit(model.fit.model, weights_, {}, kOfStates, false) : model.fit;
  if (run.usable) {
    add_prediction_curves(*data_, is_far ? judged_by_ : task_, run, weights_, how, false, curves);
  }
  return curves;
}

void FinalFit::judge_held_out(JudgedModel& model) const {
  if (!data_->has_validation() || !model.fit.usable) return;
  const PredictionTask task = held_out_task(judged_by_);
  const PredictionFitter whole = fitter(task);
  const PredictionFit run = whole.fit(model.fit.model, weights_, {}, 0, false);
  if (run.usable) model.held_out_error = whole.errors(run, weights_);
  model.held_out_scale = VectorXd::Zero(data_->output_count());
  double samples = 0.0;
  for (const PredictionRun& one : task.runs) {
    const MatrixXd& outputs = data_->recording(one.recording).outputs;
    const Eigen::RowVectorXd mean = outputs.colwise().mean();
    model.held_out_scale += (outputs.rowwise() - mean).colwise().squaredNorm().transpose();
    samples += static_cast<double>(outputs.rows());
  }
  model.held_out_scale = (model.held_out_scale / samples).cwiseSqrt();
  // What stands still has no signal of its own.
  const VectorXd &noise = data_->noise(), &scale = data_->output_scale();
  for (Index j = 0; j < scale.size(); ++j) {
    if (model.held_out_scale(j) < kStands * noise(j)) model.held_out_scale(j) = scale(j);
  }
}

JudgedModel FinalFit::fitted_to_kept_out() const {
  JudgedModel own;
  if (!data_->has_validation() || !found_.fit.usable) return own;
  const PredictionTask task = held_out_task(judged_by_);
  const PredictionFitter whole = fitter(task);
  own.fit = whole.fit(found_.fit.model, weights_, {}, kIterations);
  if (!own.fit.usable) return own;
  own.error = whole.errors(own.fit, weights_);
  own.deviations = deviations_of(own.fit);
  return own;
}

std::optional<HeldOutError> FinalFit::held_out_ahead(double share) const {
  const std::optional<Index> horizon = rest_->foreseeable(share);
  if (!horizon || *horizon == 0 || !data_->has_validation()) return {};
  const PredictionTask task = data_->windows(*horizon, ExperimentRole::kValidation);
  const PredictionFitter ahead = fitter(task);
  const PredictionFit run = ahead.fit(found_.fit.model, weights_, {}, 0, false);
  if (!run.usable || task.runs.front().counted() == 0) return {};
  return HeldOutError{*horizon, ahead.errors(run, weights_)};
}

// The relative standard error of each output's mean square, by blocks.
Eigen::ArrayXd FinalFit::relative_errors(const PredictionFit& fit) const {
  const Index outputs = data_->output_count();
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

std::optional<FinalFit::Growth> FinalFit::growth() const {
  if (!found_.held_out_error) return {};
  const std::optional<Index> ahead = rest_->foreseeable(kDisturbed);
  const Index horizon = findings_->has_free_run || !ahead ? 0 : *ahead;
  if (horizon == 0 && !findings_->has_free_run) return {};
  const auto errors = [&](ExperimentRole role, VectorXd& error) -> std::optional<Eigen::ArrayXd> {
    const PredictionTask task =
        horizon == 0 ? data_->free_after(kSeenSamples, role) : data_->windows(horizon, role);
    const PredictionFitter run = fitter(task);
    const PredictionFit fit = run.fit(found_.fit.model, weights_, {}, 0, false);
    if (!fit.usable || task.counted() == 0) return {};
    error = run.errors(fit, weights_);
    return relative_errors(fit);
  };
  VectorXd inside, outside;
  const auto of_fit = errors(ExperimentRole::kEstimation, inside);
  const auto kept_out = errors(ExperimentRole::kValidation, outside);
  if (!of_fit || !kept_out) return {};
  const VectorXd noise = data_->noise();
  const Eigen::ArrayXd of_signals = found_.held_out_scale.array() / data_->output_scale().array();
  const double larger = std::max(1.0, data_->growth_of_inputs());
  Growth growth;
  growth.ratio = (outside.array().max(noise.array()) / inside.array().max(noise.array()) /
                  of_signals.max(larger))
                     .matrix();
  growth.deviation = 0.5 * (of_fit->square() + kept_out->square()).sqrt().matrix();
  return growth;
}

// A law without which the fit does as well; or one that few machines have and that takes less
// than its share of the cost. Recordings kept out have no say here: after the samples that are
// seen their error is that of the state, of which the best law may have more than a poor one.
bool FinalFit::is_worth_nothing(std::size_t hypothesis, const JudgedModel& without) const {
  if (findings_->followed) return !is_borne_out(without);
  if (is_idle(without.fit, found_.fit)) return true;
  const double gain = 1.0 - found_.fit.cost / without.fit.cost;
  return !hypotheses_->is_plain(hypothesis) && gain < kRareGain;
}

bool FinalFit::takes_most(const JudgedModel& without, double z) const {
  return graybox::takes_most(1.0 - found_.fit.cost / without.fit.cost, evidence_over(without), z);
}

// One sample ahead a law must predict what was kept out, too: there a better state is no excuse.
bool FinalFit::is_borne_out(const JudgedModel& without) const {
  constexpr double kHeldOutEvidence = 25.0;  // chi-square
  if (evidence_over(without) < kInnovationEvidence) return false;
  if (!data_->has_validation()) return true;
  const PredictionTask task = data_->windows(task_.horizon, ExperimentRole::kValidation);
  const PredictionFitter ahead = fitter(task);
  const PredictionFit poorer = ahead.fit(without.fit.model, weights_, {}, 0, false);
  const PredictionFit richer = ahead.fit(found_.fit.model, weights_, {}, 0, false);
  if (!poorer.usable || !richer.usable) return false;
  return white_evidence(task, data_->output_count(), poorer.residuals, richer.residuals) >
         kHeldOutEvidence;
}

// z that a law must have to stay.
double FinalFit::least_z() const {
  if (!findings_->followed) return kMissed;
  return data_->has_validation() ? kInnovationErrors : kMissedNearby;
}

bool FinalFit::is_told(const PredictionFit& fit, const PlacedFinding& law) const {
  return has_told_parameter(fit, deviations_of(fit), law, kToldFromNone);
}

// A law goes whose every size is smaller than its error, or a wave that is not told from none.
bool FinalFit::drop_undetermined_law() {
  const PredictionFit& fit = found_.fit;
  for (const PlacedFinding& law : fit.model.laws) {
    const bool is_wave = fit.model.model.parts[law.part].law_name == "ripple";
    const ToldSize size = told_size(fit, found_.deviations, law, is_wave ? kToldFromNone : 1.0);
    const bool is_told = size.is_told && !has_loose_frequency(fit, found_.deviations, law) &&
                         !swings_too_slowly(fit, law, *data_) && !is_late_at_bound(fit, law) &&
                         !is_longer_than_the_way(fit, law, motion());
    if (!size.is_free || is_told) continue;
    JudgedModel without = judged(without_part(fit.model, law.part), kIterations);
    if (!without.fit.usable || is_surely_there(law, without)) continue;
    found_ = std::move(without);
    return true;
  }
  return false;
}

// Friction at one speed and one standstill has a least size and hardly a largest: its error says
// that its size is not told, and the fit without it that it is there.
bool FinalFit::is_surely_there(const PlacedFinding& law, const JudgedModel& without) const {
  constexpr double kNearlyAll = 0.9, kSure = 100.0;  // of the cost, chi-square
  return hypotheses_->acts_in_moments(law.hypothesis) &&
         1.0 - found_.fit.cost / without.fit.cost > kNearlyAll && evidence_over(without) > kSure;
}

bool FinalFit::raises_held_out(const JudgedModel& without, const JudgedModel& with,
                               double least) const {
  const auto after = law_held_out(with), before = law_held_out(without);
  if (!after || !before) return false;
  const VectorXd& scale = data_->output_scale();
  return relative_size(after->error, scale) > least * relative_size(before->error, scale);
}

// A long run may say nothing of a law that shows in short ones.
void FinalFit::fit_where_laws_are_told() {
  if (!task_.is_free() || findings_->has_free_run) return;
  const auto tells_all = [&](const PredictionFit& fit) {
    return std::ranges::all_of(fit.model.laws,
                               [&](const PlacedFinding& law) { return is_told(fit, law); });
  };
  if (tells_all(found_.fit)) return;
  const PredictionTask free = task_;
  const VectorXd weights = weights_;
  for (auto rung = findings_->rungs.rbegin(); rung != findings_->rungs.rend(); ++rung) {
    task_ = data_->windows(findings_->samples_of(*data_, rung->horizon));
    JudgedModel nearer = weighed(findings_->found);
    if (!nearer.fit.usable || !tells_all(nearer.fit)) continue;
    found_ = std::move(nearer);
    return;
  }
  task_ = free;
  weights_ = weights;
}

double FinalFit::missed_nearby(const PlacedFinding& law) const {
  const auto accepted =
      std::ranges::find(findings_->laws, accepted_as(law.hypothesis), &AcceptedLaw::hypothesis);
  if (accepted == findings_->laws.end() || accepted->horizon == 0) return -kMissed;
  const PredictionTask task = data_->windows(findings_->samples_of(*data_, accepted->horizon));
  const PredictionFitter near(*data_, task, findings_->intensity, threads_, remaining_);
  const VectorXd& scale = data_->output_scale();
  const PredictionFit present = near.fit(found_.fit.model, scale, {}, 0);
  if (!present.usable) return -kMissed;
  const VectorXd weights = near.errors(present, scale).cwiseMax(1e-9 * scale);
  const PredictionFit with = near.fit(found_.fit.model, weights, {}, kIterations);
  const PredictionFit without =
      near.fit(without_part(with.model, law.part), weights, with.initials, kIterations);
  if (!with.usable || !without.usable || is_idle(without, with)) return -kMissed;
  if (!is_told(with, law)) return -kMissed;
  return hypotheses_->z_of_law(law.hypothesis, without, with);
}

// What the search found on one rung and neither that rung bears out beside the others nor the
// whole, the least missed first: what it stood in for may then fall to the others. A long run says
// little of a law whose force a disturbance hides: there the errors add up.
void FinalFit::drop_idle_laws() {
  while (!found_.fit.model.laws.empty()) {
    std::optional<JudgedModel> poorest;
    double least = least_z();
    for (const PlacedFinding& law : found_.fit.model.laws) {
      JudgedModel poorer = refitted_without(law);
      if (!poorer.fit.usable) continue;
      const bool is_plain = hypotheses_->is_plain(law.hypothesis);  // others must predict, too
      const bool is_nothing = is_worth_nothing(law.hypothesis, poorer) ||
                              (!is_told(found_.fit, law) && !is_surely_there(law, poorer)) ||
                              (!is_plain && raises_held_out(poorer, found_));
      const double z =
          is_nothing ? -kMissed : hypotheses_->z_of_law(law.hypothesis, poorer.fit, found_.fit);
      const bool may_be_hidden = task_.is_free() && !findings_->has_free_run;
      if (z >= least || (may_be_hidden && missed_nearby(law) >= kMissedNearby)) continue;
      if (hypotheses_->acts_in_moments(law.hypothesis) && takes_most(poorer, z) &&
          !raises_held_out(poorer, found_, 1.0)) {
        continue;
      }
      if (is_needed_in_free_run(poorer)) continue;
      least = z;
      poorest = std::move(poorer);
    }
    if (!poorest) return;
    found_ = std::move(*poorest);
  }
}

// What few channels show may not tell where a law is over the short horizons of the search, and
// tell over the long ones of the last fit.
bool FinalFit::take_better_places() {
  constexpr double kBetter = 0.97;  // of the cost
  bool has_moved = false;
  for (std::size_t l = 0; l < found_.fit.model.laws.size(); ++l) {
    const PlacedFinding law = found_.fit.model.laws[l];
    const JudgedModel poorer = judged(without_part(found_.fit.model, law.part), kIterations);
    if (!poorer.fit.usable) continue;
    for (const std::size_t other : elsewhere(law.hypothesis)) {
      JudgedModel moved = with_law(poorer, other);
      if (!moved.fit.usable || !(moved.fit.cost < kBetter * found_.fit.cost)) continue;
      if (!(z_between(found_.fit, moved.fit) > 0.0)) continue;
      accepted_as_[other] = accepted_as(law.hypothesis);
      found_ = std::move(moved);
      has_moved = true;
    }
  }
  return has_moved;
}

// These are the same law at other places, and lateness at other signals, where the model has none.
std::vector<std::size_t> FinalFit::elsewhere(std::size_t hypothesis) const {
  const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
  const auto is_late = [](const Hypothesis& each) {
    return each.law == "lag" || each.law == "delay";
  };
  std::vector<std::size_t> others;
  for (std::size_t h = 0; h < all.size(); ++h) {
    const bool is_there =
        std::ranges::count(found_.fit.model.laws, h, &PlacedFinding::hypothesis) > 0;
    const bool is_alike = all[h].law == all[hypothesis].law &&
                          all[h].place != all[hypothesis].place &&
                          hypotheses_->location(h).kind == hypotheses_->location(hypothesis).kind;
    const bool are_late = is_late(all[h]) && is_late(all[hypothesis]);
    if (!is_there && (is_alike || are_late)) others.push_back(h);
  }
  return others;
}

// Friction of two levels where one does as well, a spring where a clearance has none, and the like.
bool FinalFit::take_plainer_laws() {
  bool has_changed = false;
  for (std::size_t l = 0; l < found_.fit.model.laws.size();) {
    const bool is_plainer = take_plainer_law(l) || take_steep_friction(l) ||
                            take_friction_for_dead_drive(l) || take_rival_that_holds(l) ||
                            take_weight_for_spring(l);
    has_changed |= is_plainer;
    l = is_plainer ? 0 : l + 1;
  }
  return has_changed;
}

bool FinalFit::take_plainer_law(std::size_t law) {
  const PlacedFinding placed = found_.fit.model.laws[law];
  const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
  const Hypothesis& rich = all[placed.hypothesis];
  if (rich.special_cases.empty()) return false;
  // Without the law a fit may leave its valley: the plainer one begins beside both.
  const ExtendedLumpedModel bare = without_part(found_.fit.model, placed.part);
  const JudgedModel without = judged(bare, kIterations);
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].place != rich.place || std::ranges::count(rich.special_cases, all[h].law) == 0) {
      continue;
    }
    JudgedModel plainer = with_sizes_of(placed, bare, h);
    if (without.fit.usable) {
      JudgedModel other = with_law(without, h);
      const bool is_better =
          other.fit.usable && (!plainer.fit.usable || other.fit.cost < plainer.fit.cost);
      if (is_better) plainer = std::move(other);
    }
    if (!plainer.fit.usable) continue;
    if (z_over(plainer) >= kMissed && !predicts_further(plainer)) {
      if (take_sum_with(plainer, placed, h)) return true;
      continue;
    }
    accepted_as_[h] = accepted_as(placed.hypothesis);
    found_ = std::move(plainer);
    return true;
  }
  return false;
}

// A spring that hardens passes for one with a clearance, which is soft in its middle, too. With the
// plain spring alone the search would not come back to it.
bool FinalFit::take_sum_with(const JudgedModel& plainer, const PlacedFinding& rich,
                             std::size_t plain) {
  constexpr std::array kOfPosition{"cubic_spring", "gravity"};
  constexpr double kBetter = 0.8;  // of the cost
  const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
  for (std::size_t h = 0; h < all.size(); ++h) {
    const bool may_be =
        all[h].place == all[plain].place && std::ranges::count(kOfPosition, all[h].law) > 0 &&
        h != rich.hypothesis &&
        std::ranges::count(found_.fit.model.laws, h, &PlacedFinding::hypothesis) == 0;
    if (!may_be) continue;
    JudgedModel sum = with_law(plainer, h);
    if (!sum.fit.usable || !(sum.fit.cost < kBetter * found_.fit.cost)) continue;
    if (!(z_between(found_.fit, sum.fit) > kMissed)) continue;
    accepted_as_[plain] = accepted_as_[h] = accepted_as(rich.hypothesis);
    found_ = std::move(sum);
    return true;
  }
  return false;
}

// `bare` with the plainer law, at the size that the richer one has by the same name.
JudgedModel FinalFit::with_sizes_of(const PlacedFinding& rich, const ExtendedLumpedModel& bare,
                                    std::size_t hypothesis) const {
  const Element& part = found_.fit.model.model.parts[rich.part];
  const LawEntry& entry = *find_law(part.law_name, false);
  JudgedModel best;
  for (const LawExtension& start : hypotheses_->extensions(bare, motion())) {
    if (start.hypothesis != hypothesis || start.replaces) continue;
    const LawEntry& plainer = *find_law(start.law, false);
    for (std::size_t p = 0; p < plainer.parameters.size(); ++p) {
      const auto named =
          std::ranges::find(entry.parameters, plainer.parameters[p].name, &LawParameter::name);
      if (start.direction[p] == 0.0 || named == entry.parameters.end()) continue;
      const auto at = static_cast<std::size_t>(named - entry.parameters.begin());
      const double amplitude = (part.parameters[at] - start.base[p]) / start.direction[p];
      JudgedModel each = judged(extended(bare, start, amplitude), kIterations);
      if (!each.fit.usable || (best.fit.usable && best.fit.cost <= each.fit.cost)) continue;
      best = std::move(each);
    }
  }
  return best;
}

// A model that is no better near and foretells more far ahead, in the fit's recordings and in those
// kept out. Without these nothing is said.
bool FinalFit::predicts_further(JudgedModel& plainer) const {
  constexpr double kFewer = 0.95;  // of the error
  judge_held_out(plainer);
  JudgedModel richer = found_;
  judge_held_out(richer);
  if (judged_by_.horizon == task_.horizon || !plainer.held_out_error || !richer.held_out_error) {
    return false;
  }
  const VectorXd& scale = data_->output_scale();
  const auto is_less = [&](const VectorXd& one, const VectorXd& other) {
    return relative_size(one, scale) < kFewer * relative_size(other, scale);
  };
  return is_less(plainer.error, richer.error) &&
         is_less(*plainer.held_out_error, *richer.held_out_error);
}

// Dry friction that slides over gradually, where one that turns at once predicts as well: over the
// short windows of the search other errors make it gradual.
bool FinalFit::take_steep_friction(std::size_t law) {
  const PlacedFinding placed = found_.fit.model.laws[law];
  const ExtendedLumpedModel& model = found_.fit.model;
  const std::size_t transition = model.first_parameter(placed.part) + 1;
  const bool is_gradual = model.model.parts[placed.part].law_name == "coulomb" &&
                          std::ranges::count(found_.fit.free, transition) > 0;
  if (!is_gradual) return false;
  const ExtendedLumpedModel bare = without_part(model, placed.part);
  for (const LawExtension& start : hypotheses_->extensions(bare, motion())) {
    if (start.hypothesis != placed.hypothesis || start.replaces || !start.fixed[1]) continue;
    ExtendedLumpedModel steep = extended(bare, start, model.model.parameters[transition - 1].value);
    JudgedModel plainer = judged(steep, kIterations);
    if (!plainer.fit.usable) continue;
    if (z_over(plainer) >= kMissed && !predicts_further(plainer)) continue;
    found_ = std::move(plainer);
    return true;
  }
  return false;
}

// Waves that the thinned recordings of the search are too coarse for, in the force that the whole
// ones leave. They are weighed over short windows, where a wave costs most.
void FinalFit::add_short_ripples() {
  constexpr int kMostRipples = 2;
  if (!is_thinned() || findings_->stopped || !found_.fit.usable) return;
  for (int k = 0; k < kMostRipples; ++k) {
    const auto force = likeliest_force(*data_, found_.fit.model, findings_->intensity, threads_);
    if (!force) return;
    std::optional<ExtendedLumpedModel> with = with_ripple(*force);
    if (!with) return;
    JudgedModel richer = judged(*with, kIterations);
    if (!richer.fit.usable || raises_held_out(found_, richer)) return;
    found_ = std::move(richer);
  }
}

// The model found with the best wave in this force; none where it does not predict better, on what
// was kept out, too.
std::optional<ExtendedLumpedModel> FinalFit::with_ripple(const LatentForce& force) const {
  constexpr double kLeastForce = 0.01;  // amplitude over the forces that act
  constexpr double kLeastShare = 0.1, kErrors = 3.0;
  constexpr int kOfStarts = 3;  // iterations
  std::vector<RippleTrial> trials = ripple_trials(force);
  std::erase_if(trials, [&](const RippleTrial& trial) {
    return trial.share < kLeastShare ||
           std::sqrt(2.0 * trial.share) * force.rms() < kLeastForce * data_->force_scale();
  });
  if (trials.empty()) return {};
  const PredictionTask task = data_->windows(data_->first_horizon());
  const PredictionFitter near(*data_, task, findings_->intensity, threads_, disturbance_);
  const VectorXd& scale = data_->output_scale();
  const PredictionFit present = near.fit(found_.fit.model, scale, {}, 0);
  if (!present.usable) return {};
  const VectorXd weights = near.errors(present, scale).cwiseMax(1e-9 * scale);
  const PredictionFit poorer = near.fit(found_.fit.model, weights, {}, kIterations);
  if (!poorer.usable) return {};
  PredictionFit best;
  for (const LawExtension& start :
       hypotheses_->extensions(poorer.model, near.motion(poorer), trials)) {
    if (start.law != "ripple" || start.location.kind != LocationKind::kElement) continue;
    const double amplitude = std::sqrt(2.0 * trials.front().share) * force.rms();
    for (const double sign : {1.0, -1.0}) {
      PredictionFit fit = near.fit(extended(poorer.model, start, sign * amplitude), weights,
                                   poorer.initials, kOfStarts);
      if (fit.usable && (!best.usable || fit.cost < best.cost)) best = std::move(fit);
    }
  }
  if (best.usable) best = near.fit_on(best, weights, kIterations);
  if (!best.usable || !(z_between(poorer, best) > kErrors)) return {};
  if (is_idle(poorer, best)) return {};
  const auto before = held_out_by(poorer.model, task), after = held_out_by(best.model, task);
  if (before &&
      !(after && relative_size(after->error, scale) < relative_size(before->error, scale))) {
    return {};
  }
  return best.model;
}

// Where inertia is small, a drive that does not answer to small commands moves a mass as dry
// friction there does. Every machine has that; few have such a drive.
bool FinalFit::take_friction_for_dead_drive(std::size_t law) {
  constexpr double kRarer = 4.0;     // z of a drive that is believed to be dead
  constexpr double kNoWorse = 1.02;  // of the error kept out
  const PlacedFinding placed = found_.fit.model.laws[law];
  const Element& part = found_.fit.model.model.parts[placed.part];
  if (part.law_name != "dead_zone" || part.location.kind != LocationKind::kActuator) return false;
  const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
  const JudgedModel without = judged(without_part(found_.fit.model, placed.part), kIterations);
  if (!without.fit.usable) return false;
  JudgedModel best;
  std::size_t taken = 0;
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].law != "coulomb" || !hypotheses_->is_plain(h)) continue;
    JudgedModel other = with_law(without, h);
    if (!other.fit.usable || (best.fit.usable && best.fit.cost <= other.fit.cost)) continue;
    best = std::move(other);
    taken = h;
  }
  if (!best.fit.usable || z_over(best) >= kRarer) return false;
  judge_held_out(best);
  judge_held_out(found_);
  if (best.held_out_error && found_.held_out_error &&
      relative_size(*best.held_out_error, best.held_out_scale) >
          kNoWorse * relative_size(*found_.held_out_error, found_.held_out_scale)) {
    return false;
  }
  accepted_as_[taken] = accepted_as(placed.hypothesis);
  found_ = std::move(best);
  return true;
}

// A law that fits as well as its rivals and raises the error kept out, as a constant force for the
// dry friction of motion one way: the rival that lowers that error most takes its place.
bool FinalFit::take_rival_that_holds(std::size_t law) {
  constexpr double kRaised = 1.05, kHolds = 0.7, kAsWell = 2.0;  // of the error; z
  const PlacedFinding placed = found_.fit.model.laws[law];
  const auto accepted =
      std::ranges::find(findings_->laws, accepted_as(placed.hypothesis), &AcceptedLaw::hypothesis);
  if (!data_->has_validation() || accepted == findings_->laws.end()) return false;
  const JudgedModel without = judged(without_part(found_.fit.model, placed.part), kIterations);
  const auto after = law_held_out(found_), before = law_held_out(without);
  if (!after || !before) return false;
  const VectorXd& scale = data_->output_scale();
  const double alone = relative_size(before->error, scale);
  if (relative_size(after->error, scale) < kRaised * alone) return false;
  double least = kHolds * alone;
  std::optional<JudgedModel> best;
  for (const TriedLaw& tried : accepted->rivals) {
    JudgedModel rival = with_law(without, tried.hypothesis);
    const auto error = rival.fit.usable ? law_held_out(rival) : std::nullopt;
    if (!error || relative_size(error->error, scale) >= least || z_over(rival) >= kAsWell) continue;
    least = relative_size(error->error, scale);
    accepted_as_[tried.hypothesis] = accepted->hypothesis;
    best = std::move(rival);
  }
  if (best) found_ = *std::move(best);
  return best.has_value();
}

JudgedModel FinalFit::weight_in_place_of(std::size_t law) const {
  const ExtendedLumpedModel& model = found_.fit.model;
  const std::size_t part = model.laws[law].part;
  const std::string& name = model.model.parts[part].law_name;
  if (name != "stiffness" && name != "cubic_spring" && name != "dead_zone") return {};
  const auto weight = hypotheses_->weight_like(model, part, motion());
  if (!weight) return {};
  return judged(extended(without_part(model, part), *weight, 1.0), kIterations);
}

// Over a part of its turn a weight pulls back as a spring does. Every arm has a weight.
bool FinalFit::take_weight_for_spring(std::size_t law) {
  JudgedModel weight = weight_in_place_of(law);
  if (!weight.fit.usable) return false;
  if (z_over(weight) >= kMissed && !predicts_further(weight)) return false;
  accepted_as_[weight.fit.model.laws.back().hypothesis] =
      accepted_as(found_.fit.model.laws[law].hypothesis);
  found_ = std::move(weight);
  return true;
}

JudgedModel FinalFit::best_of_starts(const ExtendedLumpedModel& model, std::size_t hypothesis,
                                     std::optional<std::size_t> replaced) const {
  constexpr double kStart = 0.1;       // of what acts at all
  constexpr int kFirstIterations = 6;  // from each; the best goes on
  std::vector<LawExtension> starts = hypotheses_->extensions(model, motion());
  std::erase_if(starts, [&](const LawExtension& start) {
    return start.hypothesis != hypothesis || start.replaces != replaced;
  });
  JudgedModel best;
  for (const LawExtension& start : starts) {
    JudgedModel each = judged(extended(model, start, kStart * start.unit),
                              starts.size() > 1 ? kFirstIterations : kIterations);
    if (each.fit.usable && (!best.fit.usable || each.fit.cost < best.fit.cost)) {
      best = std::move(each);
    }
  }
  if (best.fit.usable && starts.size() > 1) best = judged(best.fit.model, kIterations);
  return best;
}

JudgedModel FinalFit::with_law(const JudgedModel& poorer, std::size_t hypothesis) const {
  return best_of_starts(poorer.fit.model, hypothesis, {});
}

JudgedModel FinalFit::beside(std::size_t hypothesis) const {
  JudgedModel richer = with_law(found_, hypothesis);
  if (richer.fit.usable) {
    richer.deviations = deviations_of(fitter(task_).with_steady_slopes(richer.fit, weights_));
  }
  return richer;
}

JudgedModel FinalFit::in_place_of(std::size_t law, std::size_t hypothesis) const {
  const ExtendedLumpedModel& model = found_.fit.model;
  JudgedModel best = best_of_starts(model, hypothesis, model.laws[law].part);
  if (best.fit.usable) judge_held_out(best);
  return best;
}

std::size_t FinalFit::accepted_as(std::size_t hypothesis) const {
  const auto found = accepted_as_.find(hypothesis);
  return found == accepted_as_.end() ? hypothesis : found->second;
}

JudgedModel FinalFit::exchanged(std::size_t law, const ExtendedLumpedModel& rival) const {
  const ExtendedLumpedModel& model = found_.fit.model;
  return judged(with_last_law_of(rival, without_part(model, model.laws[law].part)), kIterations);
}

JudgedModel FinalFit::without(std::size_t law) const {
  JudgedModel result = refitted_without(found_.fit.model.laws[law]);
  judge_held_out(result);
  return result;
}

}  // namespace graybox
