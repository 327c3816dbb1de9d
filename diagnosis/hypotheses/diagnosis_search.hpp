// The search for missing physics: is something missing, where, which law, and is that all?
//
//   0. Look for swapped wires, wrong signs and units (channel_faults.hpp). Where there are any the search
//      ends, verdict unknown, for what it would find is no physics.
//   1. Fit the model as it is.
//   2. Detect, at family-wise level alpha: the chi-square of the residuals (alpha/2) or the smallest
//      p-value of all hypotheses' score tests against its own distribution under pure noise (alpha/2).
//      Where the noise is not known, the first is replaced by what of the residuals is clearly none (step
//      6). Where something is detected and the noise is known, the model alone is fitted again from where
//      refits with a law have led: a fit that stopped short of its optimum looks like missing physics. Not
//      where a law leaves no more than noise, and from there the model alone comes nowhere near.
//   3. While something is missing: rank all hypotheses by their score tests, refit with each of the best,
//      keep the one with the least Bayesian information criterion
//          BIC = deviance + parameters ln n,
//      if its deviance falls by more than the family-wise chi-square threshold. Where recordings are many, the
//      best are fitted to the few that tell most first (MismatchProblem::fit_to_few), and only those that are not
//      far behind there to all. Where the noise is not
//      known, it may have any memory, and n is not known either. There a law must be significant by a Wald
//      test that allows for memory, and must predict: with contiguous blocks of the recordings kept out in
//      turn, the squared error falls by `held_out_gain` at least and by `held_out_errors` standard errors
//      over the blocks. Where none does, up to four laws are taken together, each the one that predicts best
//      beside those before, if beside the others each passes the same tests: one of several harmonics of a
//      ripple drowns in the others. Compound places (Hypothesis::is_compound) come when single ones explain no more:
//      main effects before interactions. The law that predicts best is kept, or one of fewer parameters
//      that is not worse by more than one standard error. Where the noise is known, and what is left is no
//      more than noise by its chi-square, one law more is tried if the best hypothesis lies at a place
//      without a law and is significant by itself; it stays if BIC falls by `exclusion_margin` and by a
//      thousandth of what the others explain. A law by which chi-square on recordings kept out is a hundred times
//      that of the fit gives way to another by which it is a tenth, and is no rival of such. Where it is known and the best law, of m that may still come,
//      explains less than half an m-th of what is too much, the search gives up: such laws only stand in
//      for one that is not there.
//      Where only a fit with laws comes near enough to free the recordings of the plant's free motion, that is done
//      with it before another is looked for. Laws then far behind it are not fitted again.
//   4. Prune backwards: laws without which BIC is lower (or that do not predict, as in step 3) go, where
//      what is left without them is no more than noise also those without which it is not higher by more
//      than `exclusion_margin`, and laws that only generalise another of fewer parameters give way to it
//      unless they are better by `exclusion_margin` (predict better). Where the noise is not known, laws
//      for which another predicts better now are exchanged, and steps 3 and 4 repeated.
//   5. Rivals: for each law that stayed, the alternatives in its stead. Those that are not worse by
//      `exclusion_margin` (10: "very strong", Kass and Raftery 1995), or than which the law does not
//      predict better, can't be excluded and form one class with it. Worse in both, BIC and
//          evidence = deviance + log det(1 + D S D)     (ExtendedFit::laws_information),
//      twice the negative logarithm of Laplace's approximation to the evidence for law parameters as wide
//      before as their values: BIC charges ln n for a parameter also where the data say nothing about it,
//      so that a small effect would exclude all laws of many parameters. Where they do not decide by far
//      (ten times the margin) half of what recordings kept out say is added to both
//      (HeldOutPrediction::cost). A law that generalises another that stands is at least as good always:
//      a rival where the noise is known and its evidence is better by 2,
//      else no rival: the best of them are named beside the class (`generalisations`), where it has fewer
//      than three names. Twins (mismatch_problem.hpp) are rivals always, unless they generalise the law:
//      then they are the first to be named beside it. Members of a class with one law at several places
//      that no experiment of this kind would tell apart (a delay of the only actuator or of the only sensor
//      of a linear system) are one explanation: `same_at`. Where the noise is known and a law is excluded
//      by its rival, or one of several laws has a rival of lower BIC, that takes its place and all are
//      weighed again. Where the search has as
//      many laws as may be and the rest is no noise, rivals are not weighed.
//   6. Verify on recordings kept out of the fit, or on the fit's own where there are none: the rest must
//      not be larger than noise by more than `tolerance` of its variance (a test of practical size:
//      chi-square against the non-central distribution with noncentrality tolerance x degrees of freedom).
//      (That step 5 asked them too favours the law by some 10 of chi-square in thousands.)
//      On the fit's own recordings the same must hold with twice the tolerance: those kept out may not
//      excite what is missing. Where the noise is not known there is no such test; then the error on
//      recordings kept out must not be more than `generalisation` times that of the fit, and no more than
//      `structure_tolerance` of the rest may still depend on the motion
//      (MismatchProblem::remaining_structure), and what of the rest follows from its own past may be no
//      more than `autocorrelation_tolerance` of the signal (MismatchProblem::autocorrelated_error).
//
//      Where the noise is known, and what is left is no more than it: is it these laws, or others like them? What
//      they leave at their places (law_departure.hpp, at `verification_level`); nothing, if a fit with one of their rivals or
//      generalisations leaves nothing. Two laws for one characteristic (Hypothesis::characteristic) are as likely one
//      that the catalogue lacks. Before that is said, all laws that can be fitted there are weighed as rivals, and a
//      law of another characteristic is taken besides, if it stands out and both leave nothing.
//
//      Last, where the problem can tell: does something change while it is recorded
//      (MismatchProblem::time_variation)? By a test of its own at `variation_level`, because no law describes it.
//
//   7. Next: for the nearest rival of each law, the experiment that tells the two apart
//      (next_experiment.hpp).
//
// Verdicts: `none`: nothing detected. `explained`: one law a class, and the rest is noise.
// `ambiguous`: the rest is noise, but a class has several members, or one law several places, or recordings kept
// out are more than noise (`noise_floor`) and only within the errors of the fitted parameters: a law that is not in
// the catalogue may hide behind those. `unknown`:
// something is missing that no hypothesis explains down to the noise, or whose place shows that the law found only
// resembles it, or that changes with time; the laws found so far are reported with it.
//
// Cost: one fit and one ranking for each effect, and `shortlist` fits; then about as many for the
// rivals.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "graybox/diagnosis/hypotheses/law_departure.hpp"
#include "graybox/diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

enum class Verdict : std::int8_t { kNone, kExplained, kAmbiguous, kUnknown };
[[nodiscard]] std::string_view to_string(Verdict verdict);

struct SearchOptions {
  double level = 0.05;  // alpha of detection, family-wise
  double verification_level = 0.01;
  double tolerance = 0.05;         // of the noise's variance, in verification
  double noise_floor = 1.1;        // chi-square per degree of freedom of what is predicted
  double exclusion_margin = 10.0;  // of BIC and of the evidence
  std::size_t shortlist = 8;       // refits an effect
  std::size_t effect_limit = 0;    // 0: 4, or 24 where the noise is not known
  double held_out_gain = 0.01;     // logarithmic, of the squared error
  double held_out_errors = 3.0;    // standard errors of that gain
  double generalisation = 1.5;
  double structure_tolerance = 0.1;
  double autocorrelation_tolerance = 10.0;  // % of the signal
  int null_draws = 199;                     // at least 2 / level are taken
  std::vector<std::string> excluded_laws;   // left out of the catalogue
  double variation_level = 1e-5;            // of time variation, family-wise, beside `level`
  double detection_power = 0.9;             // of the smallest detectable effect
  bool ignore_channel_faults = false;
  std::uint64_t seed = 1;
  // Called with what is being done, for progress; may be empty. Return false to stop: the diagnosis
  // then is what has been found so far, marked `interrupted`.
  std::function<bool(const std::string& step)> proceed;
};

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
  // To the best of its class; where the noise is not known, of the prediction of blocks kept out, in
  // squared standard errors, negative where it is better.
  double bic_difference = 0.0;
  std::optional<NextExperiment> next =
      {};                            // that tells it from the law found; of the nearest alone
  double evidence_difference = 0.0;  // to the law found, where the noise is known
  // What recordings kept out add to both; none where there are none or they were not asked.
  std::optional<double> held_out_difference = {};
  // The same law at other places, where it is the same to every experiment of this kind: one explanation.
  std::vector<FittedLaw> same_at = {};
  // Excluded by a few of many recordings (MismatchProblem::fit_to_few): differences are theirs, to the best fit
  // there, and all recordings would give larger ones.
  bool on_few_recordings = false;
  // Excluded before recordings were freed of free motion with the law found: differences are to that, there.
  bool on_other_noise = false;
  // Excluded by recordings kept out, whatever it does on those of the fit.
  bool is_contradicted = false;
};

struct FoundEffect {
  FittedLaw law;
  // Of the excess of chi-square that was there before it, and BIC of the model without it, likewise; NaN
  // where that model could not be fitted.
  double explained_share = std::numeric_limits<double>::quiet_NaN();
  double bic_difference = std::numeric_limits<double>::quiet_NaN();
  std::vector<Rival> rivals;           // not excluded
  std::vector<Rival> generalisations;  // of those, as rich as the data do not ask for; the best few
  std::vector<Rival> excluded;         // the best of those that are, by their distance
  std::vector<FittedLaw> same_at = {};  // as in Rival
};

// Laws that were found at one place for one characteristic.
struct SharedCharacteristic {
  std::string place;
  Characteristic characteristic = Characteristic::kNone;
  std::vector<std::size_t> hypotheses;
};

struct Diagnosis {
  Verdict verdict = Verdict::kUnknown;
  bool noise_is_known = false;
  bool interrupted = false;
  std::string trouble;  // why no fit, if there is none
  std::vector<ChannelFault> channel_faults;
  Detection detection;
  std::vector<FoundEffect> effects;
  ExtendedFit before, after;
  std::optional<Assessment> validation_before, validation_after;
  // After, with what errors of the fitted parameters do counted as noise: what the verdict is verified by.
  std::optional<Assessment> validation_within_errors;
  // Where something changes while it is recorded: the verdict then is `unknown`, whatever laws fit.
  std::optional<TimeVariation> time_variation;
  bool time_variation_was_tested = false;  // else it can't be told from these recordings
  bool verified = false;                   // the rest passed the test of step 6
  // Whether it could be asked if the laws found only resemble what is there; where they do, and no other fit of their
  // classes does not. Then, and where laws share a characteristic, the verdict is `unknown`.
  bool shapes_compared = false;
  std::vector<Departure> departures;
  std::vector<SharedCharacteristic> shared_characteristics;
  // Where the noise is known: recordings kept out are predicted to the noise floor, not only within what the
  // errors of the fitted parameters do there.
  bool predicts = true;
  double rest_p_value = 1.0;
  double fit_p_value = 1.0;    // likewise on the fit's own recordings, with twice the tolerance
  bool rivals_weighed = true;  // false: as many laws as may be leave more than noise
  std::optional<double> remaining_structure, autocorrelated_error;  // where the noise is not known
  std::vector<DetectableEffect> detectable;                         // in the light of the first fit
  std::vector<HypothesisScore> ranking;                             // of the first fit, best first
  std::vector<MismatchCell> mismatch_before, mismatch_after;
  std::vector<ResidualCurve> curves_before, curves_after;
  std::vector<ForcePicture> pictures;  // of the effects, in their order
};

[[nodiscard]] Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options = {});

// What a law gains on blocks kept out in turn: the logarithm of the squared error without it over that
// with it, summed over outputs; mean over blocks and its standard error. Where the noise is not known.
// (By logarithms, one block that the others predict badly does not outweigh all.)
struct HeldOutGain {
  double mean = 0.0;
  double standard_error = 0.0;
};
[[nodiscard]] HeldOutGain held_out_gain(const ExtendedFit& without, const ExtendedFit& with);

// The rest is larger than noise: p-value of chi-square against a noncentrality of tolerance x dof.
[[nodiscard]] double practical_size_p_value(const Assessment& assessment, double tolerance);

}  // namespace graybox
