// MismatchProblem: recordings seen through a model, as the search for missing physics needs them.
// One class a kind of data implements it: periodic recordings in the frequency domain, arbitrary
// signals of lumped models in the time domain, inverse dynamics of rigid robots in large motion.
//
//   const std::unique_ptr<MismatchProblem> problem = ...;
//   const Diagnosis diagnosis = diagnose(*problem);           // diagnosis_search.hpp
//
// A hypothesis is an element that the model may lack: a place and a law. A fit estimates the
// model's own parameters together with the parameters of the laws it is given.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/hypotheses/candidate_place.hpp"
#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/hypotheses/next_experiment.hpp"
#include "diagnosis/hypotheses/score_test.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {

// Ranks of laws that every machine has, the friction of its joints, of which less is asked; and of
// laws that few machines have: they must gain more to be believed.
inline constexpr int kExpectedRank = 0;
inline constexpr int kRareRank = 3;

struct Hypothesis {
  std::string place;     // "joint_2.gearbox", as Location::name
  std::string location;  // the value of `location` in physics.yaml, in YAML's flow style
  std::string law;       // of the catalogue
  // Laws of the catalogue that this one is for some of its parameters (a Coulomb friction for equal
  // levels in both directions). Where such a law explains the data as well, this one is not a
  // rival.
  std::vector<std::string> special_cases;
  // At a combination of places that are hypotheses of their own (sum or difference of two joints):
  // taken only for what those leave.
  bool is_compound = false;
  bool repeatable = false;  // may be found more than once at its place, as harmonics of a ripple
  // Other hypotheses that such recordings can't tell from this one at any parameters, because the
  // model's own take up the difference. Each is `only_named`: never fitted, but named with this
  // one.
  std::vector<std::size_t> twins{};
  bool only_named = false;
  // Two laws of one characteristic at one place are as likely one that the catalogue lacks.
  Characteristic characteristic = Characteristic::kNone;
  // Coordinates on which its force acts, where those are measured one by one: a law elsewhere is no
  // rival. Empty: all.
  std::vector<std::size_t> acts_on{};
  // Laws of a lower rank are taken first, as many as are there: what every machine has before what
  // few have.
  int rank = 0;
};

struct LawParameterEstimate {
  std::string name;
  std::string unit;
  double value = 0.0;
  double standard_error = 0.0;  // NaN where the data do not see it
  // The standard error of a size that recordings tell only for a given scale
  // (LawParameter::is_relative), where that scale stays as it is.
  double conditional_error = std::numeric_limits<double>::quiet_NaN();
  bool sets_scale = false;  // stated, as LawParameter's

  // The one of the two that is known; NaN where neither is.
  [[nodiscard]] double error() const {
    return std::isfinite(standard_error) ? standard_error : conditional_error;
  }
};

// Of a law that was found at a place, its scale stated.
[[nodiscard]] inline LawParameterEstimate estimate_of(const LawParameter& parameter,
                                                      const PlaceUnits& units, double value,
                                                      double error) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  return {parameter.name,
          unit_at(parameter.unit, units),
          value,
          parameter.is_relative ? kUnknown : error,
          parameter.is_relative ? error : kUnknown,
          parameter.sets_scale};
}

struct FittedLaw {
  std::size_t hypothesis = 0;
  std::vector<LawParameterEstimate> parameters;  // in the catalogue's order
  // Where the noise is not known: of the law's amplitudes being zero, with a covariance that allows
  // for residuals that follow each other; chi-square with the law's parameters as degrees of
  // freedom at most.
  double wald_statistic = 0.0;

  [[nodiscard]] std::vector<double> values() const {
    std::vector<double> result;
    for (const LawParameterEstimate& parameter : parameters) result.push_back(parameter.value);
    return result;
  }
};

// How a fitted model does on one set of recordings.
struct Assessment {
  double chi_square = 0.0;
  double degrees_of_freedom = 0.0;
  double nrmse = 0.0;                   // 100 rms(error) / std(signal), %
  double variance_accounted_for = 0.0;  // 100 (1 - var(error) / var(signal)), %

  [[nodiscard]] double chi_square_per_dof() const { return chi_square / degrees_of_freedom; }
};

// Laws are approximations, and what they make of other recordings is an extrapolation: of what
// those kept out say of two laws this share counts. (With all of it a true law with rounder corners
// than the catalogue's was excluded.)
inline constexpr double kHeldOutShare = 0.5;

// Of recordings kept out of a fit.
struct HeldOutPrediction {
  // What the errors of the fitted parameters do to these recordings counted as noise: recordings
  // that see a parameter better than those of the fit do differ by it.
  Assessment within_errors;
  // -2 log of their density given the recordings of the fit, up to a constant that all fits of the
  // problem share; none where the noise is not known.
  std::optional<double> cost;
};

struct ExtendedFit {
  bool usable = false;  // converged
  std::string trouble;  // why not
  // Where it is that laws beside one another became impossible (a friction that drives): which, by
  // their place among those asked for, rising.
  std::vector<std::size_t> impossible;
  std::vector<LawParameterEstimate> model_parameters;
  std::vector<FittedLaw> laws;
  // 1/gain of drives that a law alone tells (a payload beyond joints that bodies do not load), by
  // coordinate; 0: not told. Empty where there are none.
  std::vector<double> inverse_gains;
  double deviance = 0.0;  // -2 log likelihood, up to a constant that all fits of the problem share
  std::size_t parameter_count = 0;
  // What the data say about the laws' parameters: log det(1 + D S D), S their information with the
  // model's own parameters taken out and D their values, as wide as which they were thought before.
  // A parameter that the data do not determine adds nothing.
  double laws_information = 0.0;
  Assessment estimation;
  double seconds_ahead = 0.0;  // of the errors: predictions so far ahead; 0: of whole recordings
  // Where the noise is not known: mean squared errors of contiguous blocks of the recordings
  // (rows), each predicted by the others, in each output (columns).
  Eigen::MatrixXd held_out;
};

// Where a fit by a law of this hypothesis may start.
struct LawStart {
  std::size_t hypothesis = 0;
  std::vector<double> parameters;
  // What the model's own parameters may be with that law, first of them first; those that are left
  // out, or all, start as in the fit nearby.
  std::vector<double> model_parameters{};
  // Other parameters of the law that a fit should start from as well: of a law whose valleys are
  // many.
  std::vector<std::vector<double>> others{};
  // The same where none of these leads to motions that the law allows, one after the other until
  // one does.
  std::vector<std::vector<double>> spares{};

  friend bool operator==(const LawStart&, const LawStart&) = default;
};

// The laws of a fit where it has them.
[[nodiscard]] inline std::vector<LawStart> starts_of(const ExtendedFit& fit) {
  std::vector<LawStart> starts;
  for (const FittedLaw& law : fit.laws) starts.push_back({law.hypothesis, law.values()});
  return starts;
}

// One hypothesis in the light of a fit without it.
struct HypothesisScore {
  LawStart start;                // at the best shape (threshold, exponent, wave length)
  CandidateScore score;          // of that shape
  std::size_t shapes = 1;        // that were tried
  double explained_share = 0.0;  // statistic over the chi-square of the residuals
  // Estimate of the law's leading amplitude, also where it has a sign that the law can't have
  // (`start` is empty then, and the score says nothing), and its unit.
  double amplitude = 0.0;
  double amplitude_deviation =
      0.0;  // standard deviation of the estimate; 0: the fitted parameters imitate it
  std::string amplitude_unit;
};

struct ScoreTable {
  std::vector<HypothesisScore> scores;  // one a hypothesis that was asked for, in that order
  std::vector<double> null_minima;      // least p-value of each draw of pure noise
};

// Normalised residuals by output channel, frequency band and position: what is left after a fit.
struct MismatchCell {
  std::string channel;
  double from = 0.0, to = 0.0;  // Hz; or s where the data have no frequencies
  std::string position;         // of the experiment, in words
  double level = 0.0;
  double statistic = 0.0;  // sum of squares of whitened residuals
  double degrees_of_freedom = 0.0;
  // Those of a chi-square that scatters as much, relative to its mean: fewer where the noise is
  // estimated. 0: the same.
  double effective = 0.0;
};

// Where the noise is not known: what a fit leaves of one channel, to say where a model is wrong.
struct ChannelRest {
  std::string channel;
  double nrmse = 0.0;                 // 100 rms(rest) / std(signal), %
  double structure = 0.0;             // share that depends on the motion, 0 to 1
  double autocorrelated_error = 0.0;  // 100 rms / std(signal) of what follows from its own past, %
  // nrmse on recordings kept out of the fit; none where there are none.
  std::optional<double> held_out_nrmse = {};
  double held_out_signal = 1.0;  // std of the signal there over that of the fit's recordings
  double held_out_level = 1.0;   // rms of the signal there, about zero, over its std
  // The error kept out over that of the fit: in the unit of the channel, or each of its own signal
  // where what is kept out is the larger motion, with which the error of a law grows.
  [[nodiscard]] double growth() const {
    return held_out_nrmse.value_or(0.0) * std::min(held_out_signal, 1.0) / nrmse;
  }
  // How much later than the model says it comes, s (earlier: negative), and the last error with
  // that; none where it comes in time.
  std::optional<double> late_by = {};
  std::optional<double> held_out_nrmse_in_time = {};
};

// A channel of the recordings that was moved in time (MismatchProblem::in_time).
struct MovedChannel {
  std::string channel;
  double seconds = 0.0;  // it came so much later than the model says; earlier: negative
};

// The picture of a law: the force that the data ask for at a place, with its noise, against the
// motion there, sample by sample. Beside it stands what the fitted law gives for the same motion.
// The array `force` is empty where the recordings say too little of it.
struct ForcePicture {
  std::size_t hypothesis = 0;
  std::string deflection_unit, rate_unit, force_unit;
  std::vector<double> deflection, rate, force, law_force;
  // Of the noise in `force`, as the fit states it; 0: not known.
  double force_deviation = 0.0;
};

// What was measured, what the model leaves and the noise in it (rms), along frequency or time, of
// one channel in one experiment.
struct ResidualCurve {
  std::string channel, unit;
  std::string experiment;     // in words: position, level; or the recording
  std::string predicted_how;  // "in free run"
  bool over_time = false;
  bool held_out = false;
  std::vector<double> axis;  // Hz or s
  // The noise may be empty; residuals are NaN where nothing is predicted.
  std::vector<double> measured, residual, noise;
};
// How many recordings of a role a report shows, so many channels each.
[[nodiscard]] inline std::size_t shown_recordings(std::ptrdiff_t channels) {
  constexpr std::ptrdiff_t kMostCurves = 24, kMostRecordings = 8;
  const std::ptrdiff_t recordings = kMostCurves / std::max<std::ptrdiff_t>(1, channels);
  return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(recordings, 1, kMostRecordings));
}

// A coefficient at a place that changes while it is recorded, which no model or law here does.
struct TimeVariation {
  std::string place;
  std::string coefficient;  // "stiffness", "damping", "gain"
  std::string unit;
  double p_value = 1.0;        // of the place found, times the number of all
  double deviation = 0.0;      // rms about its mean in each recording, at least
  double frequency = 0.0;      // Hz, of the largest part of it; once a recording where it is slower
  double duration = 0.0;       // s, of the recording that tells most
  std::vector<double> course;  // there, at equal steps
  std::vector<std::string> alternatives;  // "damping at joint_2.motor": not told apart from it
};

class MismatchProblem {
 public:
  virtual ~MismatchProblem() = default;

  [[nodiscard]] virtual std::span<const Hypothesis> hypotheses() const = 0;
  // Independent real numbers measured: n of the Bayesian information criterion.
  [[nodiscard]] virtual double sample_count() const = 0;
  // Whether the noise is known (from periods, or stated), so that a chi-square can be too large.
  [[nodiscard]] virtual bool noise_is_known() const = 0;

  // Swapped wires, wrong signs and units that the recordings show against the model as it is.
  [[nodiscard]] virtual std::vector<ChannelFault> channel_faults() const { return {}; }
  // What of the recordings was left out, and why: a sentence each.
  [[nodiscard]] virtual std::vector<std::string> remarks() const { return {}; }

  // `nearby`: a fit with some of the same laws to start the model's parameters from.
  [[nodiscard]] virtual ExtendedFit fit(std::span<const LawStart> laws,
                                        const ExtendedFit* nearby) const = 0;
  // The same by a few of many recordings, those that tell most: what is far behind another there is
  // so on all. Its figures are of those recordings. None where all are few, and `has_few` is false.
  [[nodiscard]] virtual bool has_few() const { return false; }
  [[nodiscard]] virtual std::optional<ExtendedFit> fit_to_few(std::span<const LawStart> /*laws*/,
                                                              const ExtendedFit& /*nearby*/) const {
    return {};
  }
  // fit() of each of these.
  [[nodiscard]] virtual std::vector<ExtendedFit> fit_each(
      std::span<const std::vector<LawStart>> laws, const ExtendedFit* nearby) const {
    std::vector<ExtendedFit> fits;
    for (const std::vector<LawStart>& each : laws) fits.push_back(fit(each, nearby));
    return fits;
  }
  // Whether fit_each() uses threads for several fits at once, not within each.
  [[nodiscard]] virtual bool fits_at_once() const { return false; }
  // Whether fit() holds shapes of laws that would answer, a little, to a law that comes or goes
  // elsewhere. With the laws of `nearby` as they are it holds none.
  [[nodiscard]] virtual bool holds_untouched_laws() const { return false; }
  [[nodiscard]] virtual ScoreTable scores(const ExtendedFit& fit,
                                          std::span<const std::size_t> hypotheses, int null_draws,
                                          std::uint64_t seed) const = 0;
  [[nodiscard]] virtual std::vector<MismatchCell> mismatch(const ExtendedFit& fit) const = 0;
  // On recordings kept out of the fit; none if there are none.
  [[nodiscard]] virtual std::optional<Assessment> validate(const ExtendedFit& fit) const = 0;
  // The laws of a fit, fitted to the recordings kept out by themselves; unusable where that is not
  // done, or they don't determine what is fitted.
  [[nodiscard]] virtual ExtendedFit fit_to_kept_out(const ExtendedFit& /*fit*/) const { return {}; }
  // What a fit makes of these recordings with the errors of its parameters; none if there are none.
  [[nodiscard]] virtual std::optional<HeldOutPrediction> predict_held_out(
      const ExtendedFit& fit) const {
    const std::optional<Assessment> assessment = validate(fit);
    if (!assessment) return {};
    return HeldOutPrediction{*assessment, {}};
  }

  // Frees what the model states within its uncertainty, with a prior that is weighed by what this
  // fit leaves; the hypotheses are the same. Null where nothing is uncertain, or all is free
  // already.
  [[nodiscard]] virtual std::unique_ptr<MismatchProblem> with_uncertain_model(
      const ExtendedFit& /*fit*/) const {
    return nullptr;
  }
  // What the model states as certain is freed, as much as a drawing may be off at the worst. Null
  // where nothing is stated.
  [[nodiscard]] virtual std::unique_ptr<MismatchProblem> with_doubted_model(
      const ExtendedFit& /*fit*/) const {
    return nullptr;
  }
  // Where what the model states is free: what of it a fit finds otherwise, in words.
  [[nodiscard]] virtual std::vector<std::string> departures_from_stated(
      const ExtendedFit& /*fit*/) const {
    return {};
  }

  // The place where something changes with time beside what the fit describes, if anything does:
  // whether it does is for the caller to judge by the p-value. `gain`: what the fit's laws lower
  // the deviance by. None where it can't be told, from what these laws may make of the plant's free
  // motion either.
  [[nodiscard]] virtual std::optional<TimeVariation> time_variation(const ExtendedFit& /*fit*/,
                                                                    double /*gain*/) const {
    return {};
  }

  // Where the noise is not known: how each law of the fit changes with time, place or speed, in
  // their order. None where that can't be told.
  [[nodiscard]] virtual std::vector<LawTrend> trends(const ExtendedFit& /*fit*/) const {
    return {};
  }

  // Where the noise is not known, channel by channel on the recordings of the fit.
  [[nodiscard]] virtual std::vector<ChannelRest> channel_rests(const ExtendedFit& /*fit*/) const {
    return {};
  }

  // Sets ChannelRest::late_by of these, the rests of the last fit, where a channel comes late.
  virtual void find_late_channels(const ExtendedFit& /*fit*/,
                                  std::vector<ChannelRest>& /*channels*/) const {}

  // Moves channels that come so late to this fit that laws would stand in for that: the same
  // problem with the same hypotheses. Null where no channel does.
  [[nodiscard]] virtual std::unique_ptr<MismatchProblem> in_time(const ExtendedFit& /*fit*/) const {
    return nullptr;
  }
  // The channels that were moved, with the whole time of each.
  [[nodiscard]] virtual std::vector<MovedChannel> moved_channels() const { return {}; }

  // Where the noise is not known: the share of what a fit leaves that still depends on the motion,
  // 0 to 1.
  [[nodiscard]] virtual std::optional<double> remaining_structure(
      const ExtendedFit& /*fit*/) const {
    return {};
  }
  // Likewise: 100 rms / std(signal), in %, of the part of what a fit leaves that its own past
  // predicts. A disturbance with memory has such a part, and physics that is missing; noise of
  // sensors has little.
  [[nodiscard]] virtual std::optional<double> autocorrelated_error(
      const ExtendedFit& /*fit*/) const {
    return {};
  }

  // The same problem, its recordings freed of what this fit can tell apart from what is measured
  // and an earlier one could not (free motion); the hypotheses are the same. Null where that
  // changes nothing, or leaves more that passes for noise.
  [[nodiscard]] virtual std::unique_ptr<MismatchProblem> renewed(const ExtendedFit& /*fit*/) const {
    return nullptr;
  }

  // What further experiments would tell of two fits; none where that can't be said.
  [[nodiscard]] virtual std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& /*a*/, const ExtendedFit& /*b*/) const {
    return {};
  }

  // For the report; empty where there is nothing to show. One picture a law of the fit, in its
  // order.
  [[nodiscard]] virtual std::vector<ForcePicture> force_pictures(const ExtendedFit& /*fit*/) const {
    return {};
  }
  // A few of each kind: the worst channels first.
  [[nodiscard]] virtual std::vector<ResidualCurve> residual_curves(
      const ExtendedFit& /*fit*/) const {
    return {};
  }
};

}  // namespace graybox
