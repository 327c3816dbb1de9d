// The search for missing physics: is something missing, where, which law, and is that all?
//
//   0. Look for swapped wires, wrong signs and units (channel_faults.hpp, wiring_faults.hpp). Where
//      there are any the search ends, verdict unknown, for what it would find is no physics.
//   1. Fit the model as it is.
//   2. Detect, at family-wise level alpha: the chi-square of the residuals (alpha/2) or the
//      smallest p-value of all hypotheses' score tests against its own distribution under pure
//      noise (alpha/2). Where the noise is not known, the first is replaced by what of the
//      residuals is clearly none (step 6). Where something is detected and the noise is known, the
//      model alone is fitted again from where refits with a law have led: a fit that stopped short
//      of its optimum looks like missing physics. Not where a law leaves no more than noise, and
//      from there the model alone comes nowhere near.
//   3. While something is missing: rank all hypotheses by their score tests, refit with each of the
//      best, keep the one with the least Bayesian information criterion
//          BIC = deviance + parameters ln n,
//      if its deviance falls by more than the family-wise chi-square threshold and, beside other
//      laws, BIC by more than `exclusion_margin`. Where recordings are many, the best are fitted to
//      the few that tell most first (MismatchProblem::fit_to_few), and only those that are not far
//      behind there to all. Where the noise is not known, it may have any memory, and n is not
//      known either. There a law must be significant by a Wald test that allows for memory, and
//      must predict: with contiguous blocks of the recordings kept out in turn, the squared error
//      falls by `held_out_gain` at least and by `held_out_errors` standard errors over the blocks,
//      of the friction that every joint has by two. There a robot with several joints begins with
//      all plain laws at once (plain_laws.hpp), and again with what the model states free, where
//      it says how uncertain that is. A place has one dry friction: another may come in its stead.
//      Where none does, up to four laws are taken together, each the one that predicts best beside
//      those before, if beside the others each passes the same tests: one of several harmonics of a
//      ripple drowns in the others. Laws of a lower rank (Hypothesis::rank) are taken first, as
//      many as there are: on a machine viscous and Coulomb friction at every joint, then loads,
//      then offsets and coupled joints, then the rest, of which each must gain more
//      (SearchOptions::rare_gain). Compound places (Hypothesis::is_compound) come when single ones
//      explain no more: main effects before interactions. The law that predicts best is kept, or
//      one of fewer parameters that is not worse by more than one standard error. Where the noise
//      is known, and what is left is no more than noise by its chi-square, one law more is tried if
//      the best hypothesis lies at a place without a law and is significant by itself; it stays if
//      BIC falls by `exclusion_margin` and by a thousandth of what the others explain. A law by
//      which chi-square on recordings kept out is a hundred times that of the fit gives way to
//      another by which it is a tenth, and is no rival of such. Where it is known and the best law,
//      of m that may still come, explains less than half an m-th of what is too much, the search
//      gives up: such laws only stand in for one that is not there. Where only a fit with laws
//      comes near enough to free the recordings of the plant's free motion, that is done with it
//      before another is looked for. Laws then far behind it are not fitted again.
//   4. Prune backwards: laws without which BIC is not higher by more than `exclusion_margin` go (or
//      those that do not predict, as in step 3), for the model without a law is a rival of the one
//      with it, and laws that only generalise another of fewer parameters give way to it unless
//      they are better by `exclusion_margin` (predict better; by as much as a law that comes in,
//      where they have sizes that the recordings do not determine). Where the noise is not known,
//      laws for which another predicts better now are exchanged, and steps 3 and 4 repeated.
//   5. Rivals: for each law that stayed, the alternatives in its stead. Those that are not worse by
//      `exclusion_margin` (10: "very strong", Kass and Raftery 1995), or than which the law does
//      not predict better, can't be excluded and form one class with it. Worse in both, BIC and
//          evidence = deviance + log det(1 + D S D)     (ExtendedFit::laws_information),
//      twice the negative logarithm of Laplace's approximation to the evidence for law parameters
//      as wide before as their values: BIC charges ln n for a parameter also where the data say
//      nothing about it, so that a small effect would exclude all laws of many parameters. Where
//      they do not decide by far (ten times the margin) half of what recordings kept out say is
//      added to both (HeldOutPrediction::cost). A law that generalises another that stands is at
//      least as good always: a rival where the noise is known and its evidence is better by 2, else
//      no rival: the best of them are named beside the class (`generalisations`), where it has
//      fewer than three names. Twins (mismatch_problem.hpp) are rivals always, unless they
//      generalise the law: then they are the first to be named beside it. Members of a class with
//      one law at several places that no experiment of this kind would tell apart (a delay of the
//      only actuator or of the only sensor of a linear system) are one explanation: `same_at`.
//      Where the noise is known and a law is excluded by its rival, or one of several laws has a
//      rival of lower BIC, that takes its place and all are weighed again. Where the search has as
//      many laws as may be and the rest is no noise, rivals are not weighed. Then recordings kept
//      out are asked about each law: what raises their error goes, and, where the noise is not
//      known, what has a size that its error does not tell from zero (law_rejection.hpp). All laws
//      go where the error still is as large as the signal.
//      Where the noise is not known, and a force then comes so late that this takes a good part of
//      the error kept out, laws are sought once more with the force moved (late_channels.hpp).
//   6. Verify on recordings kept out of the fit, or on the fit's own where there are none: the rest
//      must not be larger than noise by more than `tolerance` of its variance (a test of practical
//      size: chi-square against the non-central distribution with noncentrality tolerance x degrees
//      of freedom). (That step 5 asked them too favours the law by some 10 of chi-square in
//      thousands.) On the fit's own recordings the same must hold with twice the tolerance: those
//      kept out may not excite what is missing. Where the noise is not known there is no such test;
//      then the error on recordings kept out must not be more than `generalisation` times that of
//      the fit, no more than `structure_tolerance` of the rest may still depend on the motion
//      (MismatchProblem::remaining_structure) unless that is less than `structure_error` of the
//      signal, and what of the rest follows from its own past may
//      be no more than `autocorrelation_tolerance` of the signal
//      (MismatchProblem::autocorrelated_error).
//
//      Where the noise is known, and what is left is no more than it: is it these laws, or others
//      like them? What they leave at their places (law_departure.hpp, at `verification_level`);
//      nothing, if a fit with one of their rivals or generalisations leaves nothing. Two laws for
//      one characteristic (Hypothesis::characteristic) are as likely one that the catalogue lacks.
//      Before that is said, all laws that can be fitted there are weighed as rivals, and a law of
//      another characteristic is taken besides, if it stands out and both leave nothing.
//
//      Last, where the problem can tell: does something change while it is recorded
//      (MismatchProblem::time_variation)? By a test of its own at `variation_level`, because no law
//      describes it.
//
//   7. Next: for the nearest rival of each law, the experiment that tells the two apart
//      (next_experiment.hpp).
//
//   8. Judge whether the final model is one that a machine can have (plausibility.hpp), and compute
//      the verdict from the list of all tests (verdict_reasons.hpp).
//
// The verdict is one of four. With `none` nothing was detected. With `explained` there is one law a
// class, and the rest is noise. With `ambiguous` the rest is noise, but one of three things holds.
// A class has several members, or one law has several places. Or recordings kept out are more than
// noise (`noise_floor`) and only within the errors of the fitted parameters: a law that is not in
// the catalogue may hide behind those. With `unknown` something is missing that no hypothesis
// explains down to the noise. It is also `unknown` where its place shows that the law found only
// resembles it, or where it changes with time. The laws found so far are reported with it.
//
// Cost: one fit and one ranking for each effect, and `shortlist` fits; then about as many for the
// rivals.
#pragma once

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/search_options.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

[[nodiscard]] Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options = {});

}  // namespace graybox
