#include "diagnosis/verdict/verdict_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/evidence/trend_reason.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/plausibility/plausibility_words.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "diagnosis/verdict/error_places.hpp"
#include "diagnosis/verdict/friction_words.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "diagnosis/verdict/reason_words.hpp"
#include "diagnosis/verdict/verdict_file.hpp"

namespace graybox {
namespace {

// Times its value: a standard error that is larger says nothing more.
constexpr double kSaysNothing = 100.0;
constexpr double kBeyondPlain = 1e5;  // of an error that is written with a power of ten

std::string spaced(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

// How much of the squared error the laws found take, and that not all tests passed.
std::string part_words(const Diagnosis& diagnosis) {
  const bool is_kept_out = diagnosis.validation_before && diagnosis.validation_after;
  const double before =
      is_kept_out ? diagnosis.validation_before->nrmse : diagnosis.before.estimation.nrmse;
  const double after =
      is_kept_out ? diagnosis.validation_after->nrmse : diagnosis.after.estimation.nrmse;
  const double share = before > 0.0 ? 1.0 - after * after / (before * before) : 0.0;
  if (!(share > 0.0)) return "Physics is missing; what was found explains only part of it.";
  return fmt::format(
      "Physics is missing. What was found takes {:.{}f} % of the squared error{}; not all tests of "
      "what is left passed.",
      std::min(100.0 * share, 99.99),
      share > 0.99  ? 2
      : share > 0.9 ? 1
                    : 0,
      is_kept_out ? " of recordings kept out" : "");
}

bool fails(const Diagnosis& diagnosis, const char* test) {
  return std::ranges::any_of(diagnosis.reasons, [&](const VerdictReason& reason) {
    return has_failed(reason) && reason.test.starts_with(test);
  });
}

// The headline where laws are told and none is confirmed.
std::string unconfirmed_words(const Diagnosis& diagnosis) {
  constexpr double kWell = 15.0;  // % of the signal
  const bool is_well = diagnosis.validation_before && diagnosis.validation_before->nrmse <= kWell;
  return is_well
             ? "The model as given foretells recordings kept out about as well as with any law: "
               "nothing is shown to be missing."
             : "Physics is missing, and no law that was tried is confirmed.";
}

// The mass or inertia without which no force is known, where nothing was found; empty: none.
std::string loose_mass(const Diagnosis& diagnosis) {
  if (!diagnosis.effects.empty() || !diagnosis.late_channels.empty()) return "";
  const auto flaw = std::ranges::find_if(diagnosis.implausible, [](const Implausibility& each) {
    return each.rule == PlausibilityRule::kZero &&
           (each.quantity.ends_with("inertia") || each.quantity.ends_with("mass"));
  });
  return flaw == diagnosis.implausible.end() ? "" : flaw->quantity;
}

// Whether what is left of recordings kept out is little, though perhaps more than noise.
bool foretells_nearly_all(const Diagnosis& diagnosis) {
  constexpr double kLittle = 5.0;  // % of the signal
  if (diagnosis.validation_after) return diagnosis.validation_after->nrmse <= kLittle;
  return diagnosis.after.usable && diagnosis.after.seconds_ahead == 0.0 &&
         diagnosis.after.estimation.nrmse <= kLittle;
}

// The headline where no law was found for what is missing.
std::string no_law_words(const Diagnosis& diagnosis) {
  if (foretells_nearly_all(diagnosis) && diagnosis.validation_after) {
    return fmt::format(
        "The model as it is foretells recordings kept out to {:.2g} % of the signal. That is more "
        "than noise, and no law of the catalogue takes it.",
        diagnosis.validation_after->nrmse);
  }
  if (foretells_nearly_all(diagnosis)) {
    return fmt::format(
        "The model as it is leaves {:.2g} % of the signal, and no law of the catalogue takes that. "
        "No recordings were kept out to test it.",
        diagnosis.after.estimation.nrmse);
  }
  return diagnosis.may_be_disturbed
             ? "Something acts that the model does not have, and no law of the catalogue "
               "explains it: a disturbance, or missing physics."
             : "Physics is missing, and no law of the catalogue explains it.";
}

// The headline where no test saw that something is missing, and not all of them passed.
std::string undetected_words(const Diagnosis& diagnosis) {
  constexpr double kMuch = 15.0, kAll = 100.0;  // % of the signal
  const bool is_kept_out = diagnosis.validation_after.has_value();
  const double error =
      is_kept_out ? diagnosis.validation_after->nrmse : diagnosis.after.estimation.nrmse;
  if (!diagnosis.noise_is_known && error > kAll) {
    return fmt::format(
        "The model foretells nothing{}: its error is {:.2g} times the signal. Look at what drives "
        "the machine: its unit and sign, and whether it changes faster than it was recorded.",
        is_kept_out ? " of the recordings kept out" : "", error / kAll);
  }
  if (!diagnosis.noise_is_known && error > kMuch) {
    return fmt::format(
        "The model misses {:.2g} % of the signal{}, and these recordings do not tell whether that "
        "is noise, a disturbance or missing physics.",
        error, is_kept_out ? " in recordings kept out" : "");
  }
  if (fails(diagnosis, kKeptOutTest))
    return "Nothing was seen to be missing, but no recordings were kept out to test that.";
  return "Nothing was seen to be missing, but not every test of that was passed.";
}

bool has_told_trend(const Diagnosis& diagnosis) {
  return !told_trends(diagnosis.trends, diagnosis.effects).empty();
}

// The headline where what was found fits and yet is not all: what the tests that failed say.
std::string ambiguity_words(const Diagnosis& diagnosis) {
  if (!diagnosis.predicts) {
    return "Physics is missing; what was found fits, but recordings kept out of the fit are not "
           "predicted to the noise.";
  }
  const bool has_rivals = std::ranges::any_of(diagnosis.effects, [](const FoundEffect& effect) {
    return !effect.rivals.empty() || !effect.same_at.empty();
  });
  if (!has_rivals && fails(diagnosis, kLateTest)) {
    return "Physics is missing; a channel that comes late or early may be part of it, or what was "
           "found stands in for that.";
  }
  if (!has_rivals && fails(diagnosis, kKeptOutTest)) {
    return "Physics is missing, and what was found explains it; no recordings were kept out to "
           "test "
           "that.";
  }
  if (has_rivals) return "Physics is missing; the recordings can't tell all explanations apart.";
  if (fails(diagnosis, kSizesTest)) {
    return "Physics is missing, and what was found explains it; its sizes are not the same in the "
           "recordings kept out.";
  }
  if (has_told_trend(diagnosis)) {
    return "Physics is missing; what was found explains it on the average, and changes with what "
           "the machine does.";
  }
  return "Physics is missing, and what was found explains it; the recordings do not determine "
         "every parameter.";
}

}  // namespace

std::string ahead_words(const ExtendedFit& fit) {
  return fit.seconds_ahead > 0.0 ? fmt::format(", {:.2g} s ahead", fit.seconds_ahead) : "";
}

std::string headline(const Diagnosis& diagnosis) {
  const bool is_without_findings = diagnosis.effects.empty() && diagnosis.late_channels.empty();
  switch (diagnosis.verdict) {
    case Verdict::kNone:
      return "Nothing is missing that these recordings could show.";
    case Verdict::kExplained:
      return diagnosis.effects.empty() && !diagnosis.late_channels.empty()
                 ? "A channel is recorded late or early; with it in time nothing more is missing."
                 : "Physics is missing, and it is explained.";
    case Verdict::kAmbiguous:
      return ambiguity_words(diagnosis);
    case Verdict::kUnknown:
      break;
  }
  if (diagnosis.interrupted && diagnosis.channel_faults.empty())
    return "Stopped before a verdict; this is what was found until then.";
  if (!diagnosis.trouble.empty()) return "No verdict: " + diagnosis.trouble + ".";
  if (excluding(diagnosis.implausible) > 0) {
    return "The fitted model is not one that a machine can have; what it says of missing physics "
           "does not hold.";
  }
  if (diagnosis.time_variation && diagnosis.verified) {
    return "Something changes while it is recorded, and no law of the catalogue does that.";
  }
  if (diagnosis.time_variation) {
    return "Something changes while it is recorded, and more is missing than what was found.";
  }
  if (!diagnosis.detection.detected && (is_without_findings || fails(diagnosis, kKeptOutTest)))
    return undetected_words(diagnosis);
  if (has_no_confirmed_law(diagnosis)) return unconfirmed_words(diagnosis);
  if (const std::string loose = loose_mass(diagnosis); !loose.empty()) {
    return fmt::format("The recordings do not determine {}, so they can't tell what is missing.",
                       loose);
  }
  if (is_without_findings && diagnosis.verified) {
    return "The model as it is predicts about as well as it fits; it leaves a little that no law "
           "of "
           "the catalogue explains.";
  }
  if (is_without_findings) return no_law_words(diagnosis);
  if (!diagnosis.departures.empty()) {
    return "Physics is missing; what was found comes close to it, but is not quite what is there.";
  }
  if (!diagnosis.shared_characteristics.empty()) {
    return "Physics is missing; several laws at one place describe it together, and may stand for "
           "one that was not tried.";
  }
  return part_words(diagnosis);
}

namespace {

std::string parameters_words(const FittedLaw& law) {
  std::string words;
  for (const LawParameterEstimate& parameter : law.parameters) {
    words += fmt::format(
        "{}{} {}", words.empty() ? "" : ", ", spaced(parameter.name),
        is_unseen_static_level(law, parameter) ? "not determined" : estimate_words(parameter));
  }
  return words;
}

// Evidence against an explanation: of BIC, or of prediction where the noise is not known.
std::string evidence_words(double difference, bool noise_is_known) {
  if (noise_is_known) return fmt::format("BIC {:+.3g}", difference);
  const char* const way = difference < 0.0 ? "better" : "worse";
  const double errors = std::sqrt(std::abs(difference));
  constexpr double kCounted =
      1000.0;  // beyond, blocks could not be predicted at all or all gain alike
  constexpr double kShown = 0.05;
  if (errors < kShown) return "prediction as good";
  if (!(errors < kCounted)) return fmt::format("prediction far {}", way);
  return fmt::format("prediction {} by {:.2g} standard errors", way, errors);
}

std::string evidence_words(const Rival& rival, bool noise_is_known) {
  std::string words = evidence_words(rival.bic_difference, noise_is_known);
  if (std::abs(rival.held_out_difference.value_or(0.0)) >= 0.5) {
    words += fmt::format(", {:+.2g} by recordings kept out", *rival.held_out_difference);
  }
  return words;
}

// "coulomb at motor with viscous at motor"
std::string sum_words(const Rival& rival, std::span<const Hypothesis> hypotheses) {
  std::string words = hypothesis_words(hypotheses[rival.law.hypothesis]);
  for (const FittedLaw& law : rival.with) {
    words += " with " + hypothesis_words(hypotheses[law.hypothesis]);
  }
  return words;
}

// Where the noise is not known: it foretells more than what was found, beyond chance.
bool is_better(const Rival& rival) {
  constexpr double kErrors = 2.0;
  return rival.bic_difference < -kErrors * kErrors;
}

std::string better_rivals_words(const FoundEffect& effect, std::span<const Hypothesis> hypotheses) {
  std::string names, advice;
  for (const Rival& rival : effect.rivals) {
    if (!is_better(rival)) continue;
    names += fmt::format("{}{} ({})", names.empty() ? "" : "; ", sum_words(rival, hypotheses),
                         evidence_words(rival, false));
    if (advice.empty()) {
      advice = advice_for(hypotheses[effect.law.hypothesis], hypotheses[rival.law.hypothesis]);
    }
  }
  if (names.empty()) return "";
  return fmt::format("More likely than {}: {}.{}{}",
                     hypothesis_words(hypotheses[effect.law.hypothesis]), names,
                     advice.empty() ? "" : " ", advice);
}

// Of a fit that no machine can have: what is in it, and nothing that is found.
std::string unsound_words(const FoundEffect& effect, std::span<const Hypothesis> hypotheses) {
  return fmt::format("In that fit: {}: {}.", hypothesis_words(hypotheses[effect.law.hypothesis]),
                     parameters_words(effect.law));
}

// Where a spring rests that was found beside a constant force at its place, k x + f = 0; empty: it
// was found alone.
std::string rest_words(const FoundEffect& spring, std::span<const Hypothesis> hypotheses,
                       const Diagnosis& diagnosis) {
  const Hypothesis& own = hypotheses[spring.law.hypothesis];
  if (own.law != "stiffness" || spring.law.parameters.empty()) return "";
  const LawParameterEstimate& stiffness = spring.law.parameters.front();
  for (const FoundEffect& other : diagnosis.effects) {
    const Hypothesis& hypothesis = hypotheses[other.law.hypothesis];
    if (hypothesis.law != "offset" || hypothesis.place != own.place) continue;
    if (other.law.parameters.empty() || !(stiffness.value > 0.0)) continue;
    return fmt::format(" With the constant force found there it rests at {:.3g} {}.",
                       -other.law.parameters.front().value / stiffness.value,
                       stiffness.unit.ends_with("/rad") ? "rad" : "m");
  }
  return "";
}

std::string effect_words(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                         const Diagnosis& diagnosis) {
  const bool noise_is_known = diagnosis.noise_is_known;
  const Hypothesis& hypothesis = hypotheses[effect.law.hypothesis];
  const std::string law =
      has_no_size(effect.law)
          ? fmt::format("Not confirmed: {}, of a size that these recordings do not tell: {}.",
                        hypothesis_words(hypothesis), parameters_words(effect.law))
          : fmt::format("{}: {} ({}): {}.",
                        is_doubtful(effect, diagnosis) ? "Not confirmed" : "Found",
                        effect_sentence(hypothesis, effect), hypothesis_words(hypothesis),
                        parameters_words(effect.law));
  const std::string found =
      law + rest_words(effect, hypotheses, diagnosis) + held_out_words(effect, diagnosis);
  if (std::isnan(effect.bic_difference)) {
    return found + " Without it the model could not be fitted.";
  }
  if (!noise_is_known) {
    return fmt::format("{} Without it: {}.", found, evidence_words(effect.bic_difference, false));
  }
  return fmt::format(
      "{} It explains {:.1f} % of what was too much; without it BIC is {:.3g} higher.", found,
      100.0 * effect.explained_share, effect.bic_difference);
}

// Laws of a fit that was stopped before it was compared with others; empty: none.
std::string unfinished_words(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (!diagnosis.interrupted || !diagnosis.effects.empty()) return "";
  std::string names;
  for (const FittedLaw& law : diagnosis.after.laws) {
    names += fmt::format("{}{} ({})", names.empty() ? "" : "; ",
                         hypothesis_words(hypotheses[law.hypothesis]), parameters_words(law));
  }
  if (names.empty()) return "";
  return fmt::format("In the fit when it was stopped, and not yet compared with others: {}.",
                     names);
}

std::string departure_words(const Departure& departure, std::span<const Hypothesis> hypotheses) {
  const Hypothesis& hypothesis = hypotheses[departure.start.hypothesis];
  return fmt::format(
      "What was found is not quite the force at {}: {} would lower chi-square by {:.3g} more, "
      "{:.2g} % of what the laws explain (p {}). Either that is there besides, or a law that was "
      "not tried is there in place of both; --laws tries laws of your own.",
      hypothesis.place, spaced(hypothesis.law), departure.statistic, 100.0 * departure.share,
      departure.p_value > 0.0 ? fmt::format("= {:.1g}", departure.p_value) : "< 1e-300");
}

std::string shared_words(const SharedCharacteristic& shared,
                         std::span<const Hypothesis> hypotheses) {
  std::string names = spaced(hypotheses[shared.hypotheses.front()].law);
  for (std::size_t i = 1; i < shared.hypotheses.size(); ++i) {
    names += (i + 1 == shared.hypotheses.size() ? " and " : ", ") +
             spaced(hypotheses[shared.hypotheses[i]].law);
  }
  const bool is_spring = shared.characteristic == Characteristic::kSpring;
  return fmt::format(
      "At {} the {} is described by {} together: either each of them is there, or one law that was "
      "not tried.",
      shared.place, is_spring ? "curve of a spring" : "friction", names);
}

void add_same_places(const std::vector<FittedLaw>& laws, std::span<const Hypothesis> hypotheses,
                     std::vector<std::string>& lines) {
  for (const FittedLaw& law : laws) {
    lines.push_back(
        fmt::format("The same, or at {}: {}. To experiments with these channels both are one "
                    "system; another sensor would tell.",
                    hypotheses[law.hypothesis].place, parameters_words(law)));
  }
}

void add_generalisations(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                         bool noise_is_known, std::vector<std::string>& lines) {
  std::string names;
  for (const Rival& law : effect.generalisations) {
    const std::string reason = law.law.parameters.empty() ? "the same in such recordings"
                                                          : evidence_words(law, noise_is_known);
    names += fmt::format("{}{} ({})", names.empty() ? "" : "; ",
                         hypothesis_words(hypotheses[law.law.hypothesis]), reason);
  }
  if (names.empty()) return;
  lines.push_back((noise_is_known
                       ? "More general laws, which the recordings neither ask for nor exclude: "
                       : "Not excluded, but rarer or more general: ") +
                  names + ".");
}

std::string sum_parameters_words(const Rival& rival) {
  std::string words = parameters_words(rival.law);
  for (const FittedLaw& law : rival.with) words += "; " + parameters_words(law);
  return words;
}

// Where the noise is not known many stand; their sizes are in verdict.json.
std::string names_of_rivals(const std::vector<Rival>& rivals,
                            std::span<const Hypothesis> hypotheses) {
  std::string names;
  for (const Rival& rival : rivals) {
    if (is_better(rival)) continue;  // named first (better_rivals_words)
    names += fmt::format("{}{} ({})", names.empty() ? "" : "; ", sum_words(rival, hypotheses),
                         evidence_words(rival, false));
  }
  return names;
}

void add_standing_rivals(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                         bool noise_is_known, std::vector<std::string>& lines) {
  if (!noise_is_known && !effect.rivals.empty()) {
    const std::string names = names_of_rivals(effect.rivals, hypotheses);
    if (!names.empty()) lines.push_back(fmt::format("Not excluded in its place: {}.", names));
    for (const Rival& rival : effect.rivals) {
      if (!rival.next) continue;
      lines.push_back(next_experiment_words(
          *rival.next, "it from " + hypothesis_words(hypotheses[rival.law.hypothesis])));
    }
    return;
  }
  for (const Rival& rival : effect.rivals) {
    if (rival.law.parameters.empty()) {
      lines.push_back(fmt::format("Not excluded in its place: {}, the same in such recordings.",
                                  hypothesis_words(hypotheses[rival.law.hypothesis])));
      continue;
    }
    lines.push_back(fmt::format("Not excluded in its place: {}: {} ({}).",
                                sum_words(rival, hypotheses), sum_parameters_words(rival),
                                evidence_words(rival, noise_is_known)));
    add_same_places(rival.same_at, hypotheses, lines);
    if (rival.next) lines.push_back(next_experiment_words(*rival.next));
  }
}

void add_rivals(const FoundEffect& effect, std::span<const Hypothesis> hypotheses,
                bool noise_is_known, std::vector<std::string>& lines) {
  add_standing_rivals(effect, hypotheses, noise_is_known, lines);
  add_generalisations(effect, hypotheses, noise_is_known, lines);
  constexpr std::size_t kNamed = 3;
  std::string excluded;
  for (std::size_t i = 0; i < std::min(kNamed, effect.excluded.size()); ++i) {
    const Rival& rival = effect.excluded[i];
    const bool would_stand =
        rival.is_contradicted && rival.bic_difference <= SearchOptions{}.exclusion_margin;
    excluded += fmt::format("{}{} ({}{}{})", excluded.empty() ? "" : "; ",
                            sum_words(rival, hypotheses), evidence_words(rival, noise_is_known),
                            rival.on_few_recordings ? " on few recordings"
                            : rival.on_other_noise  ? " with its free motion"
                                                    : "",
                            would_stand ? ", contradicted by recordings kept out" : "");
  }
  if (!excluded.empty()) lines.push_back("Excluded in its place: " + excluded + ".");
}

void add_fit(const char* recordings, const std::optional<Assessment>& before,
             const std::optional<Assessment>& after, const Diagnosis& diagnosis,
             std::vector<std::string>& lines) {
  if (!before || !after) return;
  if (before->nrmse == 0.0 && after->nrmse == 0.0) return;  // nothing was fitted
  std::string line = fmt::format("Error on {}{}: {:.4g} % before, {:.4g} % after", recordings,
                                 ahead_words(diagnosis.after), before->nrmse, after->nrmse);
  if (diagnosis.noise_is_known) {
    line += fmt::format("; chi-square per degree of freedom {:.4g} before, {:.4g} after",
                        before->chi_square_per_dof(), after->chi_square_per_dof());
  }
  lines.push_back(line + ".");
}

// The same laws with other sizes in the recordings kept out.
std::vector<std::string> kept_out_change_lines(const Diagnosis& diagnosis,
                                               std::span<const Hypothesis> hypotheses) {
  constexpr std::size_t kTold = 3;
  if (!diagnosis.kept_out_change) return {};
  const KeptOutChange& change = *diagnosis.kept_out_change;
  std::string sizes;
  for (std::size_t i = 0; i < std::min(kTold, change.sizes.size()); ++i) {
    sizes +=
        (sizes.empty() ? "" : "; ") + changed_size_words(diagnosis, change.sizes[i], hypotheses);
  }
  return {fmt::format(
      "Kept out, other sizes: the same model, fitted to these recordings by themselves, leaves "
      "{:.3g} % there instead of {:.3g} %, with {}. Either what was found only resembles what is "
      "there (as a constant force does dry friction, in motion one way), or something changed "
      "between the two, as a load, a temperature or a setting. Errors here are of each part by "
      "itself; elsewhere they count that the parts differ.",
      change.error_fitted, change.error_predicted, sizes)};
}

// What differs in recordings kept out, and where in time the error sits.
std::vector<std::string> kept_out_lines(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses) {
  std::vector<std::string> lines = kept_out_change_lines(diagnosis, hypotheses);
  if (diagnosis.verdict == Verdict::kExplained) return lines;
  for (std::string& line : error_place_lines(diagnosis)) lines.push_back(std::move(line));
  return lines;
}

// What keeps one channel from being explained; empty: nothing.
std::string doubt_of(const ChannelRest& rest) {
  const SearchOptions limits;
  std::vector<std::string> doubts;
  if (rest.held_out_nrmse && *rest.held_out_nrmse > limits.channel_tolerance) {
    doubts.push_back(fmt::format("more than {:g} %", limits.channel_tolerance));
  }
  if (rest.held_out_nrmse && rest.growth() > limits.generalisation) {
    doubts.push_back(fmt::format("{:.2g} times the error of the fit's recordings", rest.growth()));
  }
  const double of_motion = std::sqrt(rest.structure) * rest.nrmse;
  if (rest.structure > limits.structure_tolerance && of_motion > limits.structure_error) {
    doubts.push_back(fmt::format("{:.2g} % of the signal still depend on the motion", of_motion));
  }
  if (rest.autocorrelated_error > limits.autocorrelation_tolerance) {
    doubts.push_back(
        fmt::format("{:.3g} % of the signal follow from its own past", rest.autocorrelated_error));
  }
  return fmt::format("{}", fmt::join(doubts, ", "));
}

// Of several channels, how well each is explained.
void add_each_channel(const std::vector<ChannelRest>& before, const std::vector<ChannelRest>& after,
                      std::vector<std::string>& lines) {
  if (before.size() != after.size()) return;
  for (std::size_t c = 0; c < after.size(); ++c) {
    const bool is_kept_out = before[c].held_out_nrmse && after[c].held_out_nrmse;
    const double error_before = is_kept_out ? *before[c].held_out_nrmse : before[c].nrmse;
    const double error_after = is_kept_out ? *after[c].held_out_nrmse : after[c].nrmse;
    if (!(error_before > 0.0)) continue;
    const std::string doubt = doubt_of(after[c]);
    lines.push_back(fmt::format("Channel: {}: error{} {:.3g} % before, {:.3g} % after: {}.",
                                after[c].channel, is_kept_out ? " kept out" : "", error_before,
                                error_after,
                                doubt.empty() ? "explained" : "not explained (" + doubt + ")"));
  }
}

// "torque of joint_2 (42 %, after 8.1 %)".
void add_channels(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  const std::vector<ChannelRest>&before = diagnosis.channels_before,
        &after = diagnosis.channels_after;
  std::string channels;
  for (std::size_t c = 0; c < before.size(); ++c) {
    if (!is_more_than_noise(before[c])) continue;
    channels += fmt::format("{}{} ({:.3g} %", channels.empty() ? "" : ", ", before[c].channel,
                            before[c].nrmse);
    if (c < after.size()) channels += fmt::format(", after {:.3g} %", after[c].nrmse);
    channels += ")";
  }
  if (channels.empty()) return;
  const bool is_known = diagnosis.noise_is_known;
  lines.push_back(fmt::format("Where the model {}: {}.",
                              is_known ? "leaves more than noise" : "misses the signal", channels));
}

// Channels that come late to the fitted model; damping that it lacks looks alike.
void add_late_channels(const std::vector<ChannelRest>& after, std::vector<std::string>& lines) {
  for (const ChannelRest& rest : after) {
    if (!rest.late_by || !rest.held_out_nrmse || !rest.held_out_nrmse_in_time) continue;
    if (!(*rest.held_out_nrmse_in_time < *rest.held_out_nrmse)) continue;
    const bool is_late = *rest.late_by > 0.0;
    const std::string mend =
        is_late ? fmt::format("the channel (preprocess: advance, time: {:.2g})", *rest.late_by)
                : fmt::format("late positions (preprocess: advance of these, time: {:.2g})",
                              -*rest.late_by);
    lines.push_back(fmt::format(
        "Perhaps late: {} comes {:.2g} s {} than the model says. Moved by that, its error on "
        "recordings kept out falls from {:.3g} % to {:.3g} %. It may be {}, a drive that follows "
        "its "
        "reference late, or damping that was not found.",
        rest.channel, std::abs(*rest.late_by), is_late ? "later" : "earlier", *rest.held_out_nrmse,
        *rest.held_out_nrmse_in_time, mend));
  }
}

// "torque of wrist_2 0.026 s (error kept out 8.61 %, now 7.1 %)"
std::string moved_words(const LateChannel& late) {
  return fmt::format("{} by {:.2g} s (error kept out {:.3g} %, now {:.3g} %)", late.moved.channel,
                     std::abs(late.moved.seconds), late.error_before, late.error_after);
}

void add_moved_channels(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  for (const bool is_late : {true, false}) {
    std::string channels;
    for (const LateChannel& late : diagnosis.late_channels) {
      if ((late.moved.seconds > 0.0) != is_late) continue;
      channels += (channels.empty() ? "" : "; ") + moved_words(late);
    }
    if (channels.empty()) continue;
    lines.push_back(fmt::format(
        "{} the motion that belongs to it: {}. {}, or stands behind a filter. It was moved in time "
        "before laws were sought (preprocess: advance).",
        is_late ? "Recorded later than" : "Recorded earlier than", channels,
        is_late ? "It is read late" : "The command acts late, or the position is read late"));
  }
}

// Friction as its curve, and what of the laws changes.
std::vector<std::string> lines_of_laws(const Diagnosis& diagnosis,
                                       std::span<const Hypothesis> hypotheses) {
  std::vector<std::string> lines = friction_lines(diagnosis, hypotheses);
  if (excluding(diagnosis.implausible) > 0) return lines;
  for (const LawTrend& trend : told_trends(diagnosis.trends, diagnosis.effects)) {
    const std::string share =
        std::isfinite(trend.of_signal)
            ? fmt::format("; it takes {:.2g} % of the signal", 100.0 * trend.of_signal)
            : "";
    lines.push_back(fmt::format("Changes: {} ({:.2g} standard errors from none{}).",
                                trend_words(trend, diagnosis.effects), std::abs(trend.z), share));
  }
  return lines;
}

std::string change_words(const TimeVariation& change, bool has_effects) {
  const std::string unit = change.unit == "1" ? "" : " " + change.unit;
  const bool is_slow = change.frequency * change.duration < 1.5;
  std::string words = fmt::format(
      "The {} at {} changes with time, by {:.2g}{} (rms) or more, {} (p {}, all places counted).",
      change.coefficient, change.place, change.deviation, unit,
      is_slow ? fmt::format("once in the {:.3g} s of a recording or slower", change.duration)
              : fmt::format("mainly near {:.3g} Hz", change.frequency),
      change.p_value > 0.0 ? fmt::format("= {:.2g}", change.p_value) : "< 1e-300");
  if (!change.alternatives.empty()) {
    words += " Not told apart from it: ";
    for (std::size_t i = 0; i < change.alternatives.size(); ++i) {
      words += (i > 0 ? ", " : "") + change.alternatives[i];
    }
    words += ".";
  }
  words += " Laws and parameters here do not depend on time";
  words += has_effects ? ", so what follows may only stand in for that." : ".";
  return words + " Let the machine warm up, look for what works loose, and record for longer.";
}

void add_detectable(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses,
                    std::vector<std::string>& lines) {
  constexpr std::size_t kMostNamed = 5;
  std::vector<std::string> blind;
  for (const DetectableEffect& effect : diagnosis.detectable) {
    if (!std::isinf(effect.amplitude)) continue;
    const Hypothesis& hypothesis = hypotheses[effect.hypothesis];
    blind.push_back(fmt::format("{} at {}", spaced(hypothesis.law), hypothesis.place));
  }
  if (diagnosis.detectable.empty()) return;
  const bool are_named = !blind.empty() && blind.size() <= kMostNamed;
  lines.push_back(fmt::format(
      "{} hypotheses were tested; {} of them could not be seen, because the fitted parameters "
      "imitate them{}.",
      diagnosis.detectable.size(), blind.size(),
      are_named ? fmt::format(": {}", fmt::join(blind, "; ")) : ""));
}

// "the motion of slow at half its amplitude and twice its speed, joint_2 alone".
std::string motion_words(const ExperimentOption& option) {
  const auto times = [](double factor) -> std::string {
    if (factor == 0.25) return "a quarter of";
    if (factor == 0.5) return "half";
    return factor == 2.0 ? "twice" : fmt::format("{:g} times", factor);
  };
  std::string changes;
  if (option.amplitude != 1.0)
    changes = fmt::format(" at {} its amplitude", times(option.amplitude));
  if (option.speed != 1.0) {
    changes +=
        fmt::format("{} {} its speed", changes.empty() ? " at" : " and", times(option.speed));
  }
  if (changes.empty()) changes = option.alone.empty() ? " again" : "";
  const std::string alone = option.alone.empty() ? "" : fmt::format(", {} alone", option.alone);
  return fmt::format("the motion of {}{}{}", option.recording, changes, alone);
}

}  // namespace

std::string experiment_words(const ExperimentOption& option) {
  if (!option.recording.empty()) return motion_words(option);
  const std::string place =
      option.position_degrees.empty() ? "" : fmt::format("in position {} ", option.position);
  return fmt::format("{}at level {:.4g} from {:.4g} to {:.4g} Hz", place, option.level, option.from,
                     option.to);
}

std::string hypothesis_words(const Hypothesis& hypothesis) {
  return fmt::format("{} at {}", spaced(hypothesis.law), hypothesis.place);
}

bool is_more_than_noise(const ChannelRest& rest) {
  const SearchOptions limits;
  return rest.structure > limits.structure_tolerance ||
         rest.autocorrelated_error > limits.autocorrelation_tolerance;
}

std::string map_words(const Diagnosis& diagnosis) {
  const std::vector<MismatchCell>& cells = diagnosis.mismatch_after;
  const std::vector<bool> framed = rejected_cells(cells, kFramedRate);
  const auto count = std::ranges::count(framed, true);
  if (count == 0) return "";
  double beyond = 0.0, numbers = 0.0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    numbers += cells[i].degrees_of_freedom;
    if (framed[i]) beyond += cells[i].statistic - cells[i].degrees_of_freedom;
  }
  std::string words = fmt::format(
      "{} of {} cells of the map of what is left {} framed: there the recordings of the fit have "
      "more "
      "than noise, each cell tested by itself (1 in {:.0f} of the framed may be chance).",
      count, cells.size(), count == 1 ? "is" : "are", 1.0 / kFramedRate);
  if (diagnosis.verified) {
    words += fmt::format(
        " That and a rest that is no more than noise can both be true: the framed cells have "
        "{:.2g} % of the "
        "noise's power beyond it, and the test of all that is left, on other recordings where "
        "there are any, "
        "allows {:g} %.",
        100.0 * beyond / numbers, 100.0 * SearchOptions{}.tolerance);
  }
  return words;
}

std::string next_experiment_words(const NextExperiment& next, const std::string& what) {
  if (!std::isfinite(next.recordings_needed)) {
    return fmt::format("No experiment of the same kind would tell {}.", what);
  }
  std::string shares;
  for (const NextExperiment::Share& share : next.shares) {
    shares += fmt::format("{}{:.0f} % {}", shares.empty() ? "" : ", ", 100.0 * share.weight,
                          experiment_words(share.option));
  }
  const double count = std::max(1.0, next.recordings_needed);
  constexpr double kMost = 10.0;  // that anyone makes
  if (count > kMost) {
    constexpr double kUncounted = 1000.0;
    const std::string needed =
        count > kUncounted ? "however many" : fmt::format("{:.0f} more would be needed", count);
    return fmt::format(
        "To tell {}: such recordings will not, {}; change the motion (reverse it, other speeds and "
        "loads) or add a sensor.",
        what, needed);
  }
  const bool is_motion = !next.shares.empty() && !next.shares.front().option.recording.empty();
  return fmt::format(
      "To tell {}: {:.0f} more recording{}{}, {} (designed to a duality gap of {:.1g}; the "
      "distance between the two, in squared standard errors, grows from {:.3g} to {:.3g} with "
      "{:.0f} of them, {:.3g} is needed).",
      what, count, count > 1.0 ? "s" : "", is_motion ? " as long as those at hand" : "", shares,
      next.duality_gap, next.distance_now, next.distance_then, next.recordings,
      next.distance_needed);
}

std::string estimate_words(const LawParameterEstimate& estimate) {
  const std::string unit = estimate.unit.empty() || estimate.unit == "1" ? "" : " " + estimate.unit;
  if (estimate.sets_scale) {
    const bool is_threshold = estimate.name == "threshold";  // of any that no sample is near
    return fmt::format("{:.4g}{} ({})", estimate.value, unit,
                       is_threshold ? "stated" : "stated: with another the other sizes scale");
  }
  const double error = estimate.error();
  if (estimate.value == 0.0 && !(error > 0.0)) return fmt::format("0{} (held)", unit);
  if (!(error > 0.0) || !std::isfinite(error)) {
    return fmt::format("{:.4g}{} (no standard error)", estimate.value, unit);
  }
  const bool is_absurd = error >= kBeyondPlain && error > kSaysNothing * std::abs(estimate.value);
  constexpr double kRounding = 1e-9;  // of the value: no recording tells so much
  if (error < kRounding * std::abs(estimate.value)) {
    return fmt::format("{:.6g}{} (to rounding)", estimate.value, unit);
  }
  if ((!is_determined(estimate) && error > kSaysNothing * std::abs(estimate.value)) || is_absurd) {
    return fmt::format("not determined (fitted at {:.2g}{})", estimate.value, unit);
  }
  // Decimals of the value, in units of a common power of ten, so that the error shows two digits.
  const double largest = std::max(std::abs(estimate.value), error);
  const int exponent = static_cast<int>(std::floor(std::log10(largest)));
  const int error_exponent = static_cast<int>(std::floor(std::log10(error)));
  const bool plain = exponent >= -3 && exponent < 5;
  const int shift = plain ? 0 : exponent;
  const int decimals = std::clamp(shift - error_exponent + 1, 0, 12);
  const double scale = std::pow(10.0, -shift);
  const std::string power = plain ? "" : fmt::format("e{:+03d}", shift);
  const std::string text = fmt::format("{:.{}f}{} ± {:.{}f}{}{}", estimate.value * scale, decimals,
                                       power, error * scale, decimals, power, unit);
  return is_determined(estimate) ? text : "not determined (" + text + ")";
}

namespace {

// Faults of wires, signs and units.
void add_channel_faults(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  for (const ChannelFault& fault : diagnosis.channel_faults) {
    lines.push_back(fmt::format(
        "{} ({} {:.3g} as recorded, {:.3g} once it is mended). Mend it in campaign.yaml or in the "
        "model; "
        "--ignore-faults searches all the same.",
        fault.statement(), fault.measure, fault.dissimilarity_before, fault.dissimilarity_after));
  }
  if (!diagnosis.channels_checked) {
    lines.push_back(
        "Wires, signs and units were not checked to the end: there was no time. A fault among them "
        "looks like missing physics.");
  }
}

// Each effect found, its same places and its rivals.
void add_effects(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses,
                 std::vector<std::string>& lines) {
  const bool is_sound = excluding(diagnosis.implausible) == 0;
  for (const FoundEffect& effect : diagnosis.effects) {
    if (!is_sound) {
      lines.push_back(unsound_words(effect, hypotheses));
      continue;
    }
    std::string better =
        diagnosis.noise_is_known ? std::string() : better_rivals_words(effect, hypotheses);
    if (!better.empty()) lines.push_back(std::move(better));
    lines.push_back(effect_words(effect, hypotheses, diagnosis));
    add_same_places(effect.same_at, hypotheses, lines);
    add_rivals(effect, hypotheses, diagnosis.noise_is_known, lines);
  }
}

// The masses, dampings and springs that the model has by itself, as fitted: of a small model, whose
// reader knows what to expect.
void add_own_parameters(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  constexpr std::size_t kMost = 6;
  const std::vector<LawParameterEstimate>& own = diagnosis.after.model_parameters;
  if (own.empty() || own.size() > kMost) return;
  std::string words;
  for (const LawParameterEstimate& each : own) {
    words += fmt::format("{}{} {}", words.empty() ? "" : ", ", each.name, estimate_words(each));
  }
  lines.push_back(fmt::format("The model's own parameters, as fitted: {}.", words));
}

void add_all_channels(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  if (diagnosis.remaining_structure && diagnosis.channels_after.size() > 1) {
    add_each_channel(diagnosis.channels_before, diagnosis.channels_after, lines);
  } else {
    add_channels(diagnosis, lines);
  }
  add_late_channels(diagnosis.channels_after, lines);
}

// Whether what is left is noise.
void add_test_of_rest(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  if (diagnosis.detection.detected && diagnosis.noise_is_known && !diagnosis.rest_test.was_made) {
    lines.push_back("Whether what is left is noise was not tested: there was no time.");
  } else if (diagnosis.detection.detected && diagnosis.noise_is_known) {
    const std::string where =
        diagnosis.validation_within_errors
            ? fmt::format(
                  ", on recordings kept out of the fit, where chi-square per degree of "
                  "freedom is {:.4g} with the errors of the fitted parameters counted",
                  diagnosis.validation_within_errors->chi_square_per_dof())
            : "; no recordings were kept out of the fit";
    lines.push_back(fmt::format(
        "{} {} (p = {:.2g}{}).",
        diagnosis.departures.empty() ? "What is left" : "By its chi-square what is left",
        diagnosis.verified ? "is no more than noise" : "is more than noise",
        diagnosis.rest_test.p_value, where));
    if (!diagnosis.verified && diagnosis.rest_test.fit_p_value < diagnosis.rest_test.p_value) {
      lines.back() += fmt::format(" On the fit's own recordings it is {:.4g} (p = {:.2g}).",
                                  diagnosis.after.estimation.chi_square_per_dof(),
                                  diagnosis.rest_test.fit_p_value);
    }
  }
}

// Real sensors leave something.
void add_exact_fit(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  constexpr double kExact = 1e-6;  // % of the signal
  const bool is_exact = diagnosis.after.usable && diagnosis.before.estimation.nrmse > kExact &&
                        diagnosis.after.estimation.nrmse < kExact;
  if (!is_exact) return;
  lines.push_back(
      "With it the channels fit each other to rounding, as no sensors do: one of them was computed "
      "from the others, or all were simulated.");
}

// How far what is left follows from the motion, and from its own past.
void add_memory_of_rest(const Diagnosis& diagnosis, std::vector<std::string>& lines) {
  if (diagnosis.remaining_structure) {
    lines.push_back(
        fmt::format("The noise is not known. {:.0f} % of what is left still depends on "
                    "position or velocity of a joint.",
                    100.0 * *diagnosis.remaining_structure));
  }
  if (diagnosis.autocorrelated_error) {
    const double error = *diagnosis.autocorrelated_error;
    lines.push_back(
        fmt::format("Of what is left, {:.{}f} % of the signal follows from its own past.", error,
                    error < 9.95 ? 1 : 0));
    if (error > SearchOptions{}.autocorrelation_tolerance) {
      lines.back() +=
          " No sensor's noise does: it is a disturbance with memory, or physics that none of these "
          "laws describes.";
    }
  }
}

}  // namespace

std::vector<std::string> verdict_words(const Diagnosis& diagnosis,
                                       std::span<const Hypothesis> hypotheses) {
  std::vector<std::string> lines{headline(diagnosis)};
  std::ranges::copy(diagnosis.assumptions, std::back_inserter(lines));
  add_channel_faults(diagnosis, lines);
  const auto add = [&lines](const std::vector<std::string>& more) {
    lines.insert(lines.end(), more.begin(), more.end());
  };
  add(plausibility_lines(diagnosis.implausible));
  if (!diagnosis.trouble.empty()) {
    add(reason_lines(diagnosis));
    return lines;
  }
  if (!diagnosis.rivals_weighed) {
    lines.push_back(
        "As many laws as the search takes leave more than noise: they lower the error, but may "
        "only stand in for a law that was not tried. Their rivals were not weighed.");
  }
  if (diagnosis.time_variation)
    lines.push_back(change_words(*diagnosis.time_variation, !diagnosis.effects.empty()));
  add_moved_channels(diagnosis, lines);
  add_effects(diagnosis, hypotheses, lines);
  std::string trial = unfinished_words(diagnosis, hypotheses);
  if (!trial.empty()) lines.push_back(std::move(trial));
  add_own_parameters(diagnosis, lines);
  add(lines_of_laws(diagnosis, hypotheses));
  add(freed_model_lines(diagnosis));
  add(rejected_lines(diagnosis, hypotheses));
  for (const Departure& departure : diagnosis.departures) {
    lines.push_back(departure_words(departure, hypotheses));
  }
  for (const SharedCharacteristic& shared : diagnosis.shared_characteristics) {
    lines.push_back(shared_words(shared, hypotheses));
  }
  add_all_channels(diagnosis, lines);
  add_fit("the recordings of the fit", diagnosis.before.estimation, diagnosis.after.estimation,
          diagnosis, lines);
  add_fit("recordings kept out of the fit", diagnosis.validation_before, diagnosis.validation_after,
          diagnosis, lines);
  add_exact_fit(diagnosis, lines);
  add(kept_out_lines(diagnosis, hypotheses));
  add_test_of_rest(diagnosis, lines);
  if (diagnosis.verified) {
    if (std::string map = map_words(diagnosis); !map.empty()) lines.push_back(std::move(map));
  }
  if (diagnosis.verified && !diagnosis.predicts) {
    lines.push_back(
        "The errors of the fitted parameters may be all that recordings kept out have beyond "
        "noise, or a law that is not in the catalogue. Recordings like those, in the fit, would "
        "tell.");
  }
  add_memory_of_rest(diagnosis, lines);
  add(reason_lines(diagnosis));
  if (const std::string range = range_words(diagnosis.checked); !range.empty()) {
    lines.push_back(range);
  }
  add_detectable(diagnosis, hypotheses, lines);
  return lines;
}

std::string changed_size_words(const Diagnosis& diagnosis, const ChangedSize& size,
                               std::span<const Hypothesis> hypotheses) {
  std::string of;
  if (size.law) {
    const Hypothesis& law = hypotheses[diagnosis.after.laws[*size.law].hypothesis];
    of = fmt::format(" of {} at {}", spaced(law.law), law.place);
  }
  return fmt::format("{}{} {} instead of {}", spaced(size.in_fit.name), of,
                     estimate_words(size.kept_out), estimate_words(size.in_fit));
}

}  // namespace graybox
