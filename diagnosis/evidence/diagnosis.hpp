// What the search for missing physics found: the verdict, the laws in classes of those that the
// recordings can't tell apart, and all that a report shows of them. diagnosis_search.hpp says how
// each comes about.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/evidence/kept_out_change.hpp"
#include "diagnosis/hypotheses/checked_range.hpp"
#include "diagnosis/hypotheses/law_departure.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/plausibility/plausibility.hpp"

namespace graybox {

enum class Verdict : std::int8_t { kNone, kExplained, kAmbiguous, kUnknown };
[[nodiscard]] std::string_view to_string(Verdict verdict);

struct Detection {
  bool detected = false;
  double lack_of_fit_p_value = 1.0;  // 1 where the noise is not known
  double smallest_p_value = 1.0;     // of all hypotheses
  double threshold = 0.0;            // for it
};

struct DetectableEffect {
  std::size_t hypothesis = 0;
  double amplitude = 0.0;  // found with `detection_power`; infinite if it can't be seen at all
  std::string unit;
};

struct Rival {
  FittedLaw law;
  // To the best of its class; where the noise is not known, of the prediction of blocks kept out,
  // in squared standard errors, negative where it is better.
  double bic_difference = 0.0;
  std::optional<NextExperiment> next =
      {};                            // that tells it from the law found; of the nearest alone
  double evidence_difference = 0.0;  // to the law found, where the noise is known
  // What recordings kept out add to both; none where there are none or they were not asked.
  std::optional<double> held_out_difference = {};
  // The same law at other places, where it is the same to every experiment of this kind: one
  // explanation.
  std::vector<FittedLaw> same_at = {};
  // Excluded by a few of many recordings (MismatchProblem::fit_to_few): differences are theirs, to
  // the best fit there, and all recordings would give larger ones.
  bool on_few_recordings = false;
  // Excluded before recordings were freed of free motion with the law found: differences are to
  // that, there.
  bool on_other_noise = false;
  // Excluded by recordings kept out, whatever it does on those of the fit.
  bool is_contradicted = false;
  // Laws that make a sum with `law`, which stands in the place of the law found (plainer_sums.hpp).
  std::vector<FittedLaw> with = {};
};

// What a law does to recordings kept out of the fit, beside the others: the model refitted without
// it against the one with it.
struct HeldOutEffect {
  double error_without = 0.0, error_with = 0.0;  // NRMSE, %
  double gain = 0.0;      // share of the squared error over the noise that it takes away
  bool misleads = false;  // it raises that error, beyond chance where the noise is known
  // The channels on which it acts, whose errors these are; empty: all together.
  std::string channels{};
  double seconds_ahead = 0.0;  // 0: of whole recordings; else of predictions as far ahead
};

struct FoundEffect {
  FittedLaw law;
  // The share that the law explains of the excess of chi-square before it, and how much worse BIC
  // is without it; NaN where the model without it could not be fitted.
  double explained_share = std::numeric_limits<double>::quiet_NaN();
  double bic_difference = std::numeric_limits<double>::quiet_NaN();
  std::vector<Rival> rivals;           // not excluded
  std::vector<Rival> generalisations;  // of those, as rich as the data do not ask for; the best few
  std::vector<Rival> excluded;         // the best of those that are, by their distance
  std::vector<FittedLaw> same_at = {};  // as in Rival
  // None where no recordings were kept out, or the model without it could not be fitted.
  std::optional<HeldOutEffect> held_out = {};
  bool is_first_of_its_kind = false;  // the model has no spring there that it could correct
};

// A law that lowered the error of the fit and is not found all the same.
struct RejectedLaw {
  FittedLaw law;
  std::string reason;
  std::optional<HeldOutEffect> held_out = {};
};

// One test that the verdict is computed from (verdict_reasons.hpp).
struct VerdictReason {
  std::string test;
  std::optional<double> value;  // none: it is no number, or was not asked
  double limit = 0.0;
  bool is_lower_limit = false;  // the value must be at least that; else at most
  bool passed = true;
  std::string not_tested = {};            // why not; then it neither passes nor fails
  Verdict otherwise = Verdict::kUnknown;  // the verdict where it fails
  std::string next = {};                  // what to do about it; empty where it passed
};

// Laws that were found at one place for one characteristic.
struct SharedCharacteristic {
  std::string place;
  Characteristic characteristic = Characteristic::kNone;
  std::vector<std::size_t> hypotheses;
};

// What the model states was free within its uncertainty (MismatchProblem::with_uncertain_model):
// errors beside the plain laws that each needs, NRMSE in %.
struct FreedModel {
  double error_stated = 0.0, error_freed = 0.0;
  bool on_kept_out = false;                  // else on the recordings of the fit
  std::vector<std::string> departures = {};  // of the final model, in words
  // Laws found that are not needed then, by their names; of a doubted model.
  std::vector<std::string> instead_of = {};
};

// A channel that was moved in time before laws were sought. Errors on recordings kept out, NRMSE in
// %: with the laws found before it was moved, and with those found after.
struct LateChannel {
  MovedChannel moved;
  double error_before = 0.0, error_after = 0.0;
};

// Whether what is left is noise, where the noise is known.
struct RestTest {
  bool was_made = true;  // false: there was no time to, and the two p-values say nothing
  double p_value = 1.0;
  double fit_p_value = 1.0;  // likewise on the fit's own recordings, with twice the tolerance
};

struct Diagnosis {
  Verdict verdict = Verdict::kUnknown;
  bool noise_is_known = false;
  bool may_be_disturbed = false;  // no law, and nothing that is left depends on the motion
  bool interrupted = false;
  std::string trouble;                   // why no fit, if there is none
  std::vector<std::string> assumptions;  // what was held to be so, in sentences
  std::vector<ChannelFault> channel_faults;
  bool channels_checked = true;  // false: there was no time to, or not for all
  Detection detection;
  std::vector<FoundEffect> effects;
  ExtendedFit before, after;
  std::optional<Assessment> validation_before, validation_after;
  // After, with what errors of the fitted parameters do counted as noise: what the verdict is
  // verified by.
  std::optional<Assessment> validation_within_errors;
  // Where something changes while it is recorded: the verdict then is `unknown`, whatever laws fit.
  std::optional<TimeVariation> time_variation;
  bool time_variation_was_tested = false;  // else it can't be told from these recordings
  std::vector<LawTrend> trends;  // of the effects, where the noise is not known; none: not tested
  bool verified = false;         // the rest passed the test of step 6
  // Whether it could be asked if the laws found only resemble what is there; where they do, and no
  // other fit of their classes does not. Then, and where laws share a characteristic, the verdict
  // is `unknown`.
  bool shapes_compared = false;
  std::vector<Departure> departures;
  std::vector<SharedCharacteristic> shared_characteristics;
  // Where the noise is known: recordings kept out are predicted to the noise floor, not only within
  // what the errors of the fitted parameters do there.
  bool predicts = true;
  RestTest rest_test;
  bool rivals_weighed = true;  // false: as many laws as may be leave more than noise
  std::optional<double> remaining_structure, autocorrelated_error;  // where the noise is not known
  std::vector<DetectableEffect> detectable;                         // in the light of the first fit
  std::vector<HypothesisScore> ranking;                             // of the first fit, best first
  std::vector<MismatchCell> mismatch_before, mismatch_after;
  std::vector<ChannelRest> channels_before, channels_after;  // where the noise is not known
  std::vector<ResidualCurve> curves_before, curves_after;
  std::vector<ForcePicture> pictures;  // of the effects, in their order
  std::vector<RejectedLaw> rejected;
  std::optional<FreedModel> freed_model;
  // What the model states as certain, and these recordings contradict: it was not freed.
  std::optional<FreedModel> doubted_model;
  std::optional<KeptOutChange> kept_out_change;
  std::vector<LateChannel> late_channels;
  std::vector<Implausibility> implausible;  // of the final model, those that exclude it first
  bool plausibility_judged = true;          // false: there was no time to
  CheckedRange checked;
  std::vector<VerdictReason> reasons;  // in the order in which they decide
};

}  // namespace graybox
