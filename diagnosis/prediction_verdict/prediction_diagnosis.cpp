#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/final_fit/final_fit.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/prediction_error/latent_pictures.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"
#include "diagnosis/prediction_error/reversed_outputs.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/prediction_verdict/confounded_sizes.hpp"
#include "diagnosis/prediction_verdict/prediction_effects.hpp"
#include "diagnosis/prediction_verdict/prediction_reasons.hpp"
#include "diagnosis/predictor/drive_hold.hpp"
#include "diagnosis/predictor/standing_mass.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kVanished = 1e-6;  // of a parameter's scale: as good as zero
// The final fit takes all samples where thinning would drop anything that matters.
constexpr SampleLimit kSearched{.most = 8000, .dropped = 0.3, .may_cut = true};
constexpr SampleLimit kFitted{.most = 8000, .dropped = 0.1, .may_cut = false};

Assessment assessment(const VectorXd& error, const VectorXd& scale, const VectorXd& noise,
                      double samples) {
  Assessment result;
  result.degrees_of_freedom = samples * static_cast<double>(error.size());
  result.chi_square = samples * (error.array() / noise.array()).square().sum();
  result.nrmse = 100.0 * relative_size(error, scale);
  result.variance_accounted_for = 100.0 * (1.0 - (error.array() / scale.array()).square().mean());
  return result;
}

bool is_velocity(const std::string& unit) { return unit == "m/s" || unit == "rad/s"; }

class DiagnosisBuilder {
 public:
  explicit DiagnosisBuilder(const PredictionOutcome& outcome) : from_(outcome) {}

  [[nodiscard]] Diagnosis build() {
    result_.before = extended_fit(from_.final->as_given());
    result_.after = extended_fit(from_.final->found());
    result_.validation_before = held_out(from_.final->as_given());
    result_.validation_after = held_out(from_.final->found());
    result_.kept_out_change = change_of_kept_out();
    if (result_.kept_out_change) widen_errors(*result_.kept_out_change, result_.after);
    motion_ = from_.final->motion();
    const PredictionEffects effects(from_);
    result_.effects = effects.of(result_.after.laws);
    add_channels();
    add_ranking();
    result_.curves_before = from_.final->curves(from_.final->as_given());
    result_.curves_after = from_.final->curves(from_.final->found());
    if (const LatentForce* force = from_.final->rest().force()) {
      result_.pictures = latent_pictures(from_.final->found().fit.model, *force);
    }
    const PredictionReasons reasons(from_);
    result_.detection.detected = !result_.effects.empty() || !reasons.is_disturbance();
    result_.may_be_disturbed =
        result_.effects.empty() && reasons.leaves_force() && reasons.is_without_structure();
    result_.checked = checked();
    const FittedPhysics physics =
        fit_physics(from_.hypotheses->hypotheses(), context(), result_.after);
    add_speeds(physics, result_.checked);
    add_standing(result_.checked);
    add_holding_friction(from_.hypotheses->hypotheses(), result_);
    result_.implausible = implausibilities(physics);
    result_.interrupted = from_.findings->stopped;
    if (!result_.effects.empty()) result_.trends = from_.final->trends();
    result_.reasons = reasons.of(result_);
    result_.verdict = verdict_of(result_.reasons);
    result_.verified =
        std::ranges::none_of(result_.reasons, [](const VerdictReason& r) { return has_failed(r); });
    return std::move(result_);
  }

 private:
  [[nodiscard]] double samples() const {
    double count = 0.0;
    for (const OutputErrorRecording& recording : from_.data->recordings()) {
      if (recording.role == ExperimentRole::kEstimation) {
        count += static_cast<double>(recording.time.size());
      }
    }
    return count;
  }

  [[nodiscard]] ExtendedFit extended_fit(const JudgedModel& judged) const {
    ExtendedFit fit;
    fit.usable = judged.fit.usable;
    if (!fit.usable) {
      fit.trouble = "its simulation leaves all bounds";
      return fit;
    }
    fit.trouble = judged.held_out_trouble;
    fit.seconds_ahead = from_.data->sample_time() * static_cast<double>(judged.horizon);
    const ExtendedLumpedModel& model = judged.fit.model;
    for (std::size_t i = 0; i < judged.fit.free.size(); ++i) {
      const std::size_t index = judged.fit.free[i];
      if (index >= model.own_parameters()) continue;
      const LumpedParameter& parameter = model.model.parameters[index];
      fit.model_parameters.push_back(
          {parameter.name, parameter.unit, parameter.value,
           judged.deviations.size() > 0 ? judged.deviations(static_cast<Index>(i)) : kNaN});
    }
    const JudgedModel* with_errors = judged.deviations.size() > 0 ? &judged : nullptr;
    for (const PlacedFinding& law : model.laws) {
      fit.laws.push_back(fitted_law(model, law, with_errors));
    }
    fit.deviance = samples() * (judged.error.array() / from_.data->noise().array()).square().sum();
    fit.parameter_count = judged.fit.free.size();
    fit.estimation =
        assessment(judged.error, from_.data->output_scale(), from_.data->noise(), samples());
    return fit;
  }

  [[nodiscard]] std::optional<KeptOutChange> change_of_kept_out() const {
    if (!result_.validation_after) return {};
    const JudgedModel own = from_.final->fitted_to_kept_out();
    if (!own.fit.usable) return {};
    return kept_out_change(result_.after, result_.validation_after->nrmse, extended_fit(own),
                           100.0 * relative_size(own.error, from_.final->found().held_out_scale));
  }

  [[nodiscard]] std::optional<Assessment> held_out(const JudgedModel& judged) const {
    if (!judged.held_out_error) return {};
    return assessment(*judged.held_out_error, judged.held_out_scale, from_.data->noise(), 1.0);
  }

  [[nodiscard]] std::vector<ChannelRest> channel_rests(const JudgedModel& judged) const {
    std::vector<ChannelRest> rests;
    if (!judged.fit.usable) return rests;
    const Index outputs = from_.data->output_count();
    const Eigen::Map<const MatrixXd> table(judged.fit.residuals.data(), outputs,
                                           judged.fit.residuals.size() / outputs);
    for (Index j = 0; j < outputs; ++j) {
      ChannelRest rest;
      rest.channel = from_.stated->output_names[static_cast<std::size_t>(j)];
      rest.nrmse = 100.0 * judged.error(j) / from_.data->output_scale()(j);
      const VectorXd e = table.row(j).transpose();
      const Index n = e.size() - 1;
      const double memory = e.head(n).dot(e.tail(n)) / std::max(e.squaredNorm(), 1e-300);
      rest.autocorrelated_error = rest.nrmse * std::clamp(memory, 0.0, 1.0);
      rests.push_back(std::move(rest));
    }
    return rests;
  }

  void add_channels() {
    result_.channels_before = channel_rests(from_.final->as_given());
    result_.channels_after = channel_rests(from_.final->found());
  }

  void add_ranking() {
    for (const ExtensionScore& score : from_.findings->ranking) {
      const LawExtension& law = from_.findings->ranked[score.extension];
      const bool is_known = std::ranges::any_of(result_.ranking, [&](const HypothesisScore& other) {
        return other.start.hypothesis == law.hypothesis;
      });
      if (is_known) continue;
      HypothesisScore entry;
      entry.start.hypothesis = law.hypothesis;
      entry.explained_share = score.share;
      entry.amplitude = score.amplitude;
      entry.amplitude_deviation = score.deviation;
      result_.ranking.push_back(std::move(entry));
    }
  }

  // The speeds at which the laws found acted, as the fitted model has them.
  static void add_speeds(const FittedPhysics& physics, CheckedRange& range) {
    for (const PhysicalQuantity& quantity : physics.quantities) {
      const bool is_force = quantity.unit == "N m" || quantity.unit == "N";
      if (!is_force || quantity.law >= physics.laws.size()) continue;
      const LawTrace& trace = physics.laws[quantity.law];
      const std::string name = "velocity of " + trace.place.substr(0, trace.place.find('.'));
      if (trace.rate.empty() ||
          std::ranges::count(range.recorded, name, &CheckedRange::Span::quantity) > 0) {
        continue;
      }
      const auto [slowest, fastest] = std::ranges::minmax(trace.rate);
      const Eigen::Map<const VectorXd> rate(trace.rate.data(),
                                            static_cast<Index>(trace.rate.size()));
      range.recorded.push_back({name, quantity.unit == "N" ? "m/s" : "rad/s", slowest, fastest,
                                slowest_lasting_speed(rate, 1)});
    }
  }

  void add_standing(CheckedRange& range) const {
    if (from_.hypotheses->held_at_standstill() == 0.0) return;
    const StandingDrive drive = standing_drive_of_mass(*from_.stated, *from_.data);
    range.standing = {from_.stated->mass_names.front(), from_.stated->input_units.front(), drive,
                      kNaN};
  }

  [[nodiscard]] CheckedRange checked() const {
    CheckedRange range;
    range.kept_out = from_.data->has_validation();
    const auto role = range.kept_out ? ExperimentRole::kValidation : ExperimentRole::kEstimation;
    for (const OutputErrorRecording& recording : from_.data->recordings()) {
      if (recording.role != role) continue;
      if (std::ranges::count(range.files, recording.name) == 0)
        range.files.push_back(recording.name);
      for (Index j = 0; j < recording.outputs.cols(); ++j) {
        const auto at = static_cast<std::size_t>(j);
        const double low = recording.outputs.col(j).minCoeff();
        const double high = recording.outputs.col(j).maxCoeff();
        if (range.spans.size() <= at) {
          range.spans.push_back(
              {from_.stated->output_names[at], from_.stated->output_units[at], low, high});
        }
        range.spans[at].from = std::min(range.spans[at].from, low);
        range.spans[at].to = std::max(range.spans[at].to, high);
      }
    }
    return range;
  }

  [[nodiscard]] PhysicalContext context() const {
    PhysicalContext context;
    const JudgedModel& found = from_.final->found();
    for (const std::size_t index : found.fit.free) {
      if (index >= found.fit.model.own_parameters()) continue;
      context.starts.push_back(start_of(index, found.fit.model.model.parameters[index].value));
      const ParameterSpace& space = found.fit.model.space[index];
      // The others may become zero. A velocity at a bound is one that the motion does not show.
      const bool has_bounds =
          space.logarithmic && !is_velocity(from_.stated->parameters[index].unit);
      const bool has_lowest = has_bounds && space.low > kVanished * space.scale;
      context.lowest.push_back(has_lowest ? space.low : PhysicalQuantity::kNone);
      context.highest.push_back(has_bounds ? space.high : PhysicalQuantity::kNone);
    }
    for (const PlacedFinding& law : found.fit.model.laws) {
      context.laws.push_back(context_of(found.fit.model.model, law.part));
    }
    return context;
  }

  // As stated or as fitted without laws, whichever is nearer: what is stated may be a guess, and
  // what is fitted stands in for laws.
  [[nodiscard]] double start_of(std::size_t parameter, double value) const {
    const double stated = from_.stated->parameters[parameter].value;
    const double fitted = from_.findings->as_given.model.parameters[parameter].value;
    const auto distance = [&](double start) {
      return start * value > 0.0 ? std::abs(std::log(start / value))
                                 : std::numeric_limits<double>::infinity();
    };
    return distance(stated) < distance(fitted) ? stated : fitted;
  }

  [[nodiscard]] PhysicalContext::OfLaw context_of(const LumpedModel& model,
                                                  std::size_t part) const {
    PhysicalContext::OfLaw own{0.0, 0.0, 0.0, {}};
    const Element& law = model.parts[part];
    if (law.location.kind != LocationKind::kElement) return own;
    own.trace.carried = from_.data->largest_force();
    for (std::size_t i = 0; i < model.parts.size(); ++i) {
      const Element& other = model.parts[i];
      if (i == part || other.location.kind != LocationKind::kElement ||
          other.location.output != law.location.output) {
        continue;
      }
      if (other.law_name == "stiffness") own.stiffness += other.parameters[0];
      if (other.law_name == "viscous") own.damping += other.parameters[0];
    }
    if (!law.law || law.law->state_count() > 0 || law.location.driver >= 0) return own;
    const Index m = motion_.cols() / 2;
    const VectorXd z = motion_.leftCols(m) * law.location.input;
    const VectorXd rate = motion_.rightCols(m) * law.location.input;
    own.trace.deflection.assign(z.data(), z.data() + z.size());
    own.trace.rate.assign(rate.data(), rate.data() + rate.size());
    for (Index k = 0; k < z.size(); ++k) {
      own.trace.force.push_back(law.law->force(z(k), rate(k), {}));
    }
    return own;
  }

  PredictionOutcome from_;
  MatrixXd motion_;
  Diagnosis result_;
};

// Where no force acts, motion tells forces relative to masses alone: one mass is held at what is
// stated. The sentence that says so, or nothing.
std::string hold_scale(const PredictionData& data, LumpedModel& model) {
  const auto tells_scale = [](const LumpedParameter& parameter) {
    return parameter.unit.starts_with("kg") || parameter.unit.starts_with('N');
  };
  const bool is_told = std::ranges::any_of(model.parameters, [&](const LumpedParameter& parameter) {
    return parameter.fixed && tells_scale(parameter);
  });
  if (!data.moves_freely()) return {};
  const auto held = std::ranges::find_if(model.parameters, [](const LumpedParameter& parameter) {
    return parameter.fixed && parameter.unit.starts_with("kg");
  });
  if (held != model.parameters.end()) {
    return fmt::format(
        "No force acts in these recordings, so forces are known relative to {}, which is stated: "
        "{:.4g} {}.",
        held->name, held->value, held->unit);
  }
  if (is_told) return {};
  for (LumpedParameter& parameter : model.parameters) {
    if (!parameter.unit.starts_with("kg") || !(parameter.value > 0.0)) continue;
    parameter.fixed = true;
    return fmt::format(
        "No force acts in these recordings, so masses and forces are known relative to each other: "
        "{} was held at {:.4g} {}, as stated.",
        parameter.name, parameter.value, parameter.unit);
  }
  return {};
}

// What the fit moved far from what the model states, in a sentence; or nothing. A damping may
// vanish: it often stands in for friction that was found.
std::string moved_words(const LumpedModel& stated,
                        const std::vector<LawParameterEstimate>& fitted) {
  constexpr double kFar = 10.0;      // times
  constexpr double kErrors = 2.0;    // within them nothing moved
  constexpr double kNothing = 1e-3;  // of its error
  std::string words;
  for (const LumpedParameter& parameter : stated.parameters) {
    const auto estimate = std::ranges::find(fitted, parameter.name, &LawParameterEstimate::name);
    if (parameter.fixed || !(parameter.value > 0.0) || estimate == fitted.end()) continue;
    const double ratio = estimate->value / parameter.value;
    const bool may_vanish = parameter.range == ParameterRange::kNonNegative;
    if (ratio < kFar && (may_vanish || ratio > 1.0 / kFar)) continue;
    const double error = estimate->standard_error;
    if (std::abs(estimate->value - parameter.value) < kErrors * error) continue;
    // A damping of 3e-9 ± 0.5 is none.
    const double value = std::abs(estimate->value) < kNothing * error ? 0.0 : estimate->value;
    words += fmt::format("{}{} from {:.3g} to {:.3g}{} {}", words.empty() ? "" : "; ",
                         parameter.name, parameter.value, value,
                         error > 0.0 ? fmt::format(" ± {:.2g}", error) : "", parameter.unit);
  }
  if (words.empty()) return words;
  return "The fit moved far from what the model states: " + words +
         ". If that was measured, look at units and gains; if it was a guess, it was a poor one.";
}

// A plant that does not forget is searched over windows only.
void require_windows(const LumpedModel& model, const PredictionData& data,
                     const Campaign& campaign) {
  const double duration = data.sample_time() * static_cast<double>(data.shortest());
  const Index windows = data.window_count(kShortestHorizon);
  if (forgets(model, duration) || windows >= kFewestHorizonWindows) return;
  throw InputError(fmt::format(
      "{}: experiments: a diagnosis by prediction error needs {} windows of {} samples, and these "
      "recordings have {}: add longer ones",
      campaign.file.string(), kFewestHorizonWindows, kShortestHorizon, windows));
}

// Laws that another search found, and what comes of them.
struct OtherLook {
  std::unique_ptr<PredictionFindings> findings;  // that the final fit refers to
  std::unique_ptr<FinalFit> final;
  bool is_confirmed = true;  // by recordings kept out; else it is told and not taken
};

// One sample ahead, beside a disturbance, where the ladder ends without laws. A look that is
// stopped makes it one that was stopped.
std::optional<OtherLook> look_nearer(const LumpedModel& stated, const PredictionData& data,
                                     const PredictionHypotheses& hypotheses,
                                     PredictionSearchOptions options, PredictionFindings& ladder,
                                     const FinalFit& without) {
  const JudgedModel& found = without.found();
  if (!found.fit.usable || !found.fit.model.laws.empty() || ladder.stopped) return {};
  options.least_gain = options.least_gain_rare = options.least_gain_near_noise = kInnovationGain;
  options.least_gain_of_rounding = 0.0;
  options.errors_of_gain = kInnovationErrors;
  options.least_evidence = kInnovationEvidence;
  PredictionSearch search(data, hypotheses, options);
  auto findings = std::make_unique<PredictionFindings>(
      search.search_innovations(stated, ladder, found.fit.model));
  ladder.stopped = findings->stopped;
  if (findings->laws.empty()) return {};
  OtherLook look;
  look.findings = std::move(findings);
  look.final = std::make_unique<FinalFit>(data, hypotheses, *look.findings, options.threads);
  if (!look.final->found().fit.usable || look.final->found().fit.model.laws.empty()) return {};
  return look;
}

// Where nothing was kept out: whether forces that many machines have foretell the whole recordings
// very well, each with its part in that, and the model as given does not. Rare laws must leave next
// to nothing.
bool is_plainly_better(const FinalFit& final, const PredictionHypotheses& hypotheses,
                       const PredictionData& data) {
  constexpr double kVeryWell = 0.15;          // of the signal
  constexpr double kNearlyAll = 0.05;         // of the signal
  constexpr double kHalf = 0.5, kPart = 0.7;  // of the error
  constexpr double kQuarter = 0.25;           // of it
  const JudgedModel& found = final.found();
  const double left = relative_size(found.error, data.output_scale()),
               before = relative_size(final.as_given().error, data.output_scale());
  if (found.horizon != 0 || left > kVeryWell || left > kHalf * before) return false;
  const bool is_nearly_all = left < kNearlyAll && left < kQuarter * before;
  for (std::size_t l = 0; l < found.fit.model.laws.size(); ++l) {
    if (!is_nearly_all && !hypotheses.is_plain(found.fit.model.laws[l].hypothesis)) return false;
    const JudgedModel without = final.without(l);
    if (without.fit.usable && left > kPart * relative_size(without.error, data.output_scale()))
      return false;
  }
  return true;
}

// Whether recordings kept out are foretold well, twice as well as by the model as given, and each
// law has its part in that.
bool is_confirmed(const FinalFit& final) {
  constexpr double kWell = 0.15;              // of the signal
  constexpr double kHalf = 0.5, kPart = 0.9;  // of the error
  const JudgedModel &found = final.found(), &given = final.as_given();
  if (found.horizon != 0 || !found.held_out_error || !given.held_out_error) return false;
  const VectorXd& scale = found.held_out_scale;
  const double left = relative_size(*found.held_out_error, scale);
  if (left > kWell || left > kHalf * relative_size(*given.held_out_error, scale)) return false;
  if (relative_size(found.error, scale) > kHalf * relative_size(given.error, scale)) return false;
  for (std::size_t l = 0; l < found.fit.model.laws.size(); ++l) {
    const JudgedModel without = final.without(l);
    const auto error = final.law_held_out(without), with = final.law_held_out(found);
    if (!error || !with) return false;
    if (relative_size(with->error, scale) > kPart * relative_size(error->error, scale))
      return false;
  }
  return true;
}

// What is left of recordings kept out, of their signal; infinite where nothing could be judged.
double kept_out_of(const JudgedModel& model) {
  if (!model.held_out_error) return std::numeric_limits<double>::infinity();
  return relative_size(*model.held_out_error, model.held_out_scale);
}

// Whether whole recordings kept out are foretold with laws, and not well.
bool leaves_much_kept_out(const JudgedModel& found) {
  constexpr double kMuch = 0.05;  // of the signal
  return found.horizon == 0 && found.held_out_error && kept_out_of(found) > kMuch;
}

// What is left of the recordings by which laws are judged, of their signal.
double left_by(const JudgedModel& model, const PredictionData& data) {
  return data.has_validation() ? kept_out_of(model)
                               : relative_size(model.error, data.output_scale());
}

// A search over whole recordings from this model, and whether recordings kept out confirm what is
// found.
std::optional<OtherLook> look_from(const ExtendedLumpedModel& start, const LumpedModel& stated,
                                   const PredictionData& data,
                                   const PredictionHypotheses& hypotheses,
                                   const PredictionSearchOptions& options,
                                   PredictionFindings& ladder, const JudgedModel& found) {
  constexpr double kHalf = 0.5;
  const std::size_t laws = found.fit.model.laws.size();
  PredictionSearch search(data, hypotheses, options);
  OtherLook look;
  look.findings = std::make_unique<PredictionFindings>(search.search_whole(stated, ladder, start));
  ladder.stopped = look.findings->stopped;
  if (look.findings->laws.empty() || ladder.stopped) return {};
  look.final = std::make_unique<FinalFit>(data, hypotheses, *look.findings, options.threads);
  const JudgedModel& farther = look.final->found();
  if (!farther.fit.usable || farther.fit.model.laws.size() <= laws) return {};
  const bool holds = data.has_validation() ? is_confirmed(*look.final)
                                           : is_plainly_better(*look.final, hypotheses, data);
  look.is_confirmed = holds && (laws == 0 || left_by(farther, data) < kHalf * left_by(found, data));
  return look;
}

// Whole recordings in free run, where neither the ladder nor a look one sample ahead finds a law,
// or where its laws leave much of recordings kept out: short windows show no friction beside a
// weight, and take it for damping.
std::optional<OtherLook> look_farther(const LumpedModel& stated, const PredictionData& data,
                                      const PredictionHypotheses& hypotheses,
                                      const PredictionSearchOptions& options,
                                      PredictionFindings& ladder, const FinalFit& without) {
  const JudgedModel& found = without.found();
  const std::size_t laws = found.fit.model.laws.size();
  if (!found.fit.usable || ladder.stopped || ladder.has_free_run) return {};
  const bool must_be_short = laws > 0 || !data.has_validation();  // else it has windows enough
  if (must_be_short && !is_short(data)) return {};
  if (laws > 0 && !leaves_much_kept_out(found)) return {};
  return look_from(found.fit.model, stated, data, hypotheses, options, ladder, found);
}

// Laws that whole recordings of the fit ask for, and those kept out do not confirm.
void tell_unconfirmed(const OtherLook& look, const FinalFit& taken, const PredictionData& data,
                      Diagnosis& diagnosis) {
  constexpr double kAsked = 0.5;  // of the error of the fit
  const JudgedModel &with = look.final->found(), &without = taken.found();
  const VectorXd& scale = data.output_scale();
  const double left = relative_size(with.error, scale),
               before = relative_size(look.final->as_given().error, scale);
  if (with.horizon != 0 || !(left < kAsked * before)) return;
  std::optional<HeldOutEffect> held_out;
  if (with.held_out_error && without.held_out_error && without.horizon == 0) {
    held_out = HeldOutEffect{100.0 * kept_out_of(without), 100.0 * kept_out_of(with)};
    held_out->gain = 1.0 - std::pow(held_out->error_with / held_out->error_without, 2);
    held_out->misleads = held_out->gain < 0.0;
  }
  const char* const verdict = !data.has_validation() ? "none were kept out to confirm it"
                              : held_out && held_out->gain > 0.0
                                  ? "those kept out gain too little by it to confirm it"
                                  : "those kept out do not confirm it";
  for (const PlacedFinding& law : with.fit.model.laws) {
    if (std::ranges::count(without.fit.model.laws, law.hypothesis, &PlacedFinding::hypothesis) > 0)
      continue;
    diagnosis.rejected.push_back(
        {fitted_law(with.fit.model, law, &with),
         fmt::format("whole recordings of the fit ask for it (error from {:.3g} to {:.3g} %), and "
                     "{}",
                     100.0 * before, 100.0 * left, verdict),
         held_out});
  }
}

Diagnosis without_fit(const PredictionFindings& findings, const SearchOptions& options) {
  Diagnosis diagnosis;
  diagnosis.interrupted = findings.stopped;
  if (!findings.stopped) {
    diagnosis.trouble =
        "the model as it is can't be fitted: with the stated values its simulation grows without "
        "bound";
  }
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  return diagnosis;
}

// Laws that make up for a drive that is early or late.
ExtendedLumpedModel without_fillers(ExtendedLumpedModel model) {
  constexpr std::array kFillers{"mode", "resonance", "lag", "delay"};
  for (std::size_t l = 0; l < model.laws.size();) {
    const std::size_t part = model.laws[l].part;
    const bool fills = std::ranges::count(kFillers, model.model.parts[part].law_name) > 0;
    if (fills) model = without_part(model, part);
    l = fills ? 0 : l + 1;
  }
  return model;
}

// Both holds compared, for a drive that is said to be held; none where going evenly from sample to
// sample does not foretell the motion better.
std::optional<HoldComparison> better_held(const LumpedModel& stated, const PredictionData& data,
                                          const Campaign& campaign,
                                          const PredictionFindings& findings, const FinalFit& final,
                                          int threads) {
  constexpr double kErrorsApart = 4.0, kLess = 0.9;  // z, and of the error
  if (campaign.hold != InputHold::kZero || findings.stopped ||
      !std::isfinite(data.largest_force())) {
    return {};
  }
  Campaign changed = campaign;
  changed.hold = InputHold::kFirst;
  PredictionData other(stated, changed, threads, kFitted);
  other.limit_noise(data.noise());
  HoldComparison both;
  const ExtendedLumpedModel model = without_fillers(final.found().fit.model);
  for (const Index horizon : {data.first_horizon(), final.found().horizon}) {
    HoldComparison each =
        compare_holds(data, other, model, data.windows(horizon), findings.intensity, threads);
    if (each.usable && each.z > both.z) both = each;
  }
  const bool is_better =
      both.usable && both.z > kErrorsApart && both.error_other < kLess * both.error;
  if (!is_better) return {};
  return both;
}

// An error over its own signal says nothing of an output that hardly moves in what is kept out.
void tell_what_stands_kept_out(const PredictionOutcome& outcome, Diagnosis& diagnosis) {
  const JudgedModel& found = outcome.final->found();
  if (!found.held_out_error) return;
  for (std::size_t j = 0; j < found.stands_held_out.size(); ++j) {
    if (!found.stands_held_out[j]) continue;
    diagnosis.assumptions.push_back(fmt::format(
        "In the recordings kept out {} hardly moves beyond its noise: errors of it there are given "
        "over its signal in the fit, and they check little. Keep out a part that moves.",
        outcome.stated->output_names[j]));
  }
}

// What was held, what moved far, and what holds only if some force is absent, in sentences.
void add_assumptions(const PredictionOutcome& outcome, const LumpedModel& given,
                     const std::string& held, Diagnosis& diagnosis) {
  for (const std::string& words : {held, moved_words(given, diagnosis.after.model_parameters)}) {
    if (!words.empty()) diagnosis.assumptions.push_back(words);
  }
  if (diagnosis.interrupted) return;
  tell_what_stands_kept_out(outcome, diagnosis);
  std::ranges::copy(confounded_sizes(outcome), std::back_inserter(diagnosis.assumptions));
}

// A drive of the wrong sign makes laws of the position that hold against it: a weight, a spring, a
// constant force. Where the model alone does about as well with the sign turned, nobody knows.
void doubt_sign(const LumpedModel& stated, const PredictionData& data,
                const PredictionHypotheses& hypotheses, const FinalFit& final, int threads,
                Diagnosis& diagnosis) {
  constexpr std::array kHolding{"gravity", "stiffness", "cubic_spring",
                                "offset",  "dead_zone", "backlash"};
  constexpr double kAbout = 5.0, kWell = 0.05;  // of the error, of the signal
  const bool holds = std::ranges::any_of(diagnosis.effects, [&](const FoundEffect& effect) {
    return std::ranges::count(kHolding, hypotheses.hypotheses()[effect.law.hypothesis].law) > 0;
  });
  if (!holds || diagnosis.interrupted) return;
  const JudgedModel& found = final.found();
  const double left = relative_size(found.error, data.output_scale());
  const std::optional<double> turned =
      error_with_force_reversed(stated, data, hypotheses, found.horizon, threads);
  if (!turned || *turned > kAbout * left || *turned > kWell) return;
  const std::string drive = stated.input_names.front();
  VerdictReason reason;
  reason.test = fmt::format(
      "the sign of {}: turned, the model alone leaves {:.3g} % of the signal, and {:.3g} % with "
      "the laws found as it is",
      drive, 100.0 * *turned, 100.0 * left);
  reason.passed = false;
  reason.otherwise = Verdict::kAmbiguous;
  reason.next =
      fmt::format("make sure which way {} counts (preprocess: [{{kind: sign, of: [{}]}}] turns it)",
                  drive, drive);
  diagnosis.reasons.push_back(std::move(reason));
  diagnosis.verdict = verdict_of(diagnosis.reasons);
}

void refuse_channels(const SearchOptions& options, Diagnosis& diagnosis) {
  diagnosis.trouble = "the recordings are not what the channels say";
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
}

void require_lumped(const std::filesystem::path& model) {
  const std::string format = YamlField::load(model).at("format").text();
  if (format != "graybox-lumped/1") {
    throw InputError(
        fmt::format("{}: format: a diagnosis by prediction error takes "
                    "graybox-lumped/1 models, not {}",
                    model.string(), format));
  }
}

// What is asked, of which recordings.
struct Question {
  LumpedModel given;
  std::string held;  // hold_scale()
  const Campaign* campaign;
  const SearchOptions* options;
  int threads;
};

PredictionSearchOptions options_of_search(const Question& question) {
  PredictionSearchOptions options;
  options.threads = question.threads;
  options.proceed = question.options->proceed;
  if (question.options->effect_limit > 0) options.most_laws = question.options->effect_limit;
  return options;
}

// What a search found, judged. `other`: filled where the motion is foretold better with the drive
// held otherwise.
void judge(const Question& question, const LumpedModel& stated, const PredictionData& data,
           const PredictionHypotheses& hypotheses, PredictionFindings& findings,
           std::optional<HoldComparison>* other, PredictionDiagnosis& result) {
  const PredictionSearchOptions options = options_of_search(question);
  const int threads = question.threads;
  const FinalFit ladder(data, hypotheses, findings, threads);
  std::optional<OtherLook> look = look_nearer(stated, data, hypotheses, options, findings, ladder);
  if (!look) look = look_farther(stated, data, hypotheses, options, findings, ladder);
  std::optional<OtherLook> unconfirmed;
  if (look && !look->is_confirmed) unconfirmed = std::exchange(look, std::nullopt);
  const FinalFit& final = look ? *look->final : ladder;
  if (!final.found().fit.usable) return;
  if (other != nullptr) {
    *other = better_held(stated, data, *question.campaign, findings, final, threads);
    if (*other) return;
  }
  const PredictionFindings& told = look ? *look->findings : findings;
  const PredictionOutcome outcome{&stated, &data, &hypotheses, &told, &final};
  result.diagnosis = DiagnosisBuilder(outcome).build();
  if (unconfirmed) tell_unconfirmed(*unconfirmed, final, data, result.diagnosis);
  add_assumptions(outcome, question.given, question.held, result.diagnosis);
  doubt_sign(stated, data, hypotheses, final, threads, result.diagnosis);
  result.doubt = doubt_about(result.diagnosis, result.hypotheses);
}

void tell_interrupted(const SearchOptions& options, Diagnosis& diagnosis) {
  diagnosis.interrupted = true;
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
}

// With `stated` for the model as given, from whose values all begins.
PredictionDiagnosis diagnose_from(const LumpedModel& stated, const Question& question,
                                  const PredictionData& all, std::optional<HoldComparison>* other) {
  const int threads = question.threads;
  PredictionData data = all.for_model(stated, threads, kFitted);
  PredictionData searched = all.for_model(stated, threads, kSearched);
  require_windows(stated, searched, *question.campaign);
  const PredictionHypotheses hypotheses(stated, searched, question.options->excluded_laws);
  PredictionDiagnosis result{hypotheses.hypotheses(), {}, {}};
  PredictionSearch search(searched, hypotheses, options_of_search(question));
  try {
    limit_noise(searched, stated, threads);
    data.limit_noise(searched.noise());
    if (!question.options->ignore_channel_faults) {
      result.diagnosis.channel_faults =
          find_reversed_outputs(stated, searched, hypotheses, threads);
    }
    if (!result.diagnosis.channel_faults.empty()) {
      refuse_channels(*question.options, result.diagnosis);
      return result;
    }
    PredictionFindings findings = search.run(stated);
    if (findings.usable) judge(question, stated, data, hypotheses, findings, other, result);
    const bool is_held_otherwise = other != nullptr && *other;
    if (is_held_otherwise || !result.diagnosis.reasons.empty()) return result;
    result.diagnosis = without_fit(findings, *question.options);
    if (!findings.stopped) result.doubt = "the model as given could not be fitted";
  } catch (const Stopped&) {
    tell_interrupted(*question.options, result.diagnosis);
  }
  return result;
}

// With the drive between its samples as the campaign says.
PredictionDiagnosis diagnose_as_held(const std::filesystem::path& model, const Campaign& campaign,
                                     const SearchOptions& options, int threads,
                                     std::optional<HoldComparison>* other) {
  require_lumped(model);
  Question question{load_lumped_model(model), "", &campaign, &options, threads};
  const PredictionData all(question.given, campaign, threads);
  question.held = hold_scale(all, question.given);
  LumpedModel stated = question.given;
  try {
    stated = started_by_data(question.given, all, kSearched, threads);
  } catch (const Stopped&) {
    const PredictionHypotheses hypotheses(stated, all, options.excluded_laws);
    PredictionDiagnosis result{hypotheses.hypotheses(), {}, {}};
    tell_interrupted(options, result.diagnosis);
    return result;
  }
  return diagnose_from(stated, question, all, other);
}

}  // namespace

PredictionDiagnosis diagnose_by_prediction(const std::filesystem::path& model,
                                           const Campaign& campaign, const SearchOptions& options,
                                           int threads) {
  std::optional<HoldComparison> held;
  PredictionDiagnosis result = diagnose_as_held(model, campaign, options, threads, &held);
  if (!held) return result;
  Campaign changed = campaign;
  changed.hold = InputHold::kFirst;
  result = diagnose_as_held(model, changed, options, threads, nullptr);
  result.diagnosis.assumptions.push_back(fmt::format(
      "The drive was taken to go evenly from sample to sample, not to be held between them: so the "
      "error {} is {:.3g} % instead of {:.3g} % ({:.2g} standard errors). A force or a "
      "current that was measured goes so; write `hold: first` in the campaign.",
      held->horizon == 0 ? "in free run" : fmt::format("{:.2g} s ahead", held->seconds),
      100.0 * held->error_other, 100.0 * held->error, held->z));
  return result;
}

}  // namespace graybox
