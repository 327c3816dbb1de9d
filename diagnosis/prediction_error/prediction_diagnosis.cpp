#include "diagnosis/prediction_error/prediction_diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/prediction_error/final_fit.hpp"
#include "diagnosis/prediction_error/latent_pictures.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"
#include "diagnosis/prediction_error/reversed_outputs.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/predictor/drive_hold.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kAbsurdTest = "parameters and laws that no machine has";
constexpr const char* kLawsTest = "laws found";
constexpr const char* kForceTest = "force left at";
constexpr const char* kHeldOutTest = "error kept out";
constexpr double kVanished = 1e-6;                 // of a parameter's scale: as good as zero
constexpr double kHeldOutLimit = 15.0;             // % of the signal
constexpr double kNoiseLimit = 1.5;                // times the stated noise
constexpr double kForeseen = 0.5 * kHeldOutLimit;  // of that, by what is left alone
constexpr double kGrowthLimit = 1.5, kGrowthErrors = 2.0;  // and its standard errors
constexpr double kSmallError = 3.0;  // % of the signal, which may grow from less
constexpr double kSmallForce = 5.0;  // % of the forces that act: as good as nothing
constexpr double kAsGivenLimit = 2.0;
constexpr double kTrendErrors = 4.5, kTrendShare = 0.1;  // of the parameter
constexpr double kExcluded = 2.0;                        // z of what is found over a rival
constexpr double kStructureLimit = 3.0;                  // % of the forces that act
constexpr double kRestLimit = 15.0;                      // % of them
constexpr Eigen::Index kSearchedSamples = 8000;          // for the search; the final fit takes all

double pooled(const VectorXd& error, const VectorXd& scale) {
  return 100.0 * relative_size(error, scale);
}

Assessment assessment(const VectorXd& error, const VectorXd& scale, const VectorXd& noise,
                      double samples) {
  Assessment result;
  result.degrees_of_freedom = samples * static_cast<double>(error.size());
  result.chi_square = samples * (error.array() / noise.array()).square().sum();
  result.nrmse = pooled(error, scale);
  result.variance_accounted_for = 100.0 * (1.0 - (error.array() / scale.array()).square().mean());
  return result;
}

FittedLaw fitted_law(const ExtendedLumpedModel& model, const PlacedFinding& law,
                     const JudgedModel* judged) {
  FittedLaw result;
  result.hypothesis = law.hypothesis;
  const Element& part = model.model.parts[law.part];
  const LawEntry& entry = *find_law(part.law_name, part.location.kind != LocationKind::kElement);
  const std::size_t first = model.first_parameter(law.part);
  for (std::size_t p = 0; p < part.parameters.size(); ++p) {
    double error = kNaN;
    if (judged != nullptr) {
      const auto at = std::ranges::find(judged->fit.free, first + p);
      if (at != judged->fit.free.end()) error = judged->deviations(at - judged->fit.free.begin());
    }
    result.parameters.push_back(
        estimate_of(entry.parameters[p], part.location.units, part.parameters[p], error));
  }
  return result;
}

bool is_stiffness(const std::string& unit) { return unit == "N/m" || unit == "N m/rad"; }
bool is_velocity(const std::string& unit) { return unit == "m/s" || unit == "rad/s"; }

class DiagnosisBuilder {
 public:
  DiagnosisBuilder(const LumpedModel& stated, const PredictionData& data,
                   const PredictionHypotheses& hypotheses, const PredictionFindings& findings,
                   const FinalFit& final)
      : stated_(&stated),
        data_(&data),
        hypotheses_(&hypotheses),
        findings_(&findings),
        final_(&final) {}

  [[nodiscard]] Diagnosis build() {
    result_.before = extended_fit(final_->as_given());
    result_.after = extended_fit(final_->found());
    result_.validation_before = held_out(final_->as_given());
    result_.validation_after = held_out(final_->found());
    motion_ = final_->motion();
    add_effects();
    add_channels();
    add_ranking();
    result_.curves_before = final_->curves(final_->as_given());
    result_.curves_after = final_->curves(final_->found());
    if (const LatentForce* force = final_->rest().force()) {
      result_.pictures = latent_pictures(final_->found().fit.model, *force);
    }
    result_.detection.detected = !result_.effects.empty() || !is_disturbance();
    result_.may_be_disturbed = result_.effects.empty() && final_->rest().force() != nullptr &&
                               100.0 * final_->rest().structured_share() <= kStructureLimit;
    result_.checked = checked();
    result_.implausible =
        implausibilities(fit_physics(hypotheses_->hypotheses(), context(), result_.after));
    result_.interrupted = findings_->stopped;
    result_.reasons = reasons();
    result_.verdict = verdict_of(result_.reasons);
    result_.verified =
        std::ranges::none_of(result_.reasons, [](const VerdictReason& r) { return has_failed(r); });
    return std::move(result_);
  }

 private:
  [[nodiscard]] double samples() const {
    double count = 0.0;
    for (const OutputErrorRecording& recording : data_->recordings()) {
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
    fit.deviance = samples() * (judged.error.array() / data_->noise().array()).square().sum();
    fit.parameter_count = judged.fit.free.size();
    fit.estimation = assessment(judged.error, data_->output_scale(), data_->noise(), samples());
    return fit;
  }

  [[nodiscard]] std::optional<Assessment> held_out(const JudgedModel& judged) const {
    if (!judged.held_out_error) return {};
    return assessment(*judged.held_out_error, judged.held_out_scale, data_->noise(), 1.0);
  }

  [[nodiscard]] std::optional<HeldOutEffect> effect_of(const JudgedModel& without) const {
    const auto poorer = final_->law_held_out(without);
    const auto richer = final_->law_held_out(final_->found());
    if (!poorer || !richer) return {};
    const VectorXd& scale = final_->found().held_out_scale;
    HeldOutEffect effect;
    effect.error_without = pooled(poorer->error, scale);
    effect.error_with = pooled(richer->error, scale);
    effect.seconds_ahead = static_cast<double>(richer->horizon) * data_->sample_time();
    const double floor = pooled(data_->noise(), scale);
    const double before = effect.error_without * effect.error_without - floor * floor;
    const double after = effect.error_with * effect.error_with - floor * floor;
    effect.gain = before > 0.0 ? 1.0 - std::max(after, 0.0) / before : 0.0;
    effect.misleads = effect.error_with > 1.05 * effect.error_without;
    return effect;
  }

  [[nodiscard]] Rival rival_of(const TriedLaw& tried) const {
    Rival rival;
    rival.law = fitted_law(tried.fit.model, tried.fit.model.laws.back(), nullptr);
    rival.bic_difference = tried.behind * std::abs(tried.behind);
    return rival;
  }

  void add_effects() {
    const ExtendedLumpedModel& model = final_->found().fit.model;
    for (std::size_t l = 0; l < model.laws.size(); ++l) {
      FoundEffect effect;
      effect.law = result_.after.laws[l];
      const JudgedModel without = final_->without(l);
      if (without.fit.usable) {
        const double z = final_->z_over(without);
        effect.law.wald_statistic = z * std::abs(z);
        effect.bic_difference = effect.law.wald_statistic;
        effect.explained_share = 1.0 - final_->found().fit.cost / without.fit.cost;
        effect.held_out = effect_of(without);
      }
      const auto accepted = std::ranges::find(
          findings_->laws, final_->accepted_as(model.laws[l].hypothesis), &AcceptedLaw::hypothesis);
      if (accepted != findings_->laws.end()) add_rivals(*accepted, l, effect);
      if (without.fit.usable) {
        add_rivals_elsewhere(model.laws[l].hypothesis, without, effect);
        add_richer_friction(l, effect);
      }
      unite_delays(effect);
      result_.effects.push_back(std::move(effect));
    }
  }

  // A rival that was found as a law of its own later is none; of the others each takes the place of
  // the law in the model as it is at the end.
  void add_rivals(const AcceptedLaw& accepted, std::size_t law, FoundEffect& effect) const {
    constexpr std::size_t kNamed = 3;
    for (const TriedLaw& tried : accepted.rivals) {
      if (is_found(tried.hypothesis)) continue;
      const JudgedModel exchanged = final_->exchanged(law, tried.fit.model);
      Rival rival = rival_of(tried);
      if (exchanged.fit.usable) {
        const double z = final_->z_over(exchanged);
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
  [[nodiscard]] bool contains(std::size_t richer, std::size_t plainer) const {
    const Hypothesis& a = hypotheses_->hypotheses()[richer];
    const Hypothesis& b = hypotheses_->hypotheses()[plainer];
    return a.place == b.place && std::ranges::count(a.special_cases, b.law) > 0;
  }

  void add_rivals_elsewhere(std::size_t found, const JudgedModel& without,
                            FoundEffect& effect) const {
    for (const std::size_t other : final_->elsewhere(found)) {
      if (is_named(other, effect)) continue;
      const JudgedModel exchanged = final_->with_law(without, other);
      if (!exchanged.fit.usable) continue;
      const double z = final_->z_over(exchanged);
      if (z >= kExcluded) continue;
      Rival rival;
      rival.law = fitted_law(exchanged.fit.model, exchanged.fit.model.laws.back(), nullptr);
      rival.bic_difference = z * std::abs(z);
      effect.rivals.push_back(std::move(rival));
    }
  }

  // A plain friction takes most of what a richer one would, and leaves a rest that may pass for a
  // disturbance. Where the richer one predicts better, kept-out recordings included, it is named:
  // as a rival, or where that may be chance beside the law found.
  void add_richer_friction(std::size_t law, FoundEffect& effect) const {
    constexpr double kWorthNaming = 1.0;  // z
    const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
    const std::size_t found = final_->found().fit.model.laws[law].hypothesis;
    if (all[found].law != "coulomb" && all[found].law != "viscous") return;
    for (std::size_t richer = 0; richer < all.size(); ++richer) {
      const auto is_this = [&](const Rival& rival) { return rival.law.hypothesis == richer; };
      if (!contains(richer, found) || is_found(richer)) continue;
      if (std::ranges::any_of(effect.rivals, is_this)) continue;
      const JudgedModel fitted = final_->in_place_of(law, richer);
      if (!fitted.fit.usable) continue;
      const double z = z_between(final_->found().fit, fitted.fit);
      if (!(z > kWorthNaming) || raises_held_out(fitted)) continue;
      Rival rival;
      rival.law = fitted_law(fitted.fit.model, fitted.fit.model.laws.back(), nullptr);
      rival.bic_difference = -z * z;
      std::erase_if(effect.excluded, is_this);
      (z > kExcluded ? effect.rivals : effect.generalisations).push_back(std::move(rival));
    }
  }

  [[nodiscard]] bool raises_held_out(const JudgedModel& other) const {
    const auto with = final_->law_held_out(other), without = final_->law_held_out(final_->found());
    if (!with || !without) return false;
    const VectorXd& scale = final_->found().held_out_scale;
    return pooled(with->error, scale) > pooled(without->error, scale);
  }

  // With one drive and one sensor a delay at either is one system, whatever lies between them and
  // whatever a filter that starts somewhere else may say.
  void unite_delays(FoundEffect& effect) const {
    const std::vector<Hypothesis>& all = hypotheses_->hypotheses();
    const Hypothesis& found = all[effect.law.hypothesis];
    if (found.law != "delay" || stated_->inputs.size() != 1 || stated_->outputs.size() != 1) return;
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

  [[nodiscard]] bool is_found(std::size_t hypothesis) const {
    return std::ranges::count(final_->found().fit.model.laws, hypothesis,
                              &PlacedFinding::hypothesis) > 0;
  }

  static bool is_named(std::size_t hypothesis, const FoundEffect& effect) {
    const auto names = [&](const std::vector<Rival>& rivals) {
      return std::ranges::any_of(
          rivals, [&](const Rival& rival) { return rival.law.hypothesis == hypothesis; });
    };
    return names(effect.rivals) || names(effect.excluded);
  }

  [[nodiscard]] std::vector<ChannelRest> channel_rests(const JudgedModel& judged) const {
    std::vector<ChannelRest> rests;
    if (!judged.fit.usable) return rests;
    const Index outputs = data_->output_count();
    const Eigen::Map<const MatrixXd> table(judged.fit.residuals.data(), outputs,
                                           judged.fit.residuals.size() / outputs);
    for (Index j = 0; j < outputs; ++j) {
      ChannelRest rest;
      rest.channel = stated_->output_names[static_cast<std::size_t>(j)];
      rest.nrmse = 100.0 * judged.error(j) / data_->output_scale()(j);
      const VectorXd e = table.row(j).transpose();
      const Index n = e.size() - 1;
      const double memory = e.head(n).dot(e.tail(n)) / std::max(e.squaredNorm(), 1e-300);
      rest.autocorrelated_error = rest.nrmse * std::clamp(memory, 0.0, 1.0);
      rests.push_back(std::move(rest));
    }
    return rests;
  }

  void add_channels() {
    result_.channels_before = channel_rests(final_->as_given());
    result_.channels_after = channel_rests(final_->found());
  }

  void add_ranking() {
    for (const ExtensionScore& score : findings_->ranking) {
      const LawExtension& law = findings_->ranked[score.extension];
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

  [[nodiscard]] CheckedRange checked() const {
    CheckedRange range;
    range.kept_out = data_->has_validation();
    const auto role = range.kept_out ? ExperimentRole::kValidation : ExperimentRole::kEstimation;
    for (const OutputErrorRecording& recording : data_->recordings()) {
      if (recording.role != role) continue;
      if (std::ranges::count(range.files, recording.name) == 0)
        range.files.push_back(recording.name);
      for (Index j = 0; j < recording.outputs.cols(); ++j) {
        const auto at = static_cast<std::size_t>(j);
        const double low = recording.outputs.col(j).minCoeff();
        const double high = recording.outputs.col(j).maxCoeff();
        if (range.spans.size() <= at) {
          range.spans.push_back({stated_->output_names[at], stated_->output_units[at], low, high});
        }
        range.spans[at].from = std::min(range.spans[at].from, low);
        range.spans[at].to = std::max(range.spans[at].to, high);
      }
    }
    return range;
  }

  [[nodiscard]] PhysicalContext context() const {
    PhysicalContext context;
    const JudgedModel& found = final_->found();
    for (const std::size_t index : found.fit.free) {
      if (index >= found.fit.model.own_parameters()) continue;
      context.starts.push_back(start_of(index, found.fit.model.model.parameters[index].value));
      const ParameterSpace& space = found.fit.model.space[index];
      // The others may become zero. A velocity at a bound is one that the motion does not show.
      const bool has_bounds = space.logarithmic && !is_velocity(stated_->parameters[index].unit);
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
    const double stated = stated_->parameters[parameter].value;
    const double fitted = findings_->as_given.model.parameters[parameter].value;
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
    own.trace.carried = data_->largest_force();
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

  // The whole of each recording is foretold within half a step of each sensor, kept-out ones
  // included: rounding is no white noise (at rest it stays), and is all that is left.
  [[nodiscard]] bool is_within_a_step() const {
    const JudgedModel& found = final_->found();
    if (found.horizon != 0 || !found.fit.usable) return false;
    for (Index j = 0; j < data_->output_count(); ++j) {
      const double most = 0.5 * data_->rounding_step(j);
      if (!(found.error(j) <= most)) return false;
      if (found.held_out_error && !((*found.held_out_error)(j) <= most)) return false;
    }
    return true;
  }

  // What is left could be the sensors' noise and a disturbance.
  [[nodiscard]] bool is_disturbance() const {
    const UnmodelledForce& rest = final_->rest();
    if (rest.multiple_of_noise() <= kNoiseMultiple || is_within_a_step()) return true;
    return rest.multiple_of_rest() <= kNoiseMultiple &&
           100.0 * rest.structured_share() <= kStructureLimit &&
           100.0 * rest.share() <= kSmallForce;
  }

  static VerdictReason test(std::string name, std::optional<double> value, double limit,
                            bool passed, std::string next, Verdict otherwise = Verdict::kUnknown) {
    VerdictReason reason;
    reason.test = std::move(name);
    reason.value = value;
    reason.limit = limit;
    reason.passed = passed;
    reason.otherwise = otherwise;
    if (!passed) reason.next = std::move(next);
    if (reason.next.ends_with('.')) reason.next.pop_back();
    return reason;
  }

  void add_plausibility(std::vector<VerdictReason>& list) const {
    const std::size_t absurd = excluding(result_.implausible);
    list.push_back(test(kAbsurdTest, static_cast<double>(absurd), 0.0, absurd == 0,
                        absurd > 0 ? result_.implausible.front().remedy : ""));
  }

  void add_held_out(std::vector<VerdictReason>& list) const {
    const JudgedModel& found = final_->found();
    if (!found.held_out_error) {
      VerdictReason reason =
          test(fmt::format("{}, % of the signal", kHeldOutTest), {}, kHeldOutLimit, true, "");
      reason.not_tested = "no recordings were kept out of the fit";
      list.push_back(std::move(reason));
      return;
    }
    const auto limits = [&](Index j) {
      const double noise = 100.0 * kNoiseLimit * data_->noise()(j) / found.held_out_scale(j);
      return std::max(kHeldOutLimit, noise);
    };
    const auto percent = [&](const VectorXd& error, Index j) {
      return 100.0 * error(j) / found.held_out_scale(j);
    };
    HeldOutError judged{found.horizon, *found.held_out_error};
    for (Index j = 0; j < data_->output_count(); ++j) {
      if (percent(judged.error, j) <= limits(j)) continue;
      // Nobody foresees a disturbance: as far ahead as it matters little.
      if (const auto ahead = final_->held_out_ahead(kForeseen / 100.0)) judged = *ahead;
      break;
    }
    const std::string ahead =
        judged.horizon == 0 ? "in free run"
                            : fmt::format("{:.3g} s ahead", static_cast<double>(judged.horizon) *
                                                                data_->sample_time());
    for (Index j = 0; j < data_->output_count(); ++j) {
      const double error = percent(judged.error, j), limit = limits(j);
      list.push_back(
          test(fmt::format("{} of {} {}, % of its signal", kHeldOutTest,
                           stated_->output_names[static_cast<std::size_t>(j)], ahead),
               error, limit, error <= limit,
               "put recordings like those kept out into the fit, and look at when the error is "
               "largest"));
    }
  }

  // This asks for what a machine must have: damping and friction may vanish.
  void add_determination(std::vector<VerdictReason>& list, Verdict otherwise) const {
    const auto must_be_there = [&](const Implausibility& flaw) {
      if (flaw.rule != PlausibilityRule::kZero) return true;
      return std::ranges::any_of(
          result_.after.model_parameters, [&](const LawParameterEstimate& parameter) {
            return parameter.name == flaw.quantity &&
                   (parameter.unit.starts_with("kg") || is_stiffness(parameter.unit));
          });
    };
    std::size_t count = 0;
    std::string remedy;
    for (const Implausibility& flaw : result_.implausible) {
      if (flaw.excludes || !must_be_there(flaw)) continue;
      ++count;
      remedy = flaw.remedy;
    }
    list.push_back(test("masses and springs that are not determined", static_cast<double>(count),
                        0.0, count == 0, remedy, otherwise));
  }

  // A law that raises an error which is small all the same may be right.
  void add_misleading(std::vector<VerdictReason>& list) const {
    if (!final_->found().held_out_error) return;
    const auto misleading = std::ranges::count_if(result_.effects, [](const FoundEffect& effect) {
      return effect.held_out && effect.held_out->misleads &&
             effect.held_out->error_with > kHeldOutLimit;
    });
    list.push_back(test("laws found that raise the error kept out", static_cast<double>(misleading),
                        0.0, misleading == 0,
                        "leave them out (--without), or put recordings like those kept out into "
                        "the fit"));
  }

  // A law that holds on the average only.
  void add_trend(std::vector<VerdictReason>& list) const {
    const std::vector<LawTrend> trends = final_->trends();
    const LawTrend* worst = nullptr;
    for (const LawTrend& trend : trends) {
      const double larger = std::max(std::abs(trend.from), std::abs(trend.to));
      const bool is_much = std::abs(trend.to - trend.from) > kTrendShare * larger;
      if (is_much && (worst == nullptr || std::abs(trend.z) > std::abs(worst->z))) worst = &trend;
    }
    const std::string tested = "what was found changes with time, place or speed";
    if (worst == nullptr) {
      VerdictReason reason = test(tested + ", standard errors", 0.0, kTrendErrors, true, "");
      if (trends.empty()) reason.not_tested = "the recordings are one window each";
      list.push_back(std::move(reason));
      return;
    }
    const FittedLaw& law = result_.effects[worst->law].law;
    const Hypothesis& hypothesis = hypotheses_->hypotheses()[law.hypothesis];
    const LawParameterEstimate& parameter = law.parameters[worst->parameter];
    const double z = std::abs(worst->z);
    // A law of the speed stands in for another one, at its place.
    const bool is_of_speed =
        worst->on == LawTrend::On::kSpeed || worst->on == LawTrend::On::kDirection;
    const Verdict otherwise = is_of_speed ? Verdict::kAmbiguous : Verdict::kUnknown;
    list.push_back(
        test(fmt::format("{} ({} of {} at {}: {}), standard errors", tested, parameter.name,
                         hypothesis.law, hypothesis.place, trend_words(*worst, parameter.unit)),
             z, kTrendErrors, z <= kTrendErrors, trend_advice(worst->on), otherwise));
  }

  static std::string trend_words(const LawTrend& trend, const std::string& unit) {
    switch (trend.on) {
      case LawTrend::On::kTime:
        return fmt::format("about {:.3g} {} where recordings begin, {:.3g} where they end",
                           trend.from, unit, trend.to);
      case LawTrend::On::kPosition:
        return fmt::format("between about {:.3g} and {:.3g} {} along the way",
                           std::min(trend.from, trend.to), std::max(trend.from, trend.to), unit);
      case LawTrend::On::kSpeed:
        return fmt::format("about {:.3g} {} in fast motion, {:.3g} in slow motion", trend.from,
                           unit, trend.to);
      case LawTrend::On::kDirection:
        return fmt::format("about {:.3g} {} one way, {:.3g} the other", trend.from, unit, trend.to);
    }
    return {};
  }

  static std::string trend_advice(LawTrend::On on) {
    switch (on) {
      case LawTrend::On::kTime:
        return "look for what changes while it is recorded, as a temperature, a load or wear; "
               "record it, and fit the beginning and the end by themselves";
      case LawTrend::On::kPosition:
        return "look at the place where it changes, as a worn guide, a screw or a cable; record "
               "slow motion over the whole way";
      case LawTrend::On::kSpeed:
        return "record slow motion and standstill beside fast motion: another law of the speed "
               "fits better, as friction that falls with speed";
      case LawTrend::On::kDirection:
        return "record the same motion both ways: a constant force, or friction that differs by "
               "direction, is missing";
    }
    return {};
  }

  void add_growth(std::vector<VerdictReason>& list) const {
    const std::string name = "growth of the error from the recordings of the fit to those kept out";
    const std::optional<FinalFit::Growth> growth = final_->growth();
    if (!growth) {
      VerdictReason reason = test(name, {}, kGrowthLimit, true, "");
      reason.not_tested = final_->found().held_out_error
                              ? "the force left hides it at every horizon"
                              : "no recordings were kept out of the fit";
      list.push_back(std::move(reason));
      return;
    }
    Index worst = 0;
    const double most = growth->ratio.maxCoeff(&worst);
    const bool is_chance = std::log(most) < kGrowthErrors * growth->deviation(worst);
    const std::string& channel = stated_->output_names[static_cast<std::size_t>(worst)];
    const JudgedModel& found = final_->found();
    const double kept_out = (*found.held_out_error)(worst) / found.held_out_scale(worst);
    const bool is_small = 100.0 * kept_out <= kSmallError;
    const char* excuse = "";
    if (most > kGrowthLimit && is_chance) excuse = "; chance explains it";
    if (most > kGrowthLimit && is_small) excuse = "; it is small all the same";
    list.push_back(test(
        fmt::format("{} ({}{})", name, channel, excuse), most, kGrowthLimit,
        most <= kGrowthLimit || is_chance || is_small,
        "put recordings like those kept out into the fit: the laws found do not hold there as they "
        "hold in it"));
  }

  void add_against_as_given(std::vector<VerdictReason>& list) const {
    if (!result_.validation_before || !result_.validation_after) return;
    const double ratio = result_.validation_after->nrmse / result_.validation_before->nrmse;
    // Where errors add up, a disturbance may make a poor model the better one by chance.
    const double limit = findings_->has_free_run ? 1.0 : kAsGivenLimit;
    list.push_back(test("error kept out over that of the model as given", ratio, limit,
                        ratio <= limit,
                        "the laws found do not help where they were not fitted: put recordings "
                        "like those kept out into the fit"));
  }

  static std::string advice_on(const LatentStructure& structure) {
    if (structure.on == kOfRecording) {
      return "look for what differs between the recordings, as a load, a zero or a temperature, "
             "and diagnose those that are alike by themselves";
    }
    return fmt::format("look for a law that depends on {}, and try laws of your own there (--laws)",
                       structure.words);
  }

  std::string advice_on_force(double share) const {
    constexpr double kAll = 100.0;  // % of the forces that act
    if (share > kAll) {
      return "look first whether the drive's channel is the force that acts on the machine: its "
             "unit, gain and sign, and what else pushes";
    }
    if (result_.effects.empty()) {
      return "look at when this force is largest: at a position, a speed, a turn of the command; "
             "then try masses, springs and laws of your own there (--laws)";
    }
    return "record what may disturb the machine (temperature, supply, floor, hoses)";
  }

  // Where the noise of the sensors alone accounts for the errors, nothing else is asked.
  void add_rest(std::vector<VerdictReason>& list) const {
    const UnmodelledForce& rest = final_->rest();
    const double of_noise = rest.multiple_of_noise();
    if (of_noise <= kNoiseMultiple || rest.force() == nullptr) {
      list.push_back(test("rest over what the noise of the sensors leaves, most of all horizons",
                          of_noise, kNoiseMultiple, of_noise <= kNoiseMultiple,
                          "a disturbance, or physics that none of these laws describes: look at "
                          "which channel and when it is largest"));
      return;
    }
    const double structured = 100.0 * rest.structured_share(), share = 100.0 * rest.share();
    const LatentStructure* const structure = rest.structure();
    list.push_back(
        test(structure == nullptr
                 ? std::string("force left that depends on the motion, % of the forces that act")
                 : fmt::format("force left that depends on {}, % of the forces that act",
                               structure->words),
             structured, kStructureLimit, structured <= kStructureLimit,
             structure == nullptr ? std::string() : advice_on(*structure)));
    const std::string place =
        stated_->mass_names[static_cast<std::size_t>(rest.force()->disturbance.coordinate)];
    list.push_back(test(fmt::format("{} {}, % of the forces that act", kForceTest, place), share,
                        kRestLimit, share <= kRestLimit, advice_on_force(share)));
    const double multiple = rest.multiple_of_rest();
    list.push_back(test(
        "rest over what the sensors' noise and that force leave, most of all horizons", multiple,
        kNoiseMultiple, multiple <= kNoiseMultiple,
        "more than one disturbance, or physics that none of these laws describes: look at which "
        "channel and when it is largest"));
  }

  [[nodiscard]] std::vector<VerdictReason> reasons() const {
    std::vector<VerdictReason> list;
    if (result_.interrupted) {
      list.push_back(test("the search came to its end", {}, 0.0, false,
                          "give it more time (--time-limit) or more threads"));
    }
    add_plausibility(list);
    if (!result_.detection.detected && result_.interrupted) return list;
    if (!result_.detection.detected) {
      add_held_out(list);
      add_growth(list);
      add_determination(list, Verdict::kUnknown);  // who can't tell them can't miss anything
      if (std::ranges::any_of(list, has_failed)) return list;
      list.push_back(test("something is missing", {}, 0.0, false,
                          "nothing: the model as it is will do for motion like the recorded one",
                          Verdict::kNone));
      return list;
    }
    const auto laws = static_cast<double>(result_.effects.size());
    VerdictReason found = test(kLawsTest, laws, 1.0, laws >= 1.0,
                               "check units, signs and the motion that was recorded, and try laws "
                               "of your own (--laws)");
    found.is_lower_limit = true;
    list.push_back(std::move(found));
    add_misleading(list);
    add_held_out(list);
    add_growth(list);
    add_against_as_given(list);
    add_rest(list);
    // The first that fails decides, and this may say `ambiguous`.
    if (laws > 0.0) add_trend(list);
    add_determination(list, Verdict::kAmbiguous);
    if (!result_.validation_after) list.push_back(nothing_kept_out());
    std::size_t rivals = 0;
    for (const FoundEffect& effect : result_.effects) rivals += effect.rivals.size();
    list.push_back(test("other explanations that are not excluded", static_cast<double>(rivals),
                        0.0, rivals == 0, "add a sensor, or record larger and faster motion",
                        Verdict::kAmbiguous));
    return list;
  }

  const LumpedModel* stated_;
  const PredictionData* data_;
  const PredictionHypotheses* hypotheses_;
  const PredictionFindings* findings_;
  const FinalFit* final_;
  MatrixXd motion_;
  Diagnosis result_;
};

// Tests that leave little of an answer where they fail. Where a sensor reads no sign, no other
// method knows the motion.
std::string doubt_about(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (diagnosis.interrupted || diagnosis.verdict != Verdict::kUnknown) return "";
  for (const FoundEffect& effect : diagnosis.effects) {
    if (hypotheses[effect.law.hypothesis].law == "rectifier") return "";
  }
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (!has_failed(reason)) continue;
    const bool is_decisive =
        reason.test.starts_with(kAbsurdTest) || reason.test.starts_with(kLawsTest) ||
        reason.test.starts_with(kForceTest) || reason.test.starts_with(kHeldOutTest);
    if (is_decisive) return reason.test;
  }
  return "";
}

// Where no force acts, motion tells forces relative to masses alone: one mass is held at what is
// stated. The sentence that says so, or nothing.
std::string hold_scale(const PredictionData& data, LumpedModel& model) {
  const auto tells_scale = [](const LumpedParameter& parameter) {
    return parameter.unit.starts_with("kg") || parameter.unit.starts_with('N');
  };
  const bool is_told = std::ranges::any_of(model.parameters, [&](const LumpedParameter& parameter) {
    return parameter.fixed && tells_scale(parameter);
  });
  if (!data.moves_freely() || is_told) return {};
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
  constexpr double kFar = 10.0;  // times
  std::string words;
  for (std::size_t i = 0; i < std::min(stated.parameters.size(), fitted.size()); ++i) {
    const LumpedParameter& parameter = stated.parameters[i];
    if (parameter.fixed || !(parameter.value > 0.0)) continue;
    const double ratio = fitted[i].value / parameter.value;
    const bool may_vanish = parameter.range == ParameterRange::kNonNegative;
    if (ratio < kFar && (may_vanish || ratio > 1.0 / kFar)) continue;
    const double error = fitted[i].standard_error;
    words += fmt::format("{}{} from {:.3g} to {:.3g}{} {}", words.empty() ? "" : "; ",
                         fitted[i].name, parameter.value, fitted[i].value,
                         error > 0.0 ? fmt::format(" ± {:.2g}", error) : "", parameter.unit);
  }
  return words.empty() ? words : "The fit moved far from what the model states: " + words + ".";
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

// Laws one sample ahead, beside a disturbance, and what comes of them.
struct NearerLook {
  std::unique_ptr<PredictionFindings> findings;  // that the final fit refers to
  std::unique_ptr<FinalFit> final;
};

// Where the ladder ends without laws. A look that is stopped makes it one that was stopped.
std::optional<NearerLook> look_nearer(const LumpedModel& stated, const PredictionData& data,
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
  NearerLook look;
  look.findings = std::move(findings);
  look.final = std::make_unique<FinalFit>(data, hypotheses, *look.findings, options.threads);
  if (!look.final->found().fit.usable || look.final->found().fit.model.laws.empty()) return {};
  return look;
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
  constexpr double kErrors = 4.0, kLess = 0.9;  // z, and of the error
  if (campaign.hold != InputHold::kZero || findings.stopped ||
      !std::isfinite(data.largest_force())) {
    return {};
  }
  Campaign changed = campaign;
  changed.hold = InputHold::kFirst;
  PredictionData other(stated, changed, threads);
  other.limit_noise(data.noise());
  HoldComparison both;
  const ExtendedLumpedModel model = without_fillers(final.found().fit.model);
  for (const Index horizon : {data.first_horizon(), final.found().horizon}) {
    HoldComparison each =
        compare_holds(data, other, model, data.windows(horizon), findings.intensity, threads);
    if (each.usable && each.z > both.z) both = each;
  }
  const bool is_better = both.usable && both.z > kErrors && both.error_other < kLess * both.error;
  if (!is_better) return {};
  return both;
}

// With the drive between its samples as the campaign says. `other`: filled where the motion is
// foretold better otherwise.
PredictionDiagnosis diagnose_as_held(const std::filesystem::path& model, const Campaign& campaign,
                                     const SearchOptions& options, int threads,
                                     std::optional<HoldComparison>* other) {
  const std::string format = YamlField::load(model).at("format").text();
  if (format != "graybox-lumped/1") {
    throw InputError(
        fmt::format("{}: format: a diagnosis by prediction error takes "
                    "graybox-lumped/1 models, not {}",
                    model.string(), format));
  }
  LumpedModel stated = load_lumped_model(model);
  PredictionData data(stated, campaign, threads);
  const std::string held = hold_scale(data, stated);
  PredictionData searched(stated, campaign, threads, kSearchedSamples);
  require_windows(stated, searched, campaign);
  const PredictionHypotheses hypotheses(stated, searched, options.excluded_laws);
  PredictionSearchOptions search_options;
  search_options.threads = threads;
  search_options.proceed = options.proceed;
  if (options.effect_limit > 0) search_options.most_laws = options.effect_limit;
  PredictionDiagnosis result{hypotheses.hypotheses(), {}, {}};
  PredictionSearch search(searched, hypotheses, search_options);
  try {
    limit_noise(searched, stated, threads);
    data.limit_noise(searched.noise());
    if (!options.ignore_channel_faults) {
      result.diagnosis.channel_faults =
          find_reversed_outputs(stated, searched, hypotheses, threads);
    }
    if (!result.diagnosis.channel_faults.empty()) {
      result.diagnosis.trouble = "the recordings are not what the channels say";
      result.diagnosis.reasons = verdict_reasons(result.diagnosis, options);
      result.diagnosis.verdict = verdict_of(result.diagnosis.reasons);
      return result;
    }
    PredictionFindings findings = search.run(stated);
    if (findings.usable) {
      const FinalFit ladder(data, hypotheses, findings, threads);
      const std::optional<NearerLook> nearer =
          look_nearer(stated, data, hypotheses, search_options, findings, ladder);
      const FinalFit& final = nearer ? *nearer->final : ladder;
      if (final.found().fit.usable) {
        if (other != nullptr)
          *other = better_held(stated, data, campaign, findings, final, threads);
        if (other != nullptr && *other) return result;
        result.diagnosis =
            DiagnosisBuilder(stated, data, hypotheses, nearer ? *nearer->findings : findings, final)
                .build();
        for (const std::string& words :
             {held, moved_words(stated, result.diagnosis.after.model_parameters)}) {
          if (!words.empty()) result.diagnosis.assumptions.push_back(words);
        }
        result.doubt = doubt_about(result.diagnosis, result.hypotheses);
        return result;
      }
    }
    result.diagnosis = without_fit(findings, options);
    if (!findings.stopped) result.doubt = "the model as given could not be fitted";
  } catch (const Stopped&) {
    result.diagnosis.interrupted = true;
    result.diagnosis.reasons = verdict_reasons(result.diagnosis, options);
    result.diagnosis.verdict = verdict_of(result.diagnosis.reasons);
  }
  return result;
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
