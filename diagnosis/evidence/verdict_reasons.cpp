#include "diagnosis/evidence/verdict_reasons.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/evidence/trend_reason.hpp"

namespace graybox {
namespace {

constexpr double kSignal = 100.0;  // %, of an error as large as what is measured

constexpr const char* kNoTime = "there was no time";
constexpr const char* kNoneKeptOut = "no recordings were kept out of the fit";

VerdictReason at_most(std::string test, double value, double limit, std::string next,
                      Verdict otherwise = Verdict::kUnknown) {
  VerdictReason reason;
  reason.test = std::move(test);
  reason.value = value;
  reason.limit = limit;
  reason.passed = value <= limit;  // not where it is no number
  reason.otherwise = otherwise;
  if (!reason.passed) reason.next = std::move(next);
  if (reason.next.ends_with('.')) reason.next.pop_back();
  return reason;
}

VerdictReason at_least(std::string test, double value, double limit, std::string next) {
  VerdictReason reason = at_most(std::move(test), value, limit, {});
  reason.is_lower_limit = true;
  reason.passed = value >= limit;
  if (!reason.passed) reason.next = std::move(next);
  return reason;
}

VerdictReason not_asked(std::string test, double limit, std::string why) {
  VerdictReason reason;
  reason.test = std::move(test);
  reason.limit = limit;
  reason.not_tested = std::move(why);
  return reason;
}

VerdictReason failed(std::string test, std::string next, Verdict otherwise = Verdict::kUnknown) {
  VerdictReason reason;
  reason.test = std::move(test);
  reason.passed = false;
  reason.next = std::move(next);
  reason.otherwise = otherwise;
  return reason;
}

VerdictReason generalisation(const Diagnosis& diagnosis, const SearchOptions& options) {
  const char* const test = "error kept out over that of the fit";
  if (!diagnosis.validation_after) {
    return not_asked(test, options.generalisation,
                     diagnosis.interrupted && diagnosis.validation_before ? kNoTime : kNoneKeptOut);
  }
  return at_most(test,
                 std::sqrt(diagnosis.validation_after->chi_square_per_dof() /
                           diagnosis.after.estimation.chi_square_per_dof()),
                 options.generalisation,
                 "put recordings like those kept out into the fit, and look at which channel and "
                 "time the error kept out "
                 "is largest: something acts there that the fit's recordings hardly show");
}

// Several forces that are balanced are those of a robot's joints, which carry bodies.
std::string advice_on_channel(const Diagnosis& diagnosis, const std::string& channel) {
  const bool is_robot = diagnosis.channels_after.size() > 1 &&
                        (channel.starts_with("torque of ") || channel.starts_with("force of "));
  return fmt::format(
      "look at {}: something acts there that no law found describes, {}or it is mostly noise",
      channel,
      is_robot ? "the bodies that it carries are not those stated (body_uncertainty in the model "
                 "frees them), "
               : "");
}

// Where nothing was kept out, the fit's own errors must pass at least.
std::vector<VerdictReason> fitted_channel_reasons(const Diagnosis& diagnosis,
                                                  const SearchOptions& options) {
  const auto worst = std::ranges::max_element(diagnosis.channels_after, {}, &ChannelRest::nrmse);
  if (worst == diagnosis.channels_after.end()) return {};
  return {at_most(
      fmt::format("error of the channel fitted worst ({}), % of its signal", worst->channel),
      worst->nrmse, options.channel_tolerance, advice_on_channel(diagnosis, worst->channel))};
}

// The channel that is predicted worst: a good figure for all channels together may hide it.
std::vector<VerdictReason> channel_reasons(const Diagnosis& diagnosis,
                                           const SearchOptions& options) {
  const std::string error = "error kept out of the channel predicted worst";
  const std::string growth = "largest ratio of a channel's error kept out to that of the fit";
  std::string worst, grown;
  double largest = 0.0, ratio = 0.0;
  for (const ChannelRest& rest : diagnosis.channels_after) {
    if (!rest.held_out_nrmse) continue;
    if (worst.empty() || *rest.held_out_nrmse > largest) {
      worst = rest.channel;
      largest = *rest.held_out_nrmse;
    }
    if (grown.empty() || rest.growth() > ratio) {
      grown = rest.channel;
      ratio = rest.growth();
    }
  }
  if (worst.empty()) return fitted_channel_reasons(diagnosis, options);
  return {at_most(fmt::format("{} ({}), % of its signal", error, worst), largest,
                  options.channel_tolerance, advice_on_channel(diagnosis, worst)),
          at_most(fmt::format("{} ({})", growth, grown), ratio, options.generalisation,
                  fmt::format("put recordings like those kept out into the fit, and look at {}",
                              grown))};
}

// What of the rest depends on the motion, as part of the signal: a small rest that nearly all
// depends on it is a small matter. Of a problem that can't say it nothing is known to be noise.
VerdictReason motion_reason(const Diagnosis& diagnosis, const SearchOptions& options,
                            const char* next) {
  const std::string test = "rest that depends on the motion, % of the signal";
  if (!diagnosis.remaining_structure) return failed(test + " (can't be told)", next);
  const double error = diagnosis.after.estimation.nrmse;
  return at_most(test, std::sqrt(*diagnosis.remaining_structure) * error,
                 std::max(options.structure_error, std::sqrt(options.structure_tolerance) * error),
                 next);
}

void append(std::vector<VerdictReason> more, std::vector<VerdictReason>& reasons) {
  std::ranges::move(more, std::back_inserter(reasons));
}

// Of what a search that was stopped had no time for.
std::string why_not(const Diagnosis& diagnosis, const char* otherwise) {
  return diagnosis.interrupted ? kNoTime : otherwise;
}

// Why tests that need recordings kept out of the fit were not made. A search that was stopped may
// have some that it did not come to, and those that its first fit was compared with are there.
std::string why_not_kept_out(const Diagnosis& diagnosis) {
  const bool are_there = diagnosis.validation_before || !diagnosis.before.usable;
  return diagnosis.interrupted && are_there ? kNoTime : kNoneKeptOut;
}

// A search that was stopped before it compared the laws that it had with others.
bool has_weighed(const Diagnosis& diagnosis) {
  return !diagnosis.interrupted || !diagnosis.effects.empty();
}

std::vector<VerdictReason> shape_reasons(const Diagnosis& diagnosis) {
  const char* const test = "places where the laws found only resemble what is there";
  std::vector<VerdictReason> reasons;
  if (diagnosis.shapes_compared) {
    reasons.push_back(at_most(test, static_cast<double>(diagnosis.departures.size()), 0.0,
                              "try laws of your own there (--laws), or record larger motion"));
  } else {
    reasons.push_back(
        not_asked(test, 0.0, why_not(diagnosis, "other laws to compare with could not be tested")));
  }
  const char* const shared = "places where several laws describe one spring or friction";
  const auto count = static_cast<double>(diagnosis.shared_characteristics.size());
  reasons.push_back(has_weighed(diagnosis)
                        ? at_most(shared, count, 0.0, "try one law of your own for them (--laws)")
                        : not_asked(shared, 0.0, kNoTime));
  return reasons;
}

VerdictReason change_reason(const Diagnosis& diagnosis, const SearchOptions& options) {
  const char* const test = "p-value of what changes with time";
  if (diagnosis.time_variation) {
    return at_least(test, diagnosis.time_variation->p_value, options.variation_level,
                    "let the machine warm up, look for what works loose, and record for longer");
  }
  if (!diagnosis.time_variation_was_tested) {
    return not_asked(test, options.variation_level,
                     why_not(diagnosis, "these recordings can't tell it"));
  }
  VerdictReason passed = not_asked(test, options.variation_level, {});
  passed.is_lower_limit = true;
  return passed;
}

// The test of what changes: of the laws found where the noise is not known, else of the plant.
VerdictReason trend_or_change(const Diagnosis& diagnosis, const SearchOptions& options) {
  const bool has_trends =
      !diagnosis.noise_is_known && !diagnosis.effects.empty() && !diagnosis.trends.empty();
  return has_trends ? trend_reason(diagnosis.trends, diagnosis.effects, "")
                    : change_reason(diagnosis, options);
}

VerdictReason rivals_reason(const Diagnosis& diagnosis) {
  const char* const test = "other explanations that are not excluded";
  if (!has_weighed(diagnosis)) return not_asked(test, 0.0, kNoTime);
  std::size_t rivals = 0;
  for (const FoundEffect& effect : diagnosis.effects) {
    rivals += effect.rivals.size() + effect.same_at.size();
  }
  return at_most(test, static_cast<double>(rivals), 0.0,
                 "make the experiment that tells them apart, where one is named, or add a sensor",
                 Verdict::kAmbiguous);
}

// Friction and a late channel look alike: laws that were found beside a channel of which being late
// would take a fifth of the error are not sure. Nothing where there is none.
std::vector<VerdictReason> lateness_reasons(const Diagnosis& diagnosis) {
  constexpr double kMost = 0.8;  // of the squared error kept out
  std::vector<VerdictReason> reasons;
  for (const ChannelRest& rest : diagnosis.channels_after) {
    if (!rest.late_by || !rest.held_out_nrmse || !rest.held_out_nrmse_in_time) continue;
    const double left = std::pow(*rest.held_out_nrmse_in_time / *rest.held_out_nrmse, 2);
    if (left > kMost) continue;
    const double seconds = *rest.late_by;
    reasons.push_back(failed(
        fmt::format("{} would take {:.0f} % of the squared error kept out of {}", kLateTest,
                    100.0 * (1.0 - left), rest.channel),
        fmt::format("advance {} by {:.2g} s (preprocess: advance) and diagnose again: the laws "
                    "found may stand in for it",
                    seconds > 0.0 ? "it" : "the positions", std::abs(seconds)),
        Verdict::kAmbiguous));
  }
  return reasons;
}

std::vector<VerdictReason> law_reasons(const Diagnosis& diagnosis) {
  std::vector<VerdictReason> reasons;
  const bool has_late_channels = !diagnosis.late_channels.empty();
  const char* const found = has_late_channels ? "laws and late channels found" : "laws found";
  reasons.push_back(
      has_weighed(diagnosis)
          ? at_least(
                found,
                static_cast<double>(diagnosis.effects.size() + diagnosis.late_channels.size()), 1.0,
                "try laws and places of your own (--laws, --places), and check units, signs and "
                "the motion that was recorded")
          : not_asked(found, 1.0, kNoTime));
  const auto misleading = std::ranges::count_if(diagnosis.effects, [](const FoundEffect& effect) {
    return effect.held_out && effect.held_out->misleads;
  });
  if (diagnosis.validation_after) {
    reasons.push_back(at_most("laws found that raise the error kept out",
                              static_cast<double>(misleading), 0.0, "leave them out (--without)"));
    reasons.push_back(at_most("error kept out, % of the signal", diagnosis.validation_after->nrmse,
                              kSignal, "check the units and signs of the channels"));
  } else {
    reasons.push_back(
        not_asked("laws found that raise the error kept out", 0.0, why_not_kept_out(diagnosis)));
  }
  return reasons;
}

// Why there is no fit to judge.
std::optional<VerdictReason> trouble_reason(const Diagnosis& diagnosis) {
  if (!diagnosis.channel_faults.empty()) {
    return at_most(
        "wires, signs and units that look wrong",
        static_cast<double>(diagnosis.channel_faults.size()), 0.0,
        "mend them in campaign.yaml or in the model, or search all the same with --ignore-faults");
  }
  if (!diagnosis.trouble.empty()) {
    return failed("the model as it is can be fitted",
                  "check the values in the model file, and what 'graybox fit' makes of it");
  }
  return {};
}

VerdictReason determination_reason(const Diagnosis& diagnosis) {
  const char* const test = "parameters that are not determined";
  if (!diagnosis.plausibility_judged) return not_asked(test, 0.0, kNoTime);
  const std::size_t count = diagnosis.implausible.size() - excluding(diagnosis.implausible);
  return at_most(test, static_cast<double>(count), 0.0,
                 count > 0 ? diagnosis.implausible.back().remedy : "", Verdict::kAmbiguous);
}

VerdictReason plausibility_reason(const Diagnosis& diagnosis) {
  const char* const test = "parameters and laws that no machine has";
  if (!diagnosis.plausibility_judged) return not_asked(test, 0.0, kNoTime);
  const std::size_t count = excluding(diagnosis.implausible);
  return at_most(test, static_cast<double>(count), 0.0,
                 count > 0 ? diagnosis.implausible.front().remedy : "");
}

VerdictReason memory_reason(const Diagnosis& diagnosis, const SearchOptions& options) {
  return at_most("part of the rest that follows from its own past, % of the signal",
                 diagnosis.autocorrelated_error.value_or(0.0), options.autocorrelation_tolerance,
                 "a disturbance with memory, or physics that none of these laws describes: record "
                 "what may disturb (temperature, supply, floor), or try laws of your own (--laws)");
}

}  // namespace

std::vector<VerdictReason> rest_reasons(const Diagnosis& diagnosis, const SearchOptions& options) {
  const char* const look =
      "look at which channel and where it is largest, and try laws of your own there (--laws)";
  if (!diagnosis.noise_is_known) {
    std::vector<VerdictReason> reasons = {generalisation(diagnosis, options)};
    append(channel_reasons(diagnosis, options), reasons);
    append({motion_reason(diagnosis, options, look), memory_reason(diagnosis, options)}, reasons);
    return reasons;
  }
  const char* const kept_out = diagnosis.validation_within_errors
                                   ? "p-value of the rest on recordings kept out being noise"
                                   : "p-value of the rest being noise";
  const char* const of_fit = "p-value of the rest on the fit's recordings being noise";
  if (!diagnosis.rest_test.was_made) {
    return {not_asked(kept_out, options.verification_level, kNoTime),
            not_asked(of_fit, options.verification_level, kNoTime)};
  }
  return {at_least(kept_out, diagnosis.rest_test.p_value, options.verification_level, look),
          at_least(of_fit, diagnosis.rest_test.fit_p_value, options.verification_level, look)};
}

VerdictReason nothing_kept_out(Verdict otherwise) {
  return failed(kKeptOutTest,
                "keep some of them out (role: validation) and diagnose again: nothing has tested "
                "what was found",
                otherwise);
}

bool predicts_kept_out(const Diagnosis& diagnosis) {
  if (diagnosis.noise_is_known) return diagnosis.predicts;
  if (!diagnosis.validation_after) return false;
  return std::ranges::none_of(diagnosis.reasons, [](const VerdictReason& reason) {
    return has_failed(reason) && reason.test.find("kept out") != std::string::npos &&
           !reason.test.starts_with(kSizesTest);
  });
}

bool is_not_confirmed(const FoundEffect& effect) {
  constexpr double kMuch = 15.0, kNotSmall = 5.0;  // % of the signal
  constexpr double kHalfMore = 1.5;
  if (!effect.held_out || !effect.held_out->misleads) return false;
  const double with_law = effect.held_out->error_with, without = effect.held_out->error_without;
  return with_law > kMuch || (with_law > kNotSmall && with_law > kHalfMore * without);
}

VerdictReason sizes_hold_reason(const Diagnosis& diagnosis) {
  constexpr double kSmallError = 3.0;  // % of the signal
  const auto& change = diagnosis.kept_out_change;
  const bool matters = change && change->error_predicted > kSmallError;
  return at_most(kSizesTest, matters ? static_cast<double>(change->sizes.size()) : 0.0, 0.0,
                 "physics that is missing here may need all recordings to show: fit them together, "
                 "or record what differs between them");
}

namespace {

// Where nothing was detected: nothing is missing, if neither recordings kept out nor what is left
// speak against that. Much that is left is noise only if it has no memory.
std::vector<VerdictReason> reasons_for_nothing(const Diagnosis& diagnosis,
                                               const SearchOptions& options) {
  std::vector<VerdictReason> against;
  const bool is_unknown = !diagnosis.noise_is_known;
  if (is_unknown && diagnosis.validation_after &&
      diagnosis.validation_after->nrmse > options.channel_tolerance) {
    against.push_back(generalisation(diagnosis, options));
  }
  if (is_unknown && diagnosis.after.estimation.nrmse > options.channel_tolerance) {
    against.push_back(memory_reason(diagnosis, options));
  }
  if (diagnosis.kept_out_change) against.push_back(sizes_hold_reason(diagnosis));
  std::vector<VerdictReason> reasons;
  for (VerdictReason& reason : against) {
    if (has_failed(reason)) reasons.push_back(std::move(reason));
  }
  if (is_unknown && !diagnosis.validation_after) {
    reasons.push_back(nothing_kept_out(Verdict::kUnknown));
  }
  if (!reasons.empty()) return reasons;
  return {failed("something is missing",
                 "nothing: the model as it is will do for motion like the recorded one",
                 Verdict::kNone)};
}

}  // namespace

std::vector<VerdictReason> verdict_reasons(const Diagnosis& diagnosis,
                                           const SearchOptions& options) {
  std::vector<VerdictReason> reasons;
  if (std::optional<VerdictReason> trouble = trouble_reason(diagnosis)) {
    return {*std::move(trouble)};
  }
  if (diagnosis.interrupted) {
    reasons.push_back(
        failed("the search came to its end", "give it more time (--time-limit) or more threads"));
  }
  if (!diagnosis.channels_checked) {
    reasons.push_back(not_asked("wires, signs and units that look wrong", 0.0, kNoTime));
  }
  reasons.push_back(plausibility_reason(diagnosis));
  if (!diagnosis.detection.detected && diagnosis.interrupted) {
    reasons.push_back(not_asked("something is missing", 0.0, kNoTime));
    return reasons;
  }
  if (!diagnosis.detection.detected) {
    append(reasons_for_nothing(diagnosis, options), reasons);
    return reasons;
  }
  append(law_reasons(diagnosis), reasons);
  VerdictReason change = trend_or_change(diagnosis, options);
  // What changes with time spoils the tests of the rest: it is their cause.
  const bool comes_first = !diagnosis.noise_is_known && has_failed(change) &&
                           change.otherwise == Verdict::kUnknown && !diagnosis.time_variation;
  if (comes_first) reasons.push_back(change);
  append(rest_reasons(diagnosis, options), reasons);
  if (!comes_first) reasons.push_back(std::move(change));
  if (diagnosis.noise_is_known) append(shape_reasons(diagnosis), reasons);
  if (diagnosis.noise_is_known && diagnosis.validation_after) {
    VerdictReason predicts =
        at_most("chi-square per degree of freedom kept out",
                diagnosis.validation_after->chi_square_per_dof(), options.noise_floor,
                "put recordings like those kept out into the fit", Verdict::kAmbiguous);
    predicts.passed = diagnosis.predicts;  // or above it by chance
    if (predicts.passed) predicts.next.clear();
    reasons.push_back(std::move(predicts));
  }
  if (auto holds = holding_reason(diagnosis.checked)) reasons.push_back(*std::move(holds));
  reasons.push_back(determination_reason(diagnosis));
  append(lateness_reasons(diagnosis), reasons);
  if (!diagnosis.noise_is_known && !diagnosis.validation_after && !diagnosis.interrupted) {
    reasons.push_back(nothing_kept_out());
  }
  reasons.push_back(rivals_reason(diagnosis));
  return reasons;
}

Verdict verdict_of(std::span<const VerdictReason> reasons) {
  const auto first = std::ranges::find_if(reasons, has_failed);
  return first == reasons.end() ? Verdict::kExplained : first->otherwise;
}

}  // namespace graybox
