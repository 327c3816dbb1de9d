#include "diagnosis/prediction_verdict/prediction_effects.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/predictor/told_law.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

constexpr double kExcluded = 2.0;  // z of what is found over a rival

double percent(const VectorXd& error, const VectorXd& scale) {
  return 100.0 * relative_size(error, scale);
}

Rival rival_of(const TriedLaw& tried) {
  Rival rival;
  rival.law = fitted_law(tried.fit.model, tried.fit.model.laws.back(), nullptr);
  rival.bic_difference = tried.behind * std::abs(tried.behind);
  return rival;
}

bool is_named(std::size_t hypothesis, const FoundEffect& effect) {
  const auto names = [&](const std::vector<Rival>& rivals) {
    return std::ranges::any_of(
        rivals, [&](const Rival& rival) { return rival.law.hypothesis == hypothesis; });
  };
  return names(effect.rivals) || names(effect.excluded);
}

}  // namespace

FittedLaw fitted_law(const ExtendedLumpedModel& model, const PlacedFinding& law,
                     const JudgedModel* judged) {
  FittedLaw result;
  result.hypothesis = law.hypothesis;
  const Element& part = model.model.parts[law.part];
  const LawEntry& entry = *find_law(part.law_name, part.location.kind != LocationKind::kElement);
  const std::size_t first = model.first_parameter(law.part);
  for (std::size_t p = 0; p < part.parameters.size(); ++p) {
    double error = std::numeric_limits<double>::quiet_NaN();
    if (judged != nullptr) {
      const auto at = std::ranges::find(judged->fit.free, first + p);
      if (at != judged->fit.free.end()) error = judged->deviations(at - judged->fit.free.begin());
    }
    result.parameters.push_back(
        estimate_of(entry.parameters[p], part.location.units, part.parameters[p], error));
  }
  return result;
}

std::optional<HeldOutEffect> PredictionEffects::effect_of(const JudgedModel& without) const {
  constexpr double kAsGoodAsNothing = 5.0;  // % of the signal
  const auto effect = effect_between(from_.final->law_held_out(without),
                                     from_.final->law_held_out(from_.final->found()));
  if (!effect || !effect->misleads) return effect;
  // Over whole runs the force that remains adds up to more than a law does.
  if (effect->seconds_ahead == 0.0) {
    const auto ahead =
        effect_between(from_.final->held_out_ahead(without, kDisturbedShare),
                       from_.final->held_out_ahead(from_.final->found(), kDisturbedShare));
    return ahead ? ahead : effect;
  }
  if (effect->error_with > kAsGoodAsNothing) return effect;
  // So little ahead hardly anything is missed with or without it.
  const auto judged = effect_between(from_.final->held_out_as_judged(without),
                                     from_.final->held_out_as_judged(from_.final->found()));
  return judged ? judged : effect;
}

std::optional<HeldOutEffect> PredictionEffects::effect_between(
    const std::optional<HeldOutError>& poorer, const std::optional<HeldOutError>& richer) const {
  if (!poorer || !richer) return {};
  const VectorXd& scale = from_.final->found().held_out_scale;
  HeldOutEffect effect;
  effect.error_without = percent(poorer->error, scale);
  effect.error_with = percent(richer->error, scale);
  effect.seconds_ahead = static_cast<double>(richer->horizon) * from_.data->sample_time();
  const double floor = percent(from_.data->noise(), scale);
  const double before = effect.error_without * effect.error_without - floor * floor;
  const double after = effect.error_with * effect.error_with - floor * floor;
  effect.gain = before > 0.0 ? 1.0 - std::max(after, 0.0) / before : 0.0;
  effect.misleads = effect.error_with > 1.05 * effect.error_without;
  return effect;
}

std::vector<FoundEffect> PredictionEffects::of(std::span<const FittedLaw> laws) const {
  std::vector<FoundEffect> effects;
  const ExtendedLumpedModel& model = from_.final->found().fit.model;
  for (std::size_t l = 0; l < model.laws.size(); ++l) {
    FoundEffect effect;
    effect.law = laws[l];
    const JudgedModel without = from_.final->without(l);
    if (without.fit.usable) {
      const double z = from_.final->z_over(without);
      effect.law.wald_statistic = z * std::abs(z);
      effect.bic_difference = effect.law.wald_statistic;
      effect.explained_share = 1.0 - from_.final->found().fit.cost / without.fit.cost;
      effect.held_out = effect_of(without);
    }
    const auto accepted =
        std::ranges::find(from_.findings->laws, from_.final->accepted_as(model.laws[l].hypothesis),
                          &AcceptedLaw::hypothesis);
    if (accepted != from_.findings->laws.end()) add_rivals(*accepted, l, effect);
    if (without.fit.usable) {
      add_rivals_elsewhere(model.laws[l].hypothesis, without, effect);
      add_richer_friction(l, effect);
      add_weight(l, effect);
      add_bent_drive_or_drag(without, effect);
    }
    unite_delays(effect);
    unite_forces_one_way(l, effect);
    effects.push_back(std::move(effect));
  }
  return effects;
}

// A rival that was found as a law of its own later is none; of the others each takes the place of
// the law in the model as it is at the end.
void PredictionEffects::add_rivals(const AcceptedLaw& accepted, std::size_t law,
                                   FoundEffect& effect) const {
  constexpr std::size_t kNamed = 3;
  for (const TriedLaw& tried : accepted.rivals) {
    if (is_found(tried.hypothesis)) continue;
    const JudgedModel exchanged = from_.final->exchanged(law, tried.fit.model);
    Rival rival = rival_of(tried);
    if (exchanged.fit.usable) {
      if (is_on_no_machine(exchanged.fit, exchanged.fit.model.laws.back(), *from_.data)) continue;
      const double z = from_.final->z_over(exchanged);
      rival.law = fitted_law(exchanged.fit.model, exchanged.fit.model.laws.back(), nullptr);
      rival.bic_difference = z * std::abs(z);
      const bool stands = z < kExcluded;
      if (stands && contains(tried.hypothesis, effect.law.hypothesis)) continue;
      (stands ? effect.rivals : effect.excluded).push_back(std::move(rival));
    } else {
      effect.excluded.push_back(std::move(rival));
    }
  }
  // Others were no explanation by themselves, which says nothing of them beside it.
  for (const TriedLaw& tried : accepted.excluded) {
    if (effect.excluded.size() == kNamed) break;
    if (is_found(tried.hypothesis)) continue;
    if (tried.behind > kExcluded) effect.excluded.push_back(rival_of(tried));
  }
}

// A law that is another one for some of its parameters predicts as well, and is no rival of it.
bool PredictionEffects::contains(std::size_t richer, std::size_t plainer) const {
  const Hypothesis& a = from_.hypotheses->hypotheses()[richer];
  const Hypothesis& b = from_.hypotheses->hypotheses()[plainer];
  return a.place == b.place && std::ranges::count(a.special_cases, b.law) > 0;
}

void PredictionEffects::add_rivals_elsewhere(std::size_t found, const JudgedModel& without,
                                             FoundEffect& effect) const {
  for (const std::size_t other : from_.final->elsewhere(found))
    add_if_stands(other, without, effect);
  // What was accepted, and gave way to a law that more machines have.
  const std::size_t accepted = from_.final->accepted_as(found);
  const bool gave_way = accepted != found && !contains(accepted, found) && !is_found(accepted);
  if (gave_way) add_if_stands(accepted, without, effect);
}

void PredictionEffects::add_if_stands(std::size_t other, const JudgedModel& without,
                                      FoundEffect& effect) const {
  if (is_named(other, effect)) return;
  const JudgedModel exchanged = from_.final->with_law(without, other);
  if (!exchanged.fit.usable) return;
  if (is_on_no_machine(exchanged.fit, exchanged.fit.model.laws.back(), *from_.data)) return;
  const double z = from_.final->z_over(exchanged);
  if (z >= kExcluded) return;
  Rival rival;
  rival.law = fitted_law(exchanged.fit.model, exchanged.fit.model.laws.back(), nullptr);
  rival.bic_difference = z * std::abs(z);
  effect.rivals.push_back(std::move(rival));
}

// The last law of a fit in place of the one found, as a rival or excluded.
void PredictionEffects::add_exchanged(const JudgedModel& exchanged, FoundEffect& effect) const {
  if (!exchanged.fit.usable) return;
  const PlacedFinding& placed = exchanged.fit.model.laws.back();
  if (is_named(placed.hypothesis, effect)) return;
  if (is_on_no_machine(exchanged.fit, placed, *from_.data)) return;
  const double z = from_.final->z_over(exchanged);
  Rival rival;
  rival.law = fitted_law(exchanged.fit.model, placed, nullptr);
  rival.bic_difference = z * std::abs(z);
  (z < kExcluded ? effect.rivals : effect.excluded).push_back(std::move(rival));
}

// A weight in place of a spring, which everybody asks for.
void PredictionEffects::add_weight(std::size_t law, FoundEffect& effect) const {
  add_exchanged(from_.final->weight_in_place_of(law), effect);
}

// At steady speeds a drive that gives less and less is a drag that grows with the square of speed.
void PredictionEffects::add_bent_drive_or_drag(const JudgedModel& without,
                                               FoundEffect& effect) const {
  const std::vector<Hypothesis>& all = from_.hypotheses->hypotheses();
  const std::string& found = all[effect.law.hypothesis].law;
  if (found != "quadratic_drag" && found != "curved_gain") return;
  const std::string other = found == "quadratic_drag" ? "curved_gain" : "quadratic_drag";
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].law != other || is_found(h) || is_named(h, effect)) continue;
    add_exchanged(from_.final->with_law(without, h), effect);
  }
}

// A plain friction takes most of what a richer one would, and leaves a rest that may pass for a
// disturbance. Where the richer one predicts better, kept-out recordings included, it is named:
// as a rival, or where that may be chance beside the law found.
void PredictionEffects::add_richer_friction(std::size_t law, FoundEffect& effect) const {
  constexpr double kWorthNaming = 1.0;  // z
  const std::vector<Hypothesis>& all = from_.hypotheses->hypotheses();
  const std::size_t found = from_.final->found().fit.model.laws[law].hypothesis;
  if (all[found].law != "coulomb" && all[found].law != "viscous") return;
  for (std::size_t richer = 0; richer < all.size(); ++richer) {
    const auto is_this = [&](const Rival& rival) { return rival.law.hypothesis == richer; };
    if (!contains(richer, found) || is_found(richer)) continue;
    if (std::ranges::any_of(effect.rivals, is_this)) continue;
    const JudgedModel fitted = from_.final->in_place_of(law, richer);
    if (!fitted.fit.usable) continue;
    if (is_on_no_machine(fitted.fit, fitted.fit.model.laws.back(), *from_.data)) continue;
    const double z = z_between(from_.final->found().fit, fitted.fit);
    if (!(z > kWorthNaming) || raises_held_out(fitted)) continue;
    Rival rival;
    rival.law = fitted_law(fitted.fit.model, fitted.fit.model.laws.back(), nullptr);
    rival.bic_difference = -z * z;
    std::erase_if(effect.excluded, is_this);
    (z > kExcluded ? effect.rivals : effect.generalisations).push_back(std::move(rival));
  }
}

bool PredictionEffects::raises_held_out(const JudgedModel& other) const {
  const auto with = from_.final->law_held_out(other),
             without = from_.final->law_held_out(from_.final->found());
  if (!with || !without) return false;
  const VectorXd& scale = from_.final->found().held_out_scale;
  return percent(with->error, scale) > percent(without->error, scale);
}

// With one drive and one sensor a delay at either is one system, whatever lies between them and
// whatever a filter that starts somewhere else may say.
void PredictionEffects::unite_delays(FoundEffect& effect) const {
  const std::vector<Hypothesis>& all = from_.hypotheses->hypotheses();
  const Hypothesis& found = all[effect.law.hypothesis];
  if (found.law != "delay" || from_.stated->inputs.size() != 1 || from_.stated->outputs.size() != 1)
    return;
  const auto is_twin = [&](std::size_t other) {
    return all[other].law == "delay" && all[other].place != found.place;
  };
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (!is_twin(h) || is_found(h)) continue;
    effect.same_at.push_back(effect.law);
    effect.same_at.back().hypothesis = h;
  }
  const auto names_twin = [&](const Rival& rival) { return is_twin(rival.law.hypothesis); };
  std::erase_if(effect.rivals, names_twin);
  std::erase_if(effect.excluded, names_twin);
}

// On the way one way without a rest dry friction and a constant force are one, whatever a fit that
// starts from the other may say; and so is a dead zone of the drive, which never changes its sign.
void PredictionEffects::unite_forces_one_way(std::size_t law, FoundEffect& effect) const {
  constexpr double kRests = 0.02;     // of the fastest motion
  constexpr double kFewRests = 0.01;  // of all samples
  const std::vector<Hypothesis>& all = from_.hypotheses->hypotheses();
  const Hypothesis& found = all[effect.law.hypothesis];
  if (found.law != "coulomb" || from_.hypotheses->held_at_standstill() > 0.0) return;
  const ExtendedLumpedModel& model = from_.final->found().fit.model;
  const Eigen::MatrixXd motion = from_.final->motion();
  const VectorXd rate =
      motion.rightCols(motion.cols() / 2) * model.model.parts[model.laws[law].part].location.input;
  const double fastest = rate.cwiseAbs().maxCoeff();
  const auto rests = static_cast<double>((rate.array().abs() < kRests * fastest).count());
  if (lesser_way(rate) > kOneWay || rests > kFewRests * static_cast<double>(rate.size())) return;
  const auto is_offset = [&](const Rival& rival) {
    return all[rival.law.hypothesis].law == "offset" &&
           all[rival.law.hypothesis].place == found.place;
  };
  const auto is_dead_zone = [&](const Rival& rival) {
    const Location& place = from_.hypotheses->location(rival.law.hypothesis);
    return all[rival.law.hypothesis].law == "dead_zone" && place.kind == LocationKind::kActuator;
  };
  std::erase_if(effect.excluded, is_dead_zone);
  const auto excluded = std::ranges::find_if(effect.excluded, is_offset);
  if (excluded == effect.excluded.end()) return;
  excluded->bic_difference = 0.0;
  effect.rivals.push_back(std::move(*excluded));
  effect.excluded.erase(excluded);
}

bool PredictionEffects::is_found(std::size_t hypothesis) const {
  return std::ranges::count(from_.final->found().fit.model.laws, hypothesis,
                            &PlacedFinding::hypothesis) > 0;
}

}  // namespace graybox
