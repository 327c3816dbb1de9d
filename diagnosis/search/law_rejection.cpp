#include "diagnosis/search/law_rejection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/plausibility/plausibility.hpp"
#include "diagnosis/search/candidate_ranking.hpp"
#include "diagnosis/search/law_pruning.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

constexpr double kSignal = 100.0;         // %
constexpr double kMostIsTaken = 0.5;      // of the error without laws
constexpr double kHardlyChanges = 250.0;  // %; what is nearly constant tells no law
constexpr double kOfLevel = 75.0;         // % of its rms: more is no model of a constant force
constexpr double kLeastGain = 0.03;       // of the squared error, where the noise is not known
// So much of it says that a force of such a shape is there, whatever its parameters are.
constexpr double kDecisiveGain = 0.3;

// Beyond chance: of -2 log of the density of recordings kept out, a ratio of one to twenty
// thousand.
bool is_beyond_chance(const SearchState& state, const ExtendedFit& without,
                      const ExtendedFit& with) {
  if (!state.problem->noise_is_known()) return true;
  const auto of_without = state.problem->predict_held_out(without);
  const auto of_with = state.problem->predict_held_out(with);
  if (!of_without || !of_with || !of_without->cost || !of_with->cost) return false;
  return *of_with->cost - *of_without->cost > 2.0 * state.options.exclusion_margin;
}

bool has_size(const FittedLaw& law) { return std::ranges::any_of(law.parameters, sets_size); }

// Share of a channel's error by which a law that acts elsewhere must change it to be asked there.
constexpr double kChanged = 0.1;

bool is_changed(const ChannelRest& before, const ChannelRest& after) {
  if (!before.held_out_nrmse || !after.held_out_nrmse) return false;
  return std::abs(*after.held_out_nrmse - *before.held_out_nrmse) >
         kChanged * *before.held_out_nrmse;
}

// In the channels on which the law acts, and those that it changes: a payload gives way to what
// is missing at one joint, and all others suffer. None where channels are not told apart.
std::optional<HeldOutEffect> effect_where_it_acts(const SearchState& state, std::size_t hypothesis,
                                                  const ExtendedFit& without,
                                                  const ExtendedFit& with) {
  std::vector<std::size_t> channels = state.hypothesis(hypothesis).acts_on;
  if (channels.empty()) return {};
  const std::vector<ChannelRest> before = state.problem->channel_rests(without),
                                 after = state.problem->channel_rests(with);
  for (std::size_t channel = 0; channel < before.size(); ++channel) {
    const bool is_there = std::ranges::count(channels, channel) > 0;
    if (!is_there && is_changed(before[channel], after[channel])) channels.push_back(channel);
  }
  double with_law = 0.0, without_law = 0.0;
  HeldOutEffect effect;
  for (const std::size_t channel : channels) {
    if (!before.at(channel).held_out_nrmse || !after.at(channel).held_out_nrmse) return {};
    without_law += std::pow(*before[channel].held_out_nrmse, 2);
    with_law += std::pow(*after[channel].held_out_nrmse, 2);
    effect.channels += (effect.channels.empty() ? "" : " and ") + before[channel].channel;
  }
  const auto count = static_cast<double>(channels.size());
  effect.error_without = std::sqrt(without_law / count);
  effect.error_with = std::sqrt(with_law / count);
  if (without_law > 0.0) effect.gain = 1.0 - with_law / without_law;
  effect.misleads = with_law > without_law;
  return effect;
}

// What no machine has, by three standard errors: friction that drives, or a level of which the
// recorded motion shows but the foot, which makes another curve of the law; or sizes out of order.
// Empty: nothing.
std::string impossible_words(const SearchState& state, std::size_t law) {
  const FittedLaw& fitted = state.result.after.laws[law];
  const LawEntry* const entry = find_law(state.hypothesis(fitted.hypothesis).law, false);
  if (entry != nullptr && entry->parameters.size() == fitted.parameters.size() &&
      !keeps_order(*entry, fitted.values())) {
    return "no machine has such sizes together (a spring that yields at once, or gives energy)";
  }
  const FittedPhysics physics = fit_physics(*state.problem, state.result.after);
  const PlausibilityLimits limits;
  for (const PhysicalQuantity& quantity : physics.quantities) {
    if (quantity.law != law) continue;
    const double margin =
        quantity.standard_error > 0.0 ? limits.sign_errors * quantity.standard_error : 0.0;
    const bool is_friction = quantity.kind == QuantityKind::kFriction,
               is_damping = quantity.kind == QuantityKind::kDamping,
               is_force = quantity.kind == QuantityKind::kForce;
    if ((is_friction || is_damping) && quantity.value + quantity.stated < -margin) {
      return "friction would be negative, which a late channel or a wrong sign looks like";
    }
    const bool is_inertia =
        quantity.kind == QuantityKind::kInertia || quantity.kind == QuantityKind::kMass;
    if (is_inertia && quantity.value + quantity.stated < -margin) {
      return "with it the inertia would be negative";
    }
    const double largest = limits.size * physics.laws[law].carried;
    if ((is_friction || is_force) && std::abs(quantity.value) - margin > largest) {
      return "its force would be far beyond what was ever measured there";
    }
  }
  return "";
}

// Beside a larger wave of the same kind a further one is not rare.
bool is_largest_of_its_kind(const FittedLaw& law, const ExtendedFit& fit) {
  return std::ranges::none_of(fit.laws, [&law](const FittedLaw& other) {
    return other.hypothesis == law.hypothesis &&
           std::abs(other.parameters.front().value) > std::abs(law.parameters.front().value);
  });
}

// Whether a law of other sizes, too, has springs that none of its parameters tells: each is smaller
// than its error. What it does then a law without a spring does as well.
bool has_untold_springs(const FittedLaw& law) {
  std::size_t springs = 0;
  for (const LawParameterEstimate& estimate : law.parameters) {
    if (estimate.unit != "N/m" && estimate.unit != "N m/rad") continue;
    if (!(std::abs(estimate.value) <= estimate.standard_error)) return false;
    ++springs;
  }
  return springs > 0 && springs < law.parameters.size();
}

// Of a law of the last fit; none: it stays.
std::optional<RejectedLaw> rejection_of(SearchState& state, std::size_t law,
                                        const ExtendedFit& without) {
  const FittedLaw& fitted = state.result.after.laws[law];
  RejectedLaw rejected{
      fitted, {}, held_out_effect(state, fitted.hypothesis, without, state.result.after)};
  if (rejected.held_out && rejected.held_out->misleads) {
    rejected.reason = "it raises the error of recordings kept out";
    return rejected;
  }
  if (!state.problem->noise_is_known()) {
    rejected.reason = impossible_words(state, law);
    if (!rejected.reason.empty()) return rejected;
  }
  if (!state.problem->noise_is_known() && rejected.held_out &&
      rejected.held_out->gain < kLeastGain) {
    rejected.reason =
        fmt::format("it takes less than {:.0f} % from the squared error of recordings kept out",
                    100.0 * kLeastGain);
    return rejected;
  }
  const bool is_rare = state.hypothesis(fitted.hypothesis).rank >= kRareRank &&
                       is_largest_of_its_kind(fitted, state.result.after);
  if (is_rare && rejected.held_out && rejected.held_out->gain < state.options.rare_gain) {
    rejected.reason = fmt::format(
        "few machines have it, and it takes less than {:.0f} % from the squared error of "
        "recordings kept out",
        100.0 * state.options.rare_gain);
    return rejected;
  }
  const bool is_decisive = rejected.held_out && rejected.held_out->gain >= kDecisiveGain;
  if (!state.problem->noise_is_known() && !is_decisive && has_size(fitted) &&
      !excludes_its_absence(fitted)) {
    rejected.reason = "its size is not determined";
    return rejected;
  }
  if (!state.problem->noise_is_known() && !is_decisive && has_untold_springs(fitted)) {
    rejected.reason = "its stiffness is not determined, so a plainer law would do";
    return rejected;
  }
  return {};
}

double gain_of(const RejectedLaw& law) { return law.held_out ? law.held_out->gain : 0.0; }

// A law that adds next to nothing has kept no other from being found.
bool was_in_the_way(const RejectedLaw& law) {
  return !law.held_out || law.held_out->misleads || law.held_out->gain >= kLeastGain;
}

// With a special case of the law in its place, the best by its score test, whether or not it was
// rejected beside the law; not usable where there is none.
ExtendedFit fit_with_special_case(SearchState& state, std::size_t law, const ExtendedFit& without) {
  const Hypothesis& richer = state.hypothesis(state.result.after.laws[law].hypothesis);
  std::vector<std::size_t> asked;
  for (std::size_t plain = 0; plain < state.problem->hypotheses().size(); ++plain) {
    const Hypothesis& candidate = state.hypothesis(plain);
    const bool is_there = std::ranges::count(without.laws, plain, &FittedLaw::hypothesis) > 0;
    if (!is_there && is_special_case(candidate, richer) && !is_excluded(state, candidate)) {
      asked.push_back(plain);
    }
  }
  ExtendedFit best;
  best.usable = false;
  if (asked.empty()) return best;
  ScoreTable table = state.problem->scores(without, asked, 0, state.options.seed);
  std::erase_if(table.scores,
                [](const HypothesisScore& score) { return score.start.parameters.empty(); });
  if (table.scores.empty()) return best;
  const auto plainest = std::ranges::max_element(
      table.scores, {}, [](const HypothesisScore& score) { return score.score.statistic; });
  std::vector<LawStart> laws = starts_of(without);
  laws.push_back(plainest->start);
  return state.refits.refit(laws, without);
}

struct LeftOut {
  RejectedLaw rejected;
  ExtendedFit left;  // the fit without it
};

// A law that gains next to nothing over a special case of itself.
std::optional<LeftOut> special_case_that_does(SearchState& state, std::size_t law,
                                              const ExtendedFit& without) {
  if (state.problem->noise_is_known()) return {};
  const FittedLaw& richer = state.result.after.laws[law];
  ExtendedFit plainer = fit_with_special_case(state, law, without);
  if (!plainer.usable || plainer.laws.size() != without.laws.size() + 1 ||
      plainer.parameter_count > state.result.after.parameter_count) {
    return {};
  }
  const auto effect = held_out_effect(state, richer.hypothesis, plainer, state.result.after);
  if (!effect || effect->gain >= kLeastGain) return {};
  const std::string& name = state.hypothesis(plainer.laws.back().hypothesis).law;
  RejectedLaw rejected{
      richer,
      effect->gain > 0.0
          ? fmt::format("with {} in its place the squared error of recordings kept out is less "
                        "than {:.0f} % larger",
                        name, 100.0 * kLeastGain)
          : fmt::format("with {} in its place recordings kept out are predicted as well or better",
                        name),
      effect};
  return LeftOut{std::move(rejected), std::move(plainer)};
}

bool reject_worst(SearchState& state) {
  std::optional<LeftOut> worst;
  for (std::size_t law = 0; law < state.result.after.laws.size(); ++law) {
    const std::size_t hypothesis = state.result.after.laws[law].hypothesis;
    if (!state.proceed("asking recordings kept out about " + state.name_of(hypothesis))) break;
    const ExtendedFit without = fit_without(state, state.result.after, law);
    if (!without.usable) continue;
    std::optional<LeftOut> left_out;
    if (std::optional<RejectedLaw> rejected = rejection_of(state, law, without)) {
      left_out = LeftOut{*std::move(rejected), without};
    } else {
      left_out = special_case_that_does(state, law, without);
    }
    if (!left_out || (worst && gain_of(worst->rejected) <= gain_of(left_out->rejected))) continue;
    worst = std::move(left_out);
  }
  if (!worst) return false;
  state.result.after = std::move(worst->left);
  // What was rejected beside a richer law may stand in its place.
  std::erase_if(state.result.rejected, [&](const RejectedLaw& rejected) {
    return !state.hypothesis(rejected.law.hypothesis).repeatable &&
           std::ranges::count(state.result.after.laws, rejected.law.hypothesis,
                              &FittedLaw::hypothesis) > 0;
  });
  state.result.rejected.push_back(std::move(worst->rejected));
  return true;
}

// The error kept out of the channel that is predicted best among those on which the law acts; of
// all together where channels are not told apart.
struct LeftWhereItActs {
  double of_signal = std::numeric_limits<double>::infinity();  // % of what changes
  double of_level = std::numeric_limits<double>::infinity();   // % of the rms about zero
};

LeftWhereItActs left_where_it_acts(const std::vector<ChannelRest>& channels,
                                   const Hypothesis& hypothesis, double pooled) {
  if (channels.empty()) return {pooled, pooled};
  LeftWhereItActs least;
  for (std::size_t channel = 0; channel < channels.size(); ++channel) {
    const bool acts_there =
        hypothesis.acts_on.empty() || std::ranges::count(hypothesis.acts_on, channel) > 0;
    if (!acts_there) continue;
    const ChannelRest& rest = channels[channel];
    const double error = rest.held_out_nrmse.value_or(rest.nrmse);
    if (error < least.of_signal) least = {error, error / rest.held_out_level};
  }
  return least;
}

// As large an error as with no model at all: nothing is found there then. The signal is what
// changes; a stroke in one direction hardly does, and the error may well be as large as that. So
// laws that take most of the error stay.
bool reject_hopeless(SearchState& state) {
  const ExtendedFit& after = state.result.after;
  if (after.laws.empty()) return false;
  const std::optional<Assessment> held_out = state.problem->validate(after);
  const double pooled = held_out.value_or(after.estimation).nrmse;
  const std::vector<ChannelRest> channels = state.problem->channel_rests(after);
  const ExtendedFit bare = state.without_laws();
  const std::vector<ChannelRest> bare_channels = state.problem->channel_rests(bare);
  const double bare_pooled = state.problem->validate(bare).value_or(bare.estimation).nrmse;
  std::vector<LawStart> kept = starts_of(after);
  std::vector<RejectedLaw> rejected;
  for (std::size_t law = after.laws.size(); law-- > 0;) {
    const Hypothesis& hypothesis = state.hypothesis(after.laws[law].hypothesis);
    const auto [error, of_level] = left_where_it_acts(channels, hypothesis, pooled);
    const double bare_error = left_where_it_acts(bare_channels, hypothesis, bare_pooled).of_signal;
    const bool takes_most =
        error < kMostIsTaken * bare_error && error <= kHardlyChanges && of_level <= kOfLevel;
    if (error <= kSignal || takes_most) continue;
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(law));
    rejected.push_back(
        {after.laws[law],
         fmt::format("with all laws the error where it acts still is {:.3g} % of the signal",
                     error),
         {}});
  }
  if (rejected.empty()) return false;
  ExtendedFit left = kept.empty() ? state.without_laws() : state.refits.refit(kept, after);
  state.result.after = left.usable ? std::move(left) : state.without_laws();
  state.result.rejected.insert(state.result.rejected.end(), rejected.rbegin(), rejected.rend());
  return true;
}

}  // namespace

std::optional<HeldOutEffect> held_out_effect(const SearchState& state, std::size_t hypothesis,
                                             const ExtendedFit& without, const ExtendedFit& with) {
  if (!state.problem->noise_is_known()) {
    auto effect = effect_where_it_acts(state, hypothesis, without, with);
    if (effect) return effect;
  }
  const std::optional<Assessment> before = state.problem->validate(without);
  const std::optional<Assessment> after = state.problem->validate(with);
  if (!before || !after) return {};
  HeldOutEffect effect{before->nrmse, after->nrmse};
  if (before->chi_square > 0.0) effect.gain = 1.0 - after->chi_square / before->chi_square;
  effect.misleads =
      after->chi_square > before->chi_square && is_beyond_chance(state, without, with);
  return effect;
}

Rejection reject_laws(SearchState& state) {
  Rejection outcome = Rejection::kNone;
  while (reject_worst(state)) {
    if (outcome == Rejection::kNone) outcome = Rejection::kLittle;
    if (was_in_the_way(state.result.rejected.back())) outcome = Rejection::kSome;
  }
  if (!reject_hopeless(state)) return outcome;
  return state.problem->noise_is_known() ? Rejection::kAll : Rejection::kSome;
}

void note_held_out_effects(SearchState& state) {
  const ExtendedFit& after = state.result.after;
  for (std::size_t law = 0; law < state.result.effects.size() && law < after.laws.size(); ++law) {
    if (!state.proceed("asking recordings kept out about what was found")) return;
    const ExtendedFit without = fit_without(state, after, law);
    if (!without.usable) continue;
    state.result.effects[law].held_out =
        held_out_effect(state, after.laws[law].hypothesis, without, after);
  }
}

}  // namespace graybox
