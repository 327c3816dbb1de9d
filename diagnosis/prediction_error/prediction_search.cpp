#include "diagnosis/prediction_error/prediction_search.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include "diagnosis/prediction_error/friction_energy.hpp"
#include "diagnosis/prediction_error/law_groups.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/prediction_error/unsigned_outputs.hpp"
#include "diagnosis/predictor/residual_whitener.hpp"
#include "diagnosis/predictor/told_law.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFirstIterations = 40, kRungIterations = 15, kRaceIterations = 4,
              kRefitIterations = 10, kWeighIterations = 6, kPruneIterations = 8;
constexpr double kRace = 0.5;      // of the best gain after a few iterations: refitted to the end
constexpr double kHopeless = 0.3;  // of the gain that is asked for: no refit is worth it
constexpr double kPruneErrors = 1.5, kPruneGain = 0.03, kNoGain = 0.003;
constexpr double kEnergyMargin = 1.1;  // over what the poorer model fed in
constexpr double kWandered = 1.5;      // of what is stated, either way
constexpr double kMuch = 0.1;          // of the signal
constexpr double kClimbed = 0.9;       // of what free run leaves
constexpr double kSameCost = 0.02;     // more of it is no worse, however surely

bool leaves_much(const VectorXd& left) { return left.maxCoeff() > kMuch; }

void forget_derivatives(PredictionFit& fit) {
  fit.jacobian.resize(0, 0);
  fit.residuals.resize(0);
}

// Whether the law that was added last has a parameter at a bound.
bool has_run_away(const PredictionFit& fit) {
  const std::size_t first = fit.model.first_parameter(fit.model.laws.back().part);
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    if (fit.free[i] >= first && fit.at_bound[i]) return true;
  }
  return false;
}

// Whether the law added last is a spring that pushes away from where it stands: none that a machine
// has.
bool pushes_away(const PredictionFit& fit) {
  const LumpedModel& model = fit.model.model;
  const Element& law = model.parts[fit.model.laws.back().part];
  if (law.location.kind != LocationKind::kElement || law.law_name != "stiffness") return false;
  const VectorXd& b = law.location.output;
  return b.dot(model.stiffness * b) < 0.0;
}

// Whether the law added last is dry friction whose transition is fitted, too.
bool is_gradual_friction(const ExtendedLumpedModel& model) {
  const std::size_t part = model.laws.back().part;
  return model.model.parts[part].law_name == "coulomb" &&
         !model.model.parameters[model.first_parameter(part) + 1].fixed;
}

bool swings(const LawExtension& law) { return law.law == "mode" || law.law == "resonance"; }

// Hypotheses of the laws, sorted.
std::vector<std::size_t> laws_of(const ExtendedLumpedModel& model) {
  std::vector<std::size_t> laws;
  for (const PlacedFinding& law : model.laws) laws.push_back(law.hypothesis);
  std::ranges::sort(laws);
  return laws;
}

// The parameters that the model states, as `source` has them.
ExtendedLumpedModel with_own_values(const ExtendedLumpedModel& model, const LumpedModel& source) {
  std::vector<double> values = model.values();
  for (std::size_t i = 0; i < model.own_parameters(); ++i) values[i] = source.parameters[i].value;
  return with_values(model, values);
}

ExtendedLumpedModel without_laws(ExtendedLumpedModel model) {
  while (!model.laws.empty()) model = without_part(model, model.laws.back().part);
  return model;
}

}  // namespace

bool is_idle(const PredictionFit& without, const PredictionFit& with) {
  if (!without.usable) return false;
  const double gain = 1.0 - with.cost / without.cost, z = z_between(without, with);
  return gain < kNoGain || z < 0.0 || (gain < kPruneGain && z < kPruneErrors);
}

bool forgets(const LumpedModel& model, double duration) {
  std::vector<Index> free;
  for (std::size_t i = 0; i < model.imposed.size(); ++i) {
    if (!model.imposed[i]) free.push_back(static_cast<Index>(i));
  }
  if (free.empty()) return true;
  const auto n = static_cast<Index>(free.size());
  const MatrixXd inverse = MatrixXd(model.mass(free, free)).inverse();
  MatrixXd a = MatrixXd::Zero(2 * n, 2 * n);
  a.topRightCorner(n, n).setIdentity();
  a.bottomLeftCorner(n, n) = -inverse * model.stiffness(free, free);
  a.bottomRightCorner(n, n) = -inverse * model.damping(free, free);
  constexpr double kShare = 5.0;
  return a.eigenvalues().real().maxCoeff() < -kShare / duration;
}

PredictionSearch::PredictionSearch(const PredictionData& data,
                                   const PredictionHypotheses& hypotheses,
                                   PredictionSearchOptions options)
    : data_(&data), hypotheses_(&hypotheses), options_(std::move(options)) {
  intensities_ = force_noise_intensities(data);
}

bool PredictionSearch::proceed(const std::string& step) {
  if (!options_.proceed || options_.proceed(step)) return true;
  findings_.stopped = true;
  return false;
}

PredictionFitter PredictionSearch::fitter(const State& state) const {
  return {*data_, state.task, findings_.filter_intensity(), options_.threads, disturbance_};
}

std::vector<Index> PredictionSearch::window_ladder() const {
  std::vector<Index> horizons;
  for (Index decade = data_->first_horizon();; decade *= 10) {
    for (const Index horizon : {decade, 3 * decade}) {
      if (data_->window_count(horizon) < kFewestHorizonWindows) return horizons;
      horizons.push_back(horizon);
    }
  }
}

// Weights: what the present model leaves.
void PredictionSearch::weigh(State& state) const {
  constexpr double kLeast = 1e-9;  // of the signal
  const PredictionFitter fitter = this->fitter(state);
  state.error = fitter.errors(state.fit, state.weights);
  state.weights = state.error.cwiseMax(kLeast * data_->output_scale());
  state.fit = fitter.fit(state.fit.model, state.weights, state.fit.initials, kWeighIterations);
  state.error = fitter.errors(state.fit, state.weights);
  state.by_noise = fitter.errors_by_noise(state.fit, state.weights);
}

// With the model's own parameters where the search began.
ExtendedLumpedModel PredictionSearch::as_started(const ExtendedLumpedModel& model) const {
  return with_own_values(model, start_.model);
}

std::optional<PredictionFit> PredictionSearch::as_stated(const State& state) const {
  if (!findings_.laws.empty() || !has_wandered(state.fit.model)) return {};
  PredictionFit stated = fitter(state).fit(with_own_values(state.fit.model, *stated_),
                                           state.weights, state.fit.initials, 0);
  if (!stated.usable) return {};
  return stated;
}

// The model on a rung, with the force noise that predicts best there. False: it can't be simulated.
bool PredictionSearch::climb(Index horizon, const ExtendedLumpedModel& from, State& state) {
  state.task = data_->windows(horizon);
  state.weights = 0.01 * data_->output_scale();
  const bool is_first = findings_.rungs.empty();
  const int iterations = is_first ? kFirstIterations : kRungIterations;
  PredictionFit best;
  double intensity = findings_.intensity;
  // The first rung says which; later ones keep it.
  std::vector<double> candidates{findings_.intensity};
  if (horizon > 0 && !(findings_.intensity > 0.0)) candidates = intensities_;
  const auto take = [&](PredictionFit fit, double candidate) {
    if (!fit.usable || (best.usable && !(fit.cost < best.cost))) return;
    best = std::move(fit);
    intensity = candidate;
  };
  for (const double candidate : candidates) {
    const PredictionFitter fitter(*data_, state.task, candidate, options_.threads, disturbance_);
    PredictionFit fit =
        fitter.fit(best.usable ? best.model : from, state.weights, best.initials, iterations);
    // The gain was that of the model before.
    if (is_first && fit.usable) {
      fit = fitter.fit(fit.model, state.weights, fit.initials, iterations);
    }
    take(std::move(fit), candidate);
  }
  if (!is_first) {  // a short horizon may have led into another valley
    const PredictionFitter fitter(*data_, state.task, intensity, options_.threads, disturbance_);
    take(fitter.fit(as_started(from), state.weights, {}, iterations), intensity);
  }
  if (!best.usable) return false;
  findings_.intensity = intensity;
  state.fit = std::move(best);
  weigh(state);
  return state.fit.usable;
}

bool PredictionSearch::is_noise(const State& state) const {
  if (findings_.followed) return false;  // a law may be small beside it, and told all the same
  // An rms of N white samples is told to 1 / sqrt(2 N) of it.
  constexpr double kErrors = 4.0;
  const double of_white = 1.0 / std::sqrt(2.0 * static_cast<double>(state.task.counted()));
  const double at_noise = 1.0 + std::min(options_.at_noise, kErrors * of_white);
  for (Index j = 0; j < state.error.size(); ++j) {
    const double limit = data_->is_rounded(j) ? options_.at_rounding : at_noise;
    if (!(state.error(j) < limit * state.by_noise(j))) return false;
  }
  return true;
}

bool PredictionSearch::has_wandered(const ExtendedLumpedModel& model) const {
  const std::vector<double> values = model.values();
  for (std::size_t p = 0; p < model.own_parameters(); ++p) {
    const ParameterSpace& space = model.space[p];
    if (model.model.parameters[p].fixed || !space.logarithmic || space.may_vanish()) continue;
    const double ratio = values[p] / stated_->parameters[p].value;
    if (!(ratio < kWandered && ratio > 1.0 / kWandered)) return true;
  }
  return false;
}

PredictionFit PredictionSearch::refit(const State& state, const PredictionFit& from,
                                      const LawExtension& law, double amplitude) const {
  const PredictionFitter fitter = this->fitter(state);
  ExtendedLumpedModel best_start;
  double best = std::numeric_limits<double>::infinity();
  VectorXd residuals;
  for (const double share : {1.0, 0.3, 0.05}) {
    ExtendedLumpedModel start = extended(from.model, law, share * amplitude);
    if (!fitter.residuals(start, state.weights, from.initials, from.gain, residuals)) continue;
    const double cost = residuals.squaredNorm();
    if (cost < best) {
      best = cost;
      best_start = std::move(start);
    }
    if (best < from.cost || law.is_secant) break;
  }
  if (!std::isfinite(best)) return {};
  return fitter.fit(best_start, state.weights, from.initials, kRaceIterations);
}

double PredictionSearch::fed_in_by(const State& state, const PredictionFit& fit) const {
  return fed_in_share(fit.model.model, fitter(state).motion(fit), data_->sample_time());
}

// Over whole recordings the slope at no weight says little of a weight, which every arm may have.
void PredictionSearch::add_weights(const std::vector<ExtensionScore>& scores,
                                   const std::vector<LawExtension>& extensions,
                                   std::vector<std::size_t>& list) {
  for (const ExtensionScore& score : scores) {
    const LawExtension& law = extensions[score.extension];
    const bool is_there = std::ranges::any_of(
        list, [&](std::size_t other) { return extensions[other].hypothesis == law.hypothesis; });
    if (law.law == "gravity" && !is_there) list.push_back(score.extension);
  }
}

// Gradual friction may run away where a sharp one does not: noise hides how it slides over.
void PredictionSearch::add_sharp_friction(const std::vector<LawExtension>& extensions,
                                          std::vector<std::size_t>& list) {
  const auto is_friction = [](const LawExtension& law) {
    return law.law == "coulomb" && law.fixed.size() == 2;
  };
  for (const std::size_t gradual : std::vector<std::size_t>(list)) {
    if (!is_friction(extensions[gradual]) || extensions[gradual].fixed[1]) continue;
    const auto sharp = std::ranges::find_if(extensions, [&](const LawExtension& law) {
      return law.hypothesis == extensions[gradual].hypothesis && is_friction(law) && law.fixed[1];
    });
    if (sharp != extensions.end())
      list.push_back(static_cast<std::size_t>(sharp - extensions.begin()));
  }
}

std::vector<TriedLaw> PredictionSearch::start_race(const State& state,
                                                   const std::vector<LawExtension>& extensions,
                                                   std::span<const ScoredStart> starts) const {
  std::vector<std::size_t> list;  // extensions, one a hypothesis
  for (const ScoredStart& start : starts) {
    for (const ExtensionScore& score :
         shortlist(start.scores, extensions, options_.shortlist, options_.whitened_shortlist)) {
      const LawExtension& law = extensions[score.extension];
      if (!law.is_secant && score.share < kHopeless * options_.least_gain) continue;
      const bool is_there = std::ranges::any_of(
          list, [&](std::size_t other) { return extensions[other].hypothesis == law.hypothesis; });
      if (!is_there) list.push_back(score.extension);
    }
    add_weights(start.scores, extensions, list);
  }
  add_sharp_friction(extensions, list);
  std::vector<TriedLaw> tried;
  for (const std::size_t extension : list) {
    const LawExtension& law = extensions[extension];
    TriedLaw one;
    one.hypothesis = law.hypothesis;
    for (const ScoredStart& start : starts) {
      const auto score = std::ranges::find(start.scores, extension, &ExtensionScore::extension);
      if (score == start.scores.end()) continue;
      PredictionFit fit = refit(state, *start.fit, law, law.is_secant ? 1.0 : score->amplitude);
      const bool is_best = fit.usable && (!one.fit.usable || fit.cost < one.fit.cost);
      if (is_best) one.fit = std::move(fit);
    }
    if (one.fit.usable) tried.push_back(std::move(one));
  }
  return tried;
}

namespace {

// Keeps one fit of each hypothesis, of those sorted by cost: the best that a machine can have, else
// the best.
void keep_one_of_each(std::vector<TriedLaw>& tried) {
  std::vector<TriedLaw> kept;
  for (TriedLaw& law : tried) {
    const auto other = std::ranges::find(kept, law.hypothesis, &TriedLaw::hypothesis);
    if (other == kept.end()) {
      kept.push_back(std::move(law));
    } else if (!other->is_possible() && law.is_possible()) {
      *other = std::move(law);
    }
  }
  tried = std::move(kept);
  std::ranges::stable_sort(tried, std::less{}, [](const TriedLaw& law) { return law.fit.cost; });
}

}  // namespace

void PredictionSearch::end_race(const State& state, std::vector<TriedLaw>& tried) const {
  const double fed_limit = std::max(options_.fed_in, kEnergyMargin * fed_in_by(state, state.fit));
  const auto gain = [&](const TriedLaw& law) { return state.fit.cost - law.fit.cost; };
  double best = 0.0;
  for (const TriedLaw& law : tried) best = std::max(best, gain(law));
  for (TriedLaw& one : tried) {
    if (gain(one) >= kRace * best) {
      one.fit = fitter(state).fit_on(one.fit, state.weights, kRefitIterations);
    }
    one.z = hypotheses_->z_of_law(one.hypothesis, state.fit, one.fit);
    one.gain = 1.0 - one.fit.cost / state.fit.cost;
    one.feeds_energy = fed_in_by(state, one.fit) > fed_limit;
    one.ran_away = has_run_away(one.fit) || pushes_away(one.fit) ||
                   is_on_no_machine(one.fit, one.fit.model.laws.back(), *data_);
  }
  std::ranges::stable_sort(tried, std::less{}, [](const TriedLaw& law) { return law.fit.cost; });
  keep_one_of_each(tried);
}

std::size_t PredictionSearch::plainest(const std::vector<TriedLaw>& tried,
                                       const std::vector<LawExtension>& extensions,
                                       const State& state) const {
  // Near the noise of a sensor, which may be rounding and not white, more is asked for. Rounding
  // follows the motion, and a law may take some of it; a late channel takes less than others.
  const bool is_near_noise =
      (state.error.array() < options_.noise_multiple * state.by_noise.array()).all();
  double rounding = 0.0;
  for (Index k = 0; k < state.error.size(); ++k) {
    if (!data_->is_rounded(k)) continue;
    rounding +=
        std::pow(state.by_noise(k) / state.error(k), 2) / static_cast<double>(state.error.size());
  }
  constexpr double kSureChiSquare = 25.0;  // of white residuals
  const auto least_gain = [&](const TriedLaw& law) {
    const std::string& name = hypotheses_->hypotheses()[law.hypothesis].law;
    double least =
        hypotheses_->is_plain(law.hypothesis) ? options_.least_gain : options_.least_gain_rare;
    if (name == "mode" || name == "resonance") least = options_.least_gain_mode;
    if (hypotheses_->is_late_channel(law.hypothesis)) {
      return std::max(least, options_.least_gain_of_rounding * rounding);
    }
    const bool is_sure = rounding == 0.0 && law.evidence > kSureChiSquare;
    return is_near_noise && !is_sure ? std::max(least, options_.least_gain_near_noise) : least;
  };
  const auto is_good = [&](const TriedLaw& law) {
    const bool is_told =
        law.z > options_.errors_of_gain ||
        (hypotheses_->acts_in_moments(law.hypothesis) && takes_most(law.gain, law.evidence, law.z));
    return law.is_possible() && is_told && law.gain > least_gain(law) &&
           law.evidence >= options_.least_evidence;
  };
  // In motion one way a constant force is as good as dry friction, which every machine has; and dry
  // friction with a transition as wide as the motion is viscous friction.
  const auto complexity = [&](const TriedLaw& law) {
    const auto own = std::ranges::find(extensions, law.hypothesis, &LawExtension::hypothesis);
    const int within = own->law == "offset" ? 2 : is_gradual_friction(law.fit.model) ? 1 : 0;
    return 3 * own->complexity + within;
  };
  std::size_t taken = tried.size();
  std::size_t best = tried.size();
  for (std::size_t i = 0; i < tried.size(); ++i) {
    if (!is_good(tried[i])) continue;
    if (best == tried.size()) {
      taken = best = i;
      continue;
    }
    const double behind = tried[i].fit.cost - tried[best].fit.cost;
    const bool is_equal =
        behind < kSameCost * tried[best].fit.cost ||
        (behind < (1.0 - options_.equal_gain) * (state.fit.cost - tried[best].fit.cost) &&
         (is_gradual_friction(tried[best].fit.model) ||
          z_between(tried[i].fit, tried[best].fit) < options_.equal_errors));
    if (is_equal && complexity(tried[i]) < complexity(tried[taken])) taken = i;
  }
  return taken;
}

void PredictionSearch::accept(std::vector<TriedLaw> tried, std::size_t taken, State& state) {
  AcceptedLaw law{
      tried[taken].hypothesis, state.task.horizon, tried[taken].z, tried[taken].gain, {}, {}};
  for (std::size_t i = 0; i < tried.size(); ++i) {
    TriedLaw& other = tried[i];
    if (i == taken) continue;
    other.behind = z_between(other.fit, tried[taken].fit);
    const bool stands = other.is_possible() && other.z > options_.errors_of_gain &&
                        other.gain > options_.least_gain && other.behind < options_.rival_errors;
    forget_derivatives(other.fit);
    (stands ? law.rivals : law.excluded).push_back(std::move(other));
  }
  state.fit = std::move(tried[taken].fit);
  findings_.laws.push_back(std::move(law));
}

// At each free coordinate; none where no force is recorded.
std::vector<LatentForce> PredictionSearch::latent_forces(const ExtendedLumpedModel& model) const {
  std::vector<LatentForce> forces;
  if (!std::isfinite(data_->largest_force()) || !(findings_.intensity > 0.0)) return forces;
  for (std::size_t i = 0; i < model.model.imposed.size(); ++i) {
    if (model.model.imposed[i]) continue;
    forces.push_back(latent_force(*data_, ExperimentRole::kEstimation, model, findings_.intensity,
                                  static_cast<Index>(i), options_.threads));
  }
  return forces;
}

std::vector<RippleTrial> PredictionSearch::ripples(const State& state) const {
  std::vector<RippleTrial> trials;
  for (const LatentForce& force : latent_forces(state.fit.model)) {
    std::ranges::copy(ripple_trials(force), std::back_inserter(trials));
  }
  return trials;
}

// The gain in chi-square, less the share that goes once the residuals are white.
double PredictionSearch::evidence_of(const TriedLaw& law, const State& state,
                                     const std::vector<LawExtension>& extensions,
                                     const std::vector<ExtensionScore>& scores) {
  double white = 0.0;
  for (const ExtensionScore& score : scores) {
    if (extensions[score.extension].hypothesis != law.hypothesis || !(score.share > 0.0)) continue;
    white = std::max(white, std::min(1.0, score.whitened_share / score.share));
  }
  return white * law.gain * static_cast<double>(state.fit.residuals.size());
}

bool PredictionSearch::add_law(State& state) {
  const PredictionFitter fitter = this->fitter(state);
  std::vector<LawExtension> extensions =
      hypotheses_->extensions(state.fit.model, fitter.motion(state.fit), ripples(state));
  if (disturbance_.is_there()) std::erase_if(extensions, swings);  // each imitates the other
  const std::vector<ExtensionScore> scores =
      extension_scores(fitter, state.fit, state.weights, extensions);
  if (findings_.ranked.empty()) {
    findings_.ranking = scores;
    findings_.ranked = extensions;
  }
  std::vector<ScoredStart> starts{{&state.fit, scores}};
  const std::optional<PredictionFit> stated = as_stated(state);
  if (stated) {
    starts.push_back({&*stated, extension_scores(fitter, *stated, state.weights, extensions)});
  }
  std::vector<TriedLaw> tried = start_race(state, extensions, starts);
  end_race(state, tried);
  for (TriedLaw& law : tried) law.evidence = evidence_of(law, state, extensions, scores);
  const std::size_t taken = plainest(tried, extensions, state);
  const PredictionFit& best = taken < tried.size() ? tried[taken].fit : state.fit;
  if (findings_.laws.empty() && add_group(state, stated, extensions, best)) return true;
  if (taken == tried.size()) return false;
  accept(std::move(tried), taken, state);
  return true;
}

// Whether a group of plain laws takes the place of the best single law. What decays acts in few
// blocks: z is small there, however much is taken. And plain laws need not be surer than one law
// that few machines have.
bool PredictionSearch::is_group_better(const State& state, const PredictionFit& best_single,
                                       const PredictionFit& group) const {
  constexpr double kNoWorse = -1.0;  // z
  const double gain = 1.0 - group.cost / best_single.cost;
  if (!group.usable || !(gain > options_.group_gain)) return false;
  const double z = z_between(best_single, group);
  const std::vector<PlacedFinding>& single = best_single.model.laws;
  const bool is_rare = single.size() > state.fit.model.laws.size() &&
                       !hypotheses_->is_plain(single.back().hypothesis);
  return z > (is_rare ? kNoWorse : options_.errors_of_gain) ||
         takes_most(gain,
                    white_evidence(state.task, data_->output_count(), best_single.residuals,
                                   group.residuals),
                    z);
}

bool PredictionSearch::add_group(State& state, const std::optional<PredictionFit>& stated,
                                 const std::vector<LawExtension>& extensions,
                                 const PredictionFit& best_single) {
  std::vector<std::vector<LawExtension>> groups =
      resting_springs(extensions, state.fit.model.model);
  groups.push_back(friction_group(extensions, state.fit.model.model));
  std::ranges::move(dragged_friction(extensions, state.fit.model.model),
                    std::back_inserter(groups));
  std::ranges::move(bent_drives(extensions, state.fit.model.model), std::back_inserter(groups));
  if (data_->moves_freely()) {
    std::ranges::move(braked_weights(extensions, state.fit.model.model),
                      std::back_inserter(groups));
  }
  const double fed_limit = std::max(options_.fed_in, kEnergyMargin * fed_in_by(state, state.fit));
  const std::vector<LawExtension>* taken = nullptr;
  PredictionFit best;
  for (const std::vector<LawExtension>& group : groups) {
    if (group.size() < 2) continue;
    PredictionFit fit =
        with_group(fitter(state), state.fit, state.weights, group, kFirstIterations);
    if (stated) {
      PredictionFit other =
          with_group(fitter(state), *stated, state.weights, group, kFirstIterations);
      if (other.usable && (!fit.usable || other.cost < fit.cost)) fit = std::move(other);
    }
    if (!is_group_better(state, best_single, fit) || fed_in_by(state, fit) > fed_limit) continue;
    if (turns_its_drive(fit, fit.model.laws.back())) continue;
    const bool is_spring = group.front().law == "stiffness";
    if (is_spring && !swings_about_rest(fit.model, fitter(state).motion(fit))) continue;
    if (best.usable && best.cost <= fit.cost) continue;
    best = std::move(fit);
    taken = &group;
  }
  if (taken == nullptr) return false;
  const double z = z_between(best_single, best), gain = 1.0 - best.cost / state.fit.cost;
  state.fit = std::move(best);
  for (const LawExtension& law : *taken) {
    findings_.laws.push_back({law.hypothesis, state.task.horizon, z, gain, {}, {}});
  }
  prune(state);
  return true;
}

bool PredictionSearch::is_idle_here(const PredictionFit& without, const PredictionFit& with) const {
  if (!findings_.followed) return is_idle(without, with);
  return without.usable &&
         (1.0 - with.cost / without.cost < options_.least_gain || z_between(without, with) < 0.0);
}

void PredictionSearch::prune(State& state) {
  for (std::size_t l = 0; l < state.fit.model.laws.size();) {
    const PlacedFinding law = state.fit.model.laws[l];
    const PredictionFit without =
        fitter(state).fit(without_part(state.fit.model, law.part), state.weights,
                          state.fit.initials, kPruneIterations);
    if (!is_idle_here(without, state.fit)) {
      ++l;
      continue;
    }
    state.fit = without;
    l = 0;
  }
  // A law that contains another took its place.
  std::erase_if(findings_.laws, [&](const AcceptedLaw& law) {
    return std::ranges::none_of(state.fit.model.laws, [&](const PlacedFinding& placed) {
      return placed.hypothesis == law.hypothesis;
    });
  });
}

void PredictionSearch::search_rung(State& state) {
  // Laws that were there before come again for ever where one is taken and pruned in turn.
  std::set<std::vector<std::size_t>> known{laws_of(state.fit.model)};
  while (state.fit.model.laws.size() < options_.most_laws) {
    const std::string step = fmt::format("{} samples ahead, {} laws found: ranking and refitting",
                                         state.task.horizon, state.fit.model.laws.size());
    if (!proceed(step) || !add_law(state)) return;
    prune(state);
    weigh(state);
    if (is_noise(state) || !known.insert(laws_of(state.fit.model)).second) return;
  }
}

void PredictionSearch::search_beside_disturbance() {
  constexpr int kRounds = 2;
  const Index first = data_->first_horizon();
  for (int round = 0; round < kRounds; ++round) {
    const std::optional<LatentForce> force =
        likeliest_force(*data_, findings_.found, findings_.intensity, options_.threads);
    if (!force) return;
    disturbance_ = force->disturbance;
    const std::vector<std::size_t> before = laws_of(findings_.found);
    for (const Index horizon : {first, 3 * first}) {
      State state;
      if (!proceed(fmt::format("{} samples ahead, beside a disturbance: fitting", horizon))) return;
      if (!climb(horizon, findings_.found, state)) return;
      if (!is_noise(state)) search_rung(state);
      findings_.found = state.fit.model;
    }
    if (laws_of(findings_.found) == before) return;
  }
}

// Where no window shows more than twice the sensors' noise, forces are too small to be seen so
// soon: over the whole recording they add up. What explains that is a law; what nothing explains
// may be the sum of disturbances, and says nothing.
void PredictionSearch::look_at_free_run() {
  constexpr double kNearNoise = 2.0;
  const bool leaves_more = std::ranges::any_of(
      findings_.rungs, [](const Rung& rung) { return rung.over_noise > kNearNoise; });
  if (findings_.rungs.empty() || findings_.has_free_run || !findings_.laws.empty() || leaves_more) {
    return;
  }
  const PredictionFindings before = findings_;
  State state;
  if (proceed("free run: fitting") && climb(0, findings_.found, state) && !is_noise(state)) {
    search_rung(state);
    if (!findings_.laws.empty()) {
      findings_.found = state.fit.model;
      findings_.rungs.push_back({0, true, 0.0});
      findings_.left = state.error.cwiseQuotient(data_->output_scale());
      findings_.has_free_run = true;
      return;
    }
  }
  const bool stopped = findings_.stopped;
  findings_ = before;
  findings_.stopped = stopped;
}

// The disturbance that is likeliest beside the model as it is; false: none can be told.
bool PredictionSearch::follow_disturbance() {
  const std::optional<LatentForce> force =
      likeliest_force(*data_, findings_.found, findings_.intensity, options_.threads);
  if (!force) return false;
  disturbance_ = force->disturbance;
  findings_.followed = disturbance_;
  return true;
}

// From the model as it is, and from the values stated: without the law found last the parameters
// may have left their valley.
bool PredictionSearch::fit_one_ahead(State& state) const {
  state.task = data_->windows(1);
  state.weights = data_->noise();
  const PredictionFitter near = fitter(state);
  state.fit = near.fit(findings_.found, state.weights, {}, kRungIterations);
  if (!findings_.laws.empty()) {
    PredictionFit stated =
        near.fit(with_own_values(findings_.found, *stated_), state.weights, {}, kFirstIterations);
    const bool is_better = stated.usable && (!state.fit.usable || stated.cost < state.fit.cost);
    if (is_better) state.fit = std::move(stated);
  }
  if (!state.fit.usable) return false;
  weigh(state);
  return state.fit.usable;
}

PredictionFindings PredictionSearch::search_innovations(const LumpedModel& stated,
                                                        const PredictionFindings& ladder,
                                                        const ExtendedLumpedModel& without) {
  constexpr int kRounds = 4;
  findings_ = ladder;
  findings_.laws.clear();
  findings_.found = start_ = without;
  stated_ = &stated;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<std::size_t> before = laws_of(findings_.found);
    State state;
    if (!proceed("one sample ahead, beside a disturbance: ranking and refitting")) break;
    if (!follow_disturbance() || !fit_one_ahead(state) || !add_law(state)) break;
    prune(state);
    findings_.found = state.fit.model;
    if (laws_of(findings_.found) == before) break;
  }
  return std::move(findings_);
}

PredictionFindings PredictionSearch::search_whole(const LumpedModel& stated,
                                                  const PredictionFindings& ladder,
                                                  const ExtendedLumpedModel& from) {
  findings_ = ladder;
  std::erase_if(findings_.laws, [&](const AcceptedLaw& law) {
    return std::ranges::count(from.laws, law.hypothesis, &PlacedFinding::hypothesis) == 0;
  });
  findings_.followed.reset();
  findings_.found = start_ = from;
  stated_ = &stated;
  disturbance_ = {};
  State state;
  if (!proceed("free run: fitting") || !climb(0, findings_.found, state)) {
    return std::move(findings_);
  }
  search_rung(state);
  findings_.found = state.fit.model;
  findings_.rungs.push_back({0, true, 0.0});
  findings_.left = state.error.cwiseQuotient(data_->output_scale());
  findings_.has_free_run = true;
  return std::move(findings_);
}

// Where what is measured forgets the start, free run says all. But where a law is missing the model
// may leave its valley there, and the law then gains nothing. So where much is left the search is
// repeated over longer and longer windows, and the better of both is taken.
PredictionFindings PredictionSearch::run(const LumpedModel& model) {
  const double duration = data_->sample_time() * static_cast<double>(data_->shortest());
  std::vector<Index> windows = window_ladder();
  if (!forgets(model, duration)) return search_over(windows, model);
  PredictionFindings free = search_over({0}, model);
  const bool moves = !std::ranges::all_of(model.imposed, [](bool imposed) { return imposed; });
  if (!moves || windows.empty() || free.stopped || (free.usable && !leaves_much(free.left))) {
    return free;
  }
  windows.push_back(0);
  PredictionFindings climbed = search_over(windows, model);
  const bool is_better = climbed.has_free_run && climbed.usable &&
                         (!free.usable || climbed.left.mean() < kClimbed * free.left.mean());
  if (climbed.stopped) free.stopped = true;
  return is_better ? std::move(climbed) : std::move(free);
}

PredictionFindings PredictionSearch::search_over(const std::vector<Index>& horizons,
                                                 const LumpedModel& model) {
  findings_ = {};
  stated_ = &model;
  findings_.sample_time = data_->sample_time();
  const bool moves = !std::ranges::all_of(model.imposed, [](bool imposed) { return imposed; });
  findings_.found = moves ? with_unsigned_outputs(with_zeros(model, *data_, *hypotheses_), *data_,
                                                  *hypotheses_, options_.threads)
                          : as_given(model, kSearchFactor);
  for (const PlacedFinding& zero : findings_.found.laws) {
    findings_.laws.push_back({zero.hypothesis,
                              data_->first_horizon(),
                              options_.errors_of_gain,
                              options_.least_gain,
                              {},
                              {}});
  }
  if (moves) findings_.found = started_to_predict(findings_.found, *data_, options_.threads);
  start_ = findings_.started = findings_.found;
  disturbance_ = {};
  findings_.as_given = without_laws(findings_.found);
  findings_.has_free_run = !horizons.empty() && horizons.front() == 0;
  State state;
  if (findings_.has_free_run && moves) {  // a start for it
    if (climb(data_->first_horizon(), findings_.found, state)) findings_.found = state.fit.model;
  }
  for (const Index horizon : horizons) {
    if (!proceed(fmt::format("{} samples ahead: fitting", horizon))) break;
    if (!climb(horizon, findings_.found, state)) break;
    if (!findings_.usable) {
      findings_.as_given = without_laws(state.fit.model);
      findings_.usable = true;
      findings_.first_horizon = horizon;
    }
    Rung rung{horizon, false, state.error.cwiseQuotient(state.by_noise).maxCoeff()};
    const bool has_skill =
        (state.error.array() < options_.no_skill * data_->output_scale().array()).any();
    if (!has_skill && !findings_.rungs.empty()) break;
    if (!is_noise(state)) {
      search_rung(state);
      rung.was_searched = true;
    }
    findings_.found = state.fit.model;
    findings_.rungs.push_back(rung);
    findings_.left = state.error.cwiseQuotient(data_->output_scale());
    findings_.has_free_run = horizon == 0;
  }
  if (moves && !findings_.stopped) look_at_free_run();
  const bool is_disturbed = !findings_.rungs.empty() && !findings_.has_free_run &&
                            std::ranges::any_of(findings_.rungs, &Rung::was_searched);
  if (is_disturbed && !findings_.stopped) search_beside_disturbance();
  return std::move(findings_);
}

}  // namespace graybox
