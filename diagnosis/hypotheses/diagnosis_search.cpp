#include "graybox/diagnosis/hypotheses/diagnosis_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "graybox/problems/distributions.hpp"
#include "graybox/problems/error.hpp"

namespace graybox {
namespace {

// What was fitted, and where the laws started.
struct Refit {
  std::vector<LawStart> laws;
  ExtendedFit fit;
};

// A refit with one more law, or with one law in the place of another.
struct Trial {
  std::size_t hypothesis = 0;
  ExtendedFit fit;
};

std::vector<LawStart> starts_of(const ExtendedFit& fit) {
  std::vector<LawStart> starts;
  for (const FittedLaw& law : fit.laws) {
    LawStart& start = starts.emplace_back();
    start.hypothesis = law.hypothesis;
    for (const LawParameterEstimate& parameter : law.parameters) {
      start.parameters.push_back(parameter.value);
    }
  }
  return starts;
}

class Search {
 public:
  Search(const MismatchProblem& problem, const SearchOptions& options)
      : problem_(problem), options_(options) {}

  Diagnosis run() {
    result_.noise_is_known = problem_.noise_is_known();
    if (!options_.ignore_channel_faults && has_channel_faults()) return std::move(result_);
    if (!fit_as_it_is()) return std::move(result_);
    detect();
    if (result_.detection.detected) {
      extend();
      prune();
      simplify();
      weigh_rivals();
    }
    verify();
    conclude();
    return std::move(result_);
  }

 private:
  [[nodiscard]] double bic(const ExtendedFit& fit) const {
    return fit.deviance +
           static_cast<double>(fit.parameter_count) * std::log(problem_.sample_count());
  }

  bool proceed(const std::string& step) {
    if (!result_.interrupted && options_.proceed && !options_.proceed(step)) {
      result_.interrupted = true;
    }
    return !result_.interrupted;
  }

  [[nodiscard]] std::string name_of(std::size_t hypothesis) const {
    const Hypothesis& named = problem_.hypotheses()[hypothesis];
    return named.law + " at " + named.place;
  }

  bool has_channel_faults() {
    proceed("checking wires, signs and units");
    result_.channel_faults = problem_.channel_faults();
    if (result_.channel_faults.empty()) return false;
    result_.trouble = "the recordings are not what the channels say";
    return true;
  }

  bool fit_as_it_is() {
    proceed("fitting the model as it is");
    result_.before = problem_.fit({}, nullptr);
    result_.after = result_.before;
    if (!result_.before.usable) {
      result_.trouble = "the model as it is can't be fitted: " + result_.before.trouble;
      return false;
    }
    result_.mismatch_before = problem_.mismatch(result_.before);
    result_.curves_before = problem_.residual_curves(result_.before);
    result_.validation_before = problem_.validate(result_.before);
    return true;
  }

  [[nodiscard]] bool is_excluded(const Hypothesis& hypothesis) const {
    const auto& laws = options_.excluded_laws;
    return std::find(laws.begin(), laws.end(), hypothesis.law) != laws.end();
  }

  // All hypotheses but those that are excluded, only named or, unless repeatable, in the fit already.
  [[nodiscard]] std::vector<std::size_t> open_hypotheses(const ExtendedFit& fit) const {
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < problem_.hypotheses().size(); ++i) {
      const auto present = [i](const FittedLaw& law) { return law.hypothesis == i; };
      const Hypothesis& hypothesis = problem_.hypotheses()[i];
      if (hypothesis.only_named || is_excluded(hypothesis)) continue;
      if (hypothesis.repeatable || std::none_of(fit.laws.begin(), fit.laws.end(), present)) {
        open.push_back(i);
      }
    }
    return open;
  }

  ScoreTable rank(const ExtendedFit& fit, int draws) {
    ScoreTable table = problem_.scores(fit, open_hypotheses(fit), draws, options_.seed);
    const double cost = std::log(problem_.sample_count());
    const auto gain = [cost](const HypothesisScore& score) {
      return score.score.statistic - cost * score.score.degrees_of_freedom;
    };
    std::stable_sort(
        table.scores.begin(), table.scores.end(),
        [&](const HypothesisScore& a, const HypothesisScore& b) { return gain(a) > gain(b); });
    return table;
  }

  void detect() {
    proceed("testing all hypotheses");
    // Half the level must lie within the draws' minima.
    const int needed = static_cast<int>(std::ceil(2.0 / options_.level));
    ScoreTable table = rank(result_.before, std::max(options_.null_draws, needed));
    Detection& detection = result_.detection;
    for (const HypothesisScore& score : table.scores) {
      detection.smallest_p_value = std::min(detection.smallest_p_value, score.score.p_value);
    }
    double share = options_.level;
    if (problem_.noise_is_known()) {
      share = 0.5 * options_.level;
      const Assessment& fitted = result_.before.estimation;
      detection.lack_of_fit_p_value = chi_square_tail(fitted.chi_square, fitted.degrees_of_freedom);
    }
    detection.threshold = table.scores.empty() ? 0.0 : family_threshold(table.null_minima, share);
    const std::optional<double> structure = problem_.remaining_structure(result_.before);
    detection.detected = detection.lack_of_fit_p_value < 0.5 * options_.level ||
                         detection.smallest_p_value < detection.threshold ||
                         (structure && *structure > options_.structure_tolerance);
    list_detectable(table);
    result_.ranking = table.scores;
  }

  // The amplitude at which the score test of that hypothesis alone is below the family-wise threshold
  // with the stated power.
  void list_detectable(const ScoreTable& table) {
    if (!(result_.detection.threshold > 0.0)) return;
    for (const HypothesisScore& score : table.scores) {
      DetectableEffect effect{score.start.hypothesis, std::numeric_limits<double>::infinity(),
                              score.amplitude_unit};
      if (score.score.degrees_of_freedom > 0.0) {
        effect.amplitude = score.amplitude_deviation *
                           std::sqrt(required_noncentrality(score.score.degrees_of_freedom));
      }
      result_.detectable.push_back(std::move(effect));
    }
  }

  [[nodiscard]] double required_noncentrality(double degrees_of_freedom) const {
    const double threshold =
        chi_square_quantile(1.0 - std::max(result_.detection.threshold, 1e-15), degrees_of_freedom);
    double low = 0.0;
    double high = 4.0 * (threshold + 10.0);
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      const double power = noncentral_chi_square_tail(threshold, degrees_of_freedom, middle);
      (power < options_.detection_power ? low : high) = middle;
    }
    return high;
  }

  // The best of the ranking, and besides the best law of each of the best places: laws at one place
  // crowd each other's neighbours out.
  [[nodiscard]] std::vector<LawStart> shortlist(const ScoreTable& table) const {
    std::vector<LawStart> chosen;
    std::set<std::string> places;
    const std::size_t crowd = std::max<std::size_t>(1, options_.shortlist / 2);
    for (const HypothesisScore& score : table.scores) {
      if (chosen.size() >= options_.shortlist) break;
      if (score.score.degrees_of_freedom == 0.0 || score.start.parameters.empty()) continue;
      const std::string& place = problem_.hypotheses()[score.start.hypothesis].place;
      if (chosen.size() < crowd || places.count(place) == 0) {
        chosen.push_back(score.start);
        places.insert(place);
      }
    }
    return chosen;
  }

  // Rivals of an effect are often what was tried when it was found.
  const ExtendedFit& refit(const std::vector<LawStart>& laws, const ExtendedFit& nearby) {
    const auto known = std::ranges::find(refits_, laws, &Refit::laws);
    if (known != refits_.end()) return known->fit;
    return refits_.emplace_back(Refit{laws, problem_.fit(laws, &nearby)}).fit;
  }

  std::vector<Trial> refit_each(const std::vector<LawStart>& kept,
                                const std::vector<LawStart>& candidates,
                                const ExtendedFit& nearby) {
    std::vector<Trial> trials;
    for (const LawStart& candidate : candidates) {
      if (!proceed("refitting with " + name_of(candidate.hypothesis))) break;
      std::vector<LawStart> laws = kept;
      laws.push_back(candidate);
      Trial trial{candidate.hypothesis, refit(laws, nearby)};
      if (trial.fit.usable) trials.push_back(std::move(trial));
    }
    std::stable_sort(trials.begin(), trials.end(),
                     [&](const Trial& a, const Trial& b) { return bic(a.fit) < bic(b.fit); });
    return trials;
  }

  // Whether the deviance falls by more than chance allows for the best of all hypotheses
  // (Bonferroni), and prediction gains by it.
  [[nodiscard]] bool significant(const ExtendedFit& without, const ExtendedFit& with) const {
    if (!problem_.noise_is_known() &&
        !(with.cross_validation <
          (1.0 - options_.cross_validation_gain) * without.cross_validation)) {
      return false;
    }
    if (with.parameter_count <= without.parameter_count) return with.deviance < without.deviance;
    const double added = static_cast<double>(with.parameter_count - without.parameter_count);
    const double count = static_cast<double>(problem_.hypotheses().size());
    return chi_square_tail(without.deviance - with.deviance, added) < options_.level / count;
  }

  [[nodiscard]] std::size_t effect_limit() const {
    if (options_.effect_limit > 0) return options_.effect_limit;
    return problem_.noise_is_known() ? 4 : 12;
  }

  [[nodiscard]] bool rest_is_noise(const ExtendedFit& fit) const {
    return problem_.noise_is_known() &&
           chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom) >=
               options_.verification_level;
  }

  void extend() {
    ScoreTable table;
    table.scores = result_.ranking;
    while (result_.after.laws.size() < effect_limit() && !result_.interrupted) {
      if (!result_.after.laws.empty()) {
        if (rest_is_noise(result_.after)) return;
        if (!proceed("testing all hypotheses again")) return;
        table = rank(result_.after, 0);
      }
      const std::vector<Trial> trials =
          refit_each(starts_of(result_.after), shortlist(table), result_.after);
      const auto best = std::find_if(trials.begin(), trials.end(), [this](const Trial& trial) {
        return significant(result_.after, trial.fit);
      });
      if (best == trials.end()) return;
      result_.after = best->fit;
    }
  }

  [[nodiscard]] ExtendedFit fit_without(const ExtendedFit& fit, std::size_t law) const {
    std::vector<LawStart> laws = starts_of(fit);
    laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(law));
    return laws.empty() ? result_.before : problem_.fit(laws, &fit);
  }

  void prune() {
    for (std::size_t law = 0; law < result_.after.laws.size() && result_.after.laws.size() > 1;) {
      if (!proceed("leaving out " + name_of(result_.after.laws[law].hypothesis))) return;
      ExtendedFit without = fit_without(result_.after, law);
      if (without.usable && bic(without) <= bic(result_.after)) {
        result_.after = std::move(without);
        law = 0;
      } else {
        ++law;
      }
    }
  }

  // A law that only generalises another of fewer parameters gives way to it unless it is better beyond
  // the margin.
  void simplify() {
    for (std::size_t law = 0; law < result_.after.laws.size(); ++law) {
      const Hypothesis& richer = problem_.hypotheses()[result_.after.laws[law].hypothesis];
      if (richer.special_cases.empty()) continue;
      const ExtendedFit without = fit_without(result_.after, law);
      if (!without.usable) continue;
      std::vector<LawStart> plainer;
      for (const HypothesisScore& score : rank(without, 0).scores) {
        const Hypothesis& candidate = problem_.hypotheses()[score.start.hypothesis];
        if (is_special_case(candidate, richer) && !score.start.parameters.empty()) {
          plainer.push_back(score.start);
        }
      }
      const std::vector<Trial> trials = refit_each(starts_of(without), plainer, without);
      if (!trials.empty() && trials.front().fit.parameter_count < result_.after.parameter_count &&
          bic(trials.front().fit) <= bic(result_.after) + options_.exclusion_margin) {
        result_.after = trials.front().fit;
        law = static_cast<std::size_t>(-1);  // the others stand in another order now
      }
    }
  }

  static bool is_special_case(const Hypothesis& plain, const Hypothesis& richer) {
    return richer.place == plain.place &&
           std::count(richer.special_cases.begin(), richer.special_cases.end(), plain.law) > 0;
  }

  void weigh_rivals() {
    for (std::size_t law = 0; law < result_.after.laws.size(); ++law) {
      FoundEffect effect;
      effect.law = result_.after.laws[law];
      const ExtendedFit without = fit_without(result_.after, law);
      if (without.usable) {
        effect.bic_difference = bic(without) - bic(result_.after);
        effect.explained_share = share_explained(without, result_.after);
        weigh_rivals_of(effect, without);
      }
      add_twins(effect);
      result_.effects.push_back(std::move(effect));
    }
  }

  static double share_explained(const ExtendedFit& without, const ExtendedFit& with) {
    const double excess = without.estimation.chi_square - without.estimation.degrees_of_freedom;
    const double gain = without.estimation.chi_square - with.estimation.chi_square;
    return excess > gain ? gain / excess : 1.0;
  }

  void weigh_rivals_of(FoundEffect& effect, const ExtendedFit& without) {
    if (!proceed("weighing rivals of " + name_of(effect.law.hypothesis))) return;
    std::vector<LawStart> candidates;
    ScoreTable table;
    table.scores = result_.ranking;
    if (!without.laws.empty()) table = rank(without, 0);
    for (const LawStart& start : shortlist(table)) {
      if (start.hypothesis != effect.law.hypothesis) candidates.push_back(start);
    }
    const double best = bic(result_.after);
    for (const Trial& trial : refit_each(starts_of(without), candidates, without)) {
      Rival rival{trial.fit.laws.back(), bic(trial.fit) - best, {}};
      if (rival.bic_difference > options_.exclusion_margin) {
        effect.excluded.push_back(std::move(rival));
      } else if (!generalises(trial, effect.law)) {
        if (effect.rivals.empty()) rival.next = experiment_against(trial);
        effect.rivals.push_back(std::move(rival));
      }
    }
  }

  std::optional<NextExperiment> experiment_against(const Trial& rival) {
    if (!proceed("designing the experiment that excludes " + name_of(rival.hypothesis))) return {};
    const auto experiments = problem_.experiments_between(result_.after, rival.fit);
    if (!experiments) return {};
    try {
      return next_experiment(*experiments, options_.exclusion_margin);
    } catch (const InputError&) {
      return {};  // no experiment of this kind sees all parameters of the rival: no reason to end here
    }
  }

  void add_twins(FoundEffect& effect) const {
    std::vector<Rival> members{{effect.law, 0.0}};
    members.insert(members.end(), effect.rivals.begin(), effect.rivals.end());
    for (const Rival& member : members) {
      for (const std::size_t twin : problem_.hypotheses()[member.law.hypothesis].twins) {
        if (is_excluded(problem_.hypotheses()[twin])) continue;
        effect.rivals.push_back({{twin, {}}, member.bic_difference});
      }
    }
  }

  [[nodiscard]] bool generalises(const Trial& trial, const FittedLaw& law) const {
    return is_special_case(problem_.hypotheses()[law.hypothesis],
                           problem_.hypotheses()[trial.hypothesis]);
  }

  void verify() {
    result_.validation_after = problem_.validate(result_.after);
    result_.mismatch_after = problem_.mismatch(result_.after);
    result_.curves_after = problem_.residual_curves(result_.after);
    if (!result_.after.laws.empty()) result_.pictures = problem_.force_pictures(result_.after);
    const Assessment& judged =
        result_.validation_after ? *result_.validation_after : result_.after.estimation;
    if (!problem_.noise_is_known()) {
      verify_without_noise();
      return;
    }
    result_.rest_p_value = practical_size_p_value(judged, options_.tolerance);
    result_.verified = result_.rest_p_value >= options_.verification_level;
  }

  void verify_without_noise() {
    result_.remaining_structure = problem_.remaining_structure(result_.after);
    const bool generalises =
        !result_.validation_after ||
        result_.validation_after->nrmse <= options_.generalisation * result_.after.estimation.nrmse;
    result_.verified = generalises && result_.remaining_structure &&
                       *result_.remaining_structure <= options_.structure_tolerance;
  }

  void conclude() {
    if (!result_.detection.detected) {
      result_.verdict = Verdict::kNone;
    } else if (result_.effects.empty() || !result_.verified) {
      result_.verdict = Verdict::kUnknown;
    } else {
      const auto has_rivals = [](const FoundEffect& effect) { return !effect.rivals.empty(); };
      result_.verdict = std::any_of(result_.effects.begin(), result_.effects.end(), has_rivals)
                            ? Verdict::kAmbiguous
                            : Verdict::kExplained;
    }
  }

  const MismatchProblem& problem_;
  const SearchOptions& options_;
  Diagnosis result_;
  std::vector<Refit> refits_;
};

}  // namespace

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return "none";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kUnknown:
      break;
  }
  return "unknown";
}

double practical_size_p_value(const Assessment& assessment, double tolerance) {
  return noncentral_chi_square_tail(assessment.chi_square, assessment.degrees_of_freedom,
                                    tolerance * assessment.degrees_of_freedom);
}

Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options) {
  return Search(problem, options).run();
}

}  // namespace graybox
