#include "graybox/diagnosis/hypotheses/diagnosis_search.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "graybox/diagnosis/hypotheses/candidate_refits.hpp"
#include "graybox/diagnosis/hypotheses/fit_comparison.hpp"
#include "graybox/problems/distributions.hpp"
#include "graybox/problems/error.hpp"

namespace graybox {
namespace {

// Fits of the model as it is after the first, each from so many refits; what must come of it.
constexpr int kFirstFits = 3;
constexpr std::size_t kTriedTrials = 3;
constexpr double kShortOfOptimum = 1.0;  // of the deviance
constexpr double kStillMissing = 0.5;    // of what chi-square has too much

// Share of the best score statistic that makes a law worth a refit: at the same place, and anywhere.
constexpr double kRelative = 0.7;
constexpr double kEqual = 0.97;

// One law at two places is the same to every experiment of a kind where fits with it differ by no more
// than the first in deviance (they stop where a step gains a tenth), and where with the best further
// experiment the two would be no farther apart than the second: about 20 excludes a rival
// (next_experiment.hpp), so a thousand times the recordings would be needed.
constexpr double kSameDeviance = 1.0;
constexpr double kSameDistance = 0.02;

// A small law beside others must explain this share of what the largest explains: no law of a catalogue
// describes a real force to better than some three per cent, a thousandth in chi-square.
constexpr double kImperfection = 1e-3;

// Candidates for such a law; and how much more a refit may gain than the score test at the best shape promises.
constexpr std::size_t kSmallShortlist = 3;
constexpr double kOptimism = 3.0;

// With m laws that may still come, one of them explains an m-th of what is left, or about: where the best
// does not explain this share of an m-th, all of them together won't, and they only stand in for one that
// is not in the catalogue.
constexpr double kShareOfAnMth = 0.5;

// What the fit's own recordings may show beyond the noise, as a multiple of what others may: free motion is
// taken out of recordings with the model as it was.
constexpr double kFitTolerance = 2.0;

// Of -2 log evidence: less in favour of a law that generalises another is "not worth more than a bare mention" (Kass and
// Raftery, J. Am. Stat. Assoc. 90, 1995).
constexpr double kAskedFor = 2.0;

// Laws that generalise the one found, beside those that the ranking brings.
constexpr int kMoreGeneral = 2;

// Laws that may come together where none does by itself.
constexpr std::size_t kGroup = 4;

// Names of an effect, up to which generalisations are among them: more names say less.
constexpr std::size_t kNames = 3;

// Times that laws which only resemble what is there are weighed again: with all laws at their places, and with another besides.
constexpr int kShapeRounds = 4;

// Exchanges of laws for better ones where the noise is known; each lowers BIC.
constexpr int kExchanges = 4;

class Search {
 public:
  Search(const MismatchProblem& problem, const SearchOptions& options)
      : problem_(&problem),
        options_(options),
        compare_(problem, options),
        refits_(problem, options, [this](const std::string& step) { return proceed(step); }) {}

  Diagnosis run() {
    result_.noise_is_known = problem_->noise_is_known();
    if (!options_.ignore_channel_faults && has_channel_faults()) return std::move(result_);
    if (!fit_as_it_is()) return std::move(result_);
    detect();
    while (result_.detection.detected && fit_better()) detect();
    if (result_.detection.detected) {
      extend();
      prune();
      simplify();
      if (!problem_->noise_is_known()) {
        exchange();
        prune();  // beside laws made plainer another may no longer be missed
      }
      weigh_rivals();
    }
    verify();
    look_for_departures();
    look_for_change();
    conclude();
    return std::move(result_);
  }

 private:
  bool proceed(const std::string& step) {
    if (!result_.interrupted && options_.proceed && !options_.proceed(step)) {
      result_.interrupted = true;
    }
    return !result_.interrupted;
  }

  [[nodiscard]] std::string name_of(std::size_t hypothesis) const {
    return graybox::name_of(problem_->hypotheses()[hypothesis]);
  }

  bool has_channel_faults() {
    proceed("checking wires, signs and units");
    result_.channel_faults = problem_->channel_faults();
    if (result_.channel_faults.empty()) return false;
    result_.trouble = "the recordings are not what the channels say";
    return true;
  }

  bool fit_as_it_is() {
    proceed("fitting the model as it is");
    result_.before = problem_->fit({}, nullptr);
    if (!result_.before.usable) {
      result_.after = result_.before;
      result_.trouble = "the model as it is can't be fitted: " + result_.before.trouble;
      return false;
    }
    describe_fit_as_it_is();
    return true;
  }

  // What looks like missing physics may be a fit that stopped short of its optimum. With a law more the
  // parameters have come elsewhere: from there the model alone is fitted once more.
  bool fit_better() {
    if (!problem_->noise_is_known() || first_fits_ == kFirstFits) return false;
    ++first_fits_;
    ScoreTable table;
    table.scores = result_.ranking;
    const std::vector<Trial> trials = refits_.refit_each({}, shortlist(table), result_.before);
    // The parameters of a law that explains all are the right ones, if any are.
    const bool is_explained = !trials.empty() && compare_.rest_is_noise(trials.front().fit);
    if (is_explained && stays_far_off_on_few(trials.front().fit)) return false;
    const std::size_t tried = is_explained ? 1 : std::min(kTriedTrials, trials.size());
    ExtendedFit best = result_.before;
    for (std::size_t i = 0; i < tried; ++i) {
      if (!proceed("fitting the model as it is once more")) return false;
      ExtendedFit again = problem_->fit({}, &trials[i].fit);
      if (again.usable && again.deviance < best.deviance) best = std::move(again);
    }
    if (best.deviance > result_.before.deviance - kShortOfOptimum) return false;
    if (is_explained && stays_far_off(result_.before, best)) return false;
    result_.before = std::move(best);
    refits_.forget();
    renew();
    describe_fit_as_it_is();
    return true;
  }

  // There the model alone comes nowhere near: it was not the fit that stopped short.
  [[nodiscard]] static bool stays_far_off(const ExtendedFit& before, const ExtendedFit& again) {
    return excess(again) >
           std::max(kStillMissing * excess(before), again.estimation.degrees_of_freedom);
  }

  // The model alone, from the parameters of a law that explains all.
  bool stays_far_off_on_few(const ExtendedFit& with_law) {
    const std::optional<ExtendedFit> before = problem_->fit_to_few({}, result_.before);
    if (!before || !before->usable) return false;
    const std::optional<ExtendedFit> again = problem_->fit_to_few({}, with_law);
    return again && again->usable && stays_far_off(*before, *again);
  }

  // A first fit that stopped far from the recordings could not free them of the plant's free motion.
  void renew() {
    std::unique_ptr<MismatchProblem> problem = problem_->renewed(result_.before);
    if (problem == nullptr) return;
    ExtendedFit fit = problem->fit({}, nullptr);
    if (!fit.usable) return;
    go_on_with(std::move(problem));
    result_.before = std::move(fit);
  }

  void go_on_with(std::unique_ptr<MismatchProblem> problem) {
    compare_ = FitComparison(*problem, options_);
    refits_.start_anew(*problem);
    problem_ = problem.get();
    renewed_ = std::move(problem);
  }

  // With laws that were found, before more of them are looked for: where the model alone did not come
  // near enough to the recordings to free them of the plant's free motion, or the laws bend that, what
  // they leave may be free motion. Not where the fit becomes no better by that: laws may meet free motion
  // in ways that its modes do not describe. Once; of many recordings, where that takes as long as all the
  // rest, not where what is left is no more than noise.
  bool renew_with_laws() {
    if (tried_to_renew_ || !problem_->noise_is_known()) return false;
    if (!proceed("taking free motion out with what was found")) return false;
    std::unique_ptr<MismatchProblem> problem = problem_->renewed(result_.after);
    if (problem == nullptr) return false;
    tried_to_renew_ = true;
    ExtendedFit before = problem->fit({}, &result_.before);
    ExtendedFit after = problem->fit(starts_of(result_.after), &result_.after);
    if (!after.usable && !after.laws.empty()) after = problem->fit(starts_of(after), &after);
    if (!before.usable || !after.usable ||
        after.estimation.chi_square_per_dof() >= result_.after.estimation.chi_square_per_dof()) {
      return false;
    }
    keep_far_behind();
    go_on_with(std::move(problem));
    result_.before = std::move(before);
    describe_fit_as_it_is();
    detect();
    result_.detection.detected = true;  // it was, and of that there is a law now
    result_.after = std::move(after);
    return true;
  }

  // Rivals of a single law that leave more than the noise's own chi-square beside it: free motion is not that much.
  void keep_far_behind() {
    if (result_.after.laws.size() != 1) return;
    ahead_ = result_.after.laws.front().hypothesis;
    for (const Refit& known : refits_.known()) {
      const ExtendedFit& fit = known.fit;
      if (!fit.usable || fit.laws.size() != 1 || fit.laws.front().hypothesis == ahead_) continue;
      far_behind_.push_back({.law = fit.laws.front(),
                             .bic_difference = compare_.bic(fit) - compare_.bic(result_.after),
                             .evidence_difference = evidence(fit) - evidence(result_.after),
                             .on_other_noise = true});
    }
    // The best fit with each counts.
    std::ranges::stable_sort(far_behind_, {}, &Rival::bic_difference);
    std::set<std::size_t> seen;
    std::erase_if(far_behind_, [&](const Rival& rival) {
      return !seen.insert(rival.law.hypothesis).second ||
             rival.bic_difference <= result_.after.estimation.degrees_of_freedom;
    });
  }

  // Behind the law found, before recordings were freed of more: excluded by that.
  bool was_far_behind(std::size_t hypothesis, std::size_t found, std::vector<Rival>& excluded) {
    if (found != ahead_ || hypothesis == found) return false;
    const auto behind = std::ranges::find(far_behind_, hypothesis,
                                          [](const Rival& rival) { return rival.law.hypothesis; });
    if (behind == far_behind_.end()) return false;
    excluded.push_back(*behind);
    return true;
  }

  void describe_fit_as_it_is() {
    result_.after = result_.before;
    result_.mismatch_before = problem_->mismatch(result_.before);
    result_.curves_before = problem_->residual_curves(result_.before);
    result_.validation_before = problem_->validate(result_.before);
  }

  [[nodiscard]] bool is_excluded(const Hypothesis& hypothesis) const {
    const auto& laws = options_.excluded_laws;
    return std::find(laws.begin(), laws.end(), hypothesis.law) != laws.end();
  }

  [[nodiscard]] bool is_closed(const Hypothesis& hypothesis) const {
    return hypothesis.is_compound && !compounds_are_open_;
  }

  // All hypotheses but those that are excluded, closed, only named or, unless repeatable, in the fit
  // already.
  [[nodiscard]] std::vector<std::size_t> open_hypotheses(const ExtendedFit& fit) const {
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < problem_->hypotheses().size(); ++i) {
      const auto present = [i](const FittedLaw& law) { return law.hypothesis == i; };
      const Hypothesis& hypothesis = problem_->hypotheses()[i];
      if (hypothesis.only_named || is_excluded(hypothesis) || is_closed(hypothesis)) continue;
      if (hypothesis.repeatable || std::none_of(fit.laws.begin(), fit.laws.end(), present)) {
        open.push_back(i);
      }
    }
    return open;
  }

  ScoreTable rank(const ExtendedFit& fit, int draws) {
    ScoreTable table = problem_->scores(fit, open_hypotheses(fit), draws, options_.seed);
    const double cost = std::log(problem_->sample_count());
    const auto gain = [cost](const HypothesisScore& score) {
      return score.score.statistic - cost * score.score.degrees_of_freedom;
    };
    std::stable_sort(
        table.scores.begin(), table.scores.end(),
        [&](const HypothesisScore& a, const HypothesisScore& b) { return gain(a) > gain(b); });
    return table;
  }

  // Where the noise is not known; where it is, there is a test.
  [[nodiscard]] bool looks_like_noise(const std::optional<double>& structure,
                                      const std::optional<double>& autocorrelated_error) const {
    return structure.value_or(0.0) <= options_.structure_tolerance &&
           autocorrelated_error.value_or(0.0) <= options_.autocorrelation_tolerance;
  }

  void detect() {
    proceed("testing all hypotheses");
    // Half the level must lie within the draws' minima.
    const int needed = static_cast<int>(std::ceil(2.0 / options_.level));
    ScoreTable table = rank(result_.before, std::max(options_.null_draws, needed));
    result_.detection = {};
    result_.detectable.clear();
    Detection& detection = result_.detection;
    for (const HypothesisScore& score : table.scores) {
      detection.smallest_p_value = std::min(detection.smallest_p_value, score.score.p_value);
    }
    double share = options_.level;
    if (problem_->noise_is_known()) {
      share = 0.5 * options_.level;
      const Assessment& fitted = result_.before.estimation;
      detection.lack_of_fit_p_value = chi_square_tail(fitted.chi_square, fitted.degrees_of_freedom);
    }
    detection.threshold = table.scores.empty() ? 0.0 : family_threshold(table.null_minima, share);
    detection.detected = detection.lack_of_fit_p_value < 0.5 * options_.level ||
                         detection.smallest_p_value < detection.threshold ||
                         !looks_like_noise(problem_->remaining_structure(result_.before),
                                           problem_->autocorrelated_error(result_.before));
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

  [[nodiscard]] bool can_be_refitted(const HypothesisScore& score) const {
    return score.score.degrees_of_freedom > 0.0 && !score.start.parameters.empty() &&
           !is_closed(problem_->hypotheses()[score.start.hypothesis]);
  }

  // The best of the ranking, and besides the best law of each of the best places: laws at one place
  // crowd each other's neighbours out. Where the noise is known, laws besides that come close to the best at
  // its place, or as good as equal it anywhere: which of them it is only refits can tell.
  [[nodiscard]] std::vector<LawStart> shortlist(const ScoreTable& table) const {
    std::vector<LawStart> chosen;
    std::set<std::string> places;
    const HypothesisScore* best = nullptr;
    const std::size_t crowd = std::max<std::size_t>(1, options_.shortlist / 2);
    std::size_t relatives = 0;
    for (const HypothesisScore& score : table.scores) {
      if (!can_be_refitted(score)) continue;
      if (best == nullptr) best = &score;
      const std::string& place = place_of(score);
      const bool has_room = chosen.size() < options_.shortlist + relatives;
      if (has_room && (chosen.size() < crowd || places.count(place) == 0)) {
        chosen.push_back(score.start);
        places.insert(place);
      } else if (problem_->noise_is_known() && relatives < crowd &&
                 score.score.statistic >
                     (place == place_of(*best) ? kRelative : kEqual) * best->score.statistic) {
        chosen.push_back(score.start);
        ++relatives;
      }
    }
    return chosen;
  }

  // Laws for what is still missing where the rest is no more than noise. Score tests are exact for small effects:
  // only those that come close to the best are in question, if any of them may stand out.
  [[nodiscard]] std::vector<LawStart> small_shortlist(const ScoreTable& table) const {
    const double enough = std::max(kRelative * table.scores.front().score.statistic,
                                   enough_to_stand_out() / kOptimism);
    std::vector<LawStart> chosen;
    for (const HypothesisScore& score : table.scores) {
      if (chosen.size() == kSmallShortlist) break;
      if (can_be_refitted(score) && score.score.statistic >= enough) chosen.push_back(score.start);
    }
    return chosen;
  }

  // Where there are fewer places than room, with the next best at any: laws that are nearly alike must not
  // keep all others of a single axis out. Whether there were any.
  bool fill_up(const ScoreTable& table, std::vector<LawStart>& chosen) const {
    const std::size_t before = chosen.size();
    for (const HypothesisScore& score : table.scores) {
      if (chosen.size() >= options_.shortlist) break;
      if (!can_be_refitted(score)) continue;
      if (std::ranges::find(chosen, score.start) == chosen.end()) chosen.push_back(score.start);
    }
    return chosen.size() > before;
  }

  [[nodiscard]] const std::string& place_of(const HypothesisScore& score) const {
    return problem_->hypotheses()[score.start.hypothesis].place;
  }

  // Of the fit's recordings and those kept out, up to a constant.
  [[nodiscard]] double evidence_of_all(const ExtendedFit& fit) const {
    return evidence(fit) + compare_.held_out_difference(fit, result_.after).value_or(0.0);
  }

  [[nodiscard]] std::size_t effect_limit() const {
    if (options_.effect_limit > 0) return options_.effect_limit;
    return problem_->noise_is_known() ? 4 : 24;
  }

  void extend() {
    compounds_are_open_ = !result_.after.laws.empty();
    add_laws();
    compounds_are_open_ = true;
  }

  void add_laws() {
    ScoreTable table;
    table.scores = result_.ranking;
    while (result_.after.laws.size() < effect_limit() && !result_.interrupted) {
      bool is_small = false;  // what may still be missing
      if (!result_.after.laws.empty()) {
        if (!proceed("testing all hypotheses again")) return;
        table = rank(result_.after, 0);
        is_small = compare_.rest_is_noise(result_.after);
        if (is_small && !points_elsewhere(table)) return;
        if (!(is_small && problem_->has_few()) && renew_with_laws()) continue;
      }
      const std::vector<LawStart> kept = starts_of(result_.after);
      std::vector<LawStart> candidates = is_small ? small_shortlist(table) : shortlist(table);
      // Few recordings can't tell small laws apart.
      std::vector<Trial> trials =
          is_small ? refits_.refit_to_all(each_beside(kept, candidates), result_.after)
                   : refits_.refit_each(kept, candidates, result_.after);
      const Trial* best = choose(result_.after, trials);
      if (best == nullptr && !problem_->noise_is_known() && fill_up(table, candidates)) {
        trials = refits_.refit_each(kept, candidates, result_.after);
        best = choose(result_.after, trials);
      }
      if (best == nullptr && !problem_->noise_is_known()) {
        if (std::optional<ExtendedFit> group = group_of_laws(trials)) {
          result_.after = *std::move(group);
          continue;
        }
      }
      if (is_small && (best == nullptr || !stands_out(best->fit))) return;
      if (best == nullptr && compounds_are_open_) return;
      if (best == nullptr) {
        compounds_are_open_ = true;
        continue;
      }
      if (is_hopeless(best->fit)) return;
      result_.after = best->fit;
    }
  }

  // Where the noise is not known and no law by itself predicts: a few that do so together. What one gains
  // drowns in what the others have not explained yet (the harmonics of a ripple). Beside the others each must
  // pass the test for a single law.
  std::optional<ExtendedFit> group_of_laws(std::vector<Trial> trials) {
    ExtendedFit with = result_.after;
    for (std::size_t size = 1; size <= kGroup && with.laws.size() < effect_limit(); ++size) {
      if (trials.empty() || held_out_gain(with, trials.front().fit).mean < options_.held_out_gain) {
        return {};
      }
      with = std::move(trials.front().fit);
      if (size > 1 && each_is_missed(with, result_.after.laws.size())) return with;
      trials = refits_.refit_each(starts_of(with), shortlist(rank(with, 0)), with);
    }
    return {};
  }

  // Each law from this one on.
  [[nodiscard]] bool each_is_missed(const ExtendedFit& with, std::size_t first) {
    if (!compare_.predicts_better(result_.after, with, options_.held_out_errors)) return false;
    for (std::size_t law = first; law < with.laws.size(); ++law) {
      const ExtendedFit without = fit_without(with, law);
      if (!without.usable || !compare_.stands_by_itself(without, with, law) ||
          !compare_.predicts_better(without, with, options_.held_out_errors)) {
        return false;
      }
    }
    return true;
  }

  [[nodiscard]] bool is_hopeless(const ExtendedFit& with) const {
    const Assessment& left = result_.after.estimation;
    if (!problem_->noise_is_known() ||
        practical_size_p_value(left, options_.tolerance) >= options_.verification_level) {
      return false;
    }
    const auto still_to_come = static_cast<double>(effect_limit() - result_.after.laws.size());
    return left.chi_square - with.estimation.chi_square <
           kShareOfAnMth * excess(result_.after) / still_to_come;
  }

  // A small effect beside a large one drowns in the chi-square of all residuals where a test aimed at it
  // still sees it. At a place that has its law, though, what is left is first of all that law's own
  // imperfection.
  [[nodiscard]] bool points_elsewhere(const ScoreTable& table) const {
    if (table.scores.empty()) return false;
    const HypothesisScore& best = table.scores.front();
    const auto is_there = [&](const FittedLaw& law) {
      return problem_->hypotheses()[law.hypothesis].place == place_of(best);
    };
    const auto count = static_cast<double>(problem_->hypotheses().size());
    return best.score.p_value < options_.level / count &&
           std::ranges::none_of(result_.after.laws, is_there);
  }

  // A law more than those found so far, though what these leave is no more than noise.
  [[nodiscard]] bool stands_out(const ExtendedFit& with) const {
    return compare_.bic(result_.after) - compare_.bic(with) > enough_to_stand_out();
  }

  // Of BIC.
  [[nodiscard]] double enough_to_stand_out() const {
    const double before = compare_.bic(result_.before) - compare_.bic(result_.after);
    return std::max(options_.exclusion_margin, kImperfection * before);
  }

  [[nodiscard]] const std::string& place_of(const FittedLaw& law) const {
    return problem_->hypotheses()[law.hypothesis].place;
  }

  [[nodiscard]] const std::string& place_of(const Trial& trial) const {
    return problem_->hypotheses()[trial.hypothesis].place;
  }

  // The best of those that are significant. Where the noise is known, another where recordings kept out contradict that
  // one; else the one of fewest parameters among those at its place that it does not excel (the rule of one standard
  // error: Breiman and others 1984).
  [[nodiscard]] const Trial* choose(const ExtendedFit& without,
                                    const std::vector<Trial>& trials) const {
    const Trial* best = nullptr;
    const ExtendedFit* top = nullptr;
    for (const Trial& trial : trials) {
      if (!compare_.significant(without, trial.fit)) continue;
      if (problem_->noise_is_known() && compare_.bic(trial.fit) >= compare_.bic(without)) continue;
      if (best == nullptr) {
        best = &trial;
        top = &trial.fit;
        if (problem_->noise_is_known() && !compare_.is_contradicted(trial.fit)) break;
        continue;
      }
      if (problem_->noise_is_known()) {
        if (!compare_.contradicts(best->fit, trial.fit)) continue;
        best = &trial;
        break;
      }
      const HeldOutGain gain = held_out_gain(trial.fit, *top);
      if (place_of(trial) == place_of(*best) &&
          trial.fit.parameter_count < best->fit.parameter_count &&
          gain.mean <= gain.standard_error) {
        best = &trial;
      }
    }
    return best;
  }

  // From the parameters that the fit has with the law and, where the noise is known, anew from those without
  // any law and from the laws as they were ranked first: a law that stood in for another may have pulled
  // all of them far off.
  [[nodiscard]] ExtendedFit fit_without(const ExtendedFit& fit, std::size_t law) {
    std::vector<LawStart> laws = starts_of(fit);
    laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(law));
    if (laws.empty()) return result_.before;
    ExtendedFit best = refits_.refit(laws, fit);
    if (!problem_->noise_is_known()) return best;
    for (LawStart& start : laws) {
      const auto ranked =
          std::ranges::find(result_.ranking, start.hypothesis,
                            [](const auto& score) { return score.start.hypothesis; });
      if (ranked != result_.ranking.end() && !ranked->start.parameters.empty()) {
        start = ranked->start;
      }
    }
    const ExtendedFit other = refits_.refit(laws, result_.before);
    if (is_better(other, best)) best = other;
    // Laws can't make a fit worse than it is without any: that one began in another valley.
    if (!best.usable || best.deviance > result_.before.deviance) {
      const ExtendedFit afresh = refits_.refit(laws, {});
      if (is_better(afresh, best)) best = afresh;
    }
    return best;
  }

  static bool is_better(const ExtendedFit& fit, const ExtendedFit& than) {
    return fit.usable && (!than.usable || fit.deviance < than.deviance);
  }

  void prune() {
    for (std::size_t law = 0; law < result_.after.laws.size() && result_.after.laws.size() > 1;) {
      if (!proceed("leaving out " + name_of(result_.after.laws[law].hypothesis))) return;
      ExtendedFit without = fit_without(result_.after, law);
      if (without.usable && is_superfluous(without)) {
        result_.after = std::move(without);
        law = 0;
      } else {
        ++law;
      }
    }
  }

  // Where the noise is known, so is a law that is not better beyond the margin, if what is left without
  // it is no more than noise.
  [[nodiscard]] bool is_superfluous(const ExtendedFit& without) const {
    if (!problem_->noise_is_known()) {
      return !compare_.predicts_better(without, result_.after, kExclusionErrors);
    }
    const double margin = compare_.rest_is_noise(without) ? options_.exclusion_margin : 0.0;
    return compare_.bic(without) <= compare_.bic(result_.after) + margin;
  }

  // A law that only generalises another of fewer parameters gives way to it unless it is better beyond
  // the margin.
  void simplify() {
    for (std::size_t law = 0; law < result_.after.laws.size(); ++law) {
      const Hypothesis& richer = problem_->hypotheses()[result_.after.laws[law].hypothesis];
      if (richer.special_cases.empty()) continue;
      const ExtendedFit without = fit_without(result_.after, law);
      if (!without.usable) continue;
      std::vector<LawStart> plainer;
      for (const HypothesisScore& score : rank(without, 0).scores) {
        const Hypothesis& candidate = problem_->hypotheses()[score.start.hypothesis];
        if (is_special_case(candidate, richer) && !score.start.parameters.empty()) {
          plainer.push_back(score.start);
        }
      }
      const std::vector<Trial> trials = refits_.refit_each(starts_of(without), plainer, without);
      if (!trials.empty() && trials.front().fit.parameter_count < result_.after.parameter_count &&
          !compare_.excludes(result_.after, trials.front().fit)) {
        result_.after = trials.front().fit;
        law = static_cast<std::size_t>(-1);  // the others stand in another order now
      }
    }
  }

  static bool is_special_case(const Hypothesis& plain, const Hypothesis& richer) {
    return richer.place == plain.place &&
           std::count(richer.special_cases.begin(), richer.special_cases.end(), plain.law) > 0;
  }

  // Laws found early stood in for several; once the others are there, another may fit better in
  // their place. Until none does; then further laws may be missing again.
  void exchange() {
    constexpr int kRounds = 12;
    for (int round = 0; round < kRounds && exchange_one(); ++round) {
      extend();
      prune();
      simplify();
    }
  }

  bool exchange_one() {
    for (std::size_t law = 0; law < result_.after.laws.size(); ++law) {
      const ExtendedFit without = fit_without(result_.after, law);
      if (!without.usable ||
          !proceed("exchanging " + name_of(result_.after.laws[law].hypothesis))) {
        continue;
      }
      std::vector<LawStart> candidates;
      for (const LawStart& start : shortlist(rank(without, 0))) {
        if (start.hypothesis != result_.after.laws[law].hypothesis) candidates.push_back(start);
      }
      const std::vector<Trial> trials = refits_.refit_each(starts_of(without), candidates, without);
      if (trials.empty() || !compare_.every_law_stands(trials.front().fit) ||
          !compare_.predicts_better(result_.after, trials.front().fit, options_.held_out_errors)) {
        continue;
      }
      result_.after = trials.front().fit;
      return true;
    }
    return false;
  }

  // Where one of several laws found one after another has a better rival now that the others are there,
  // the rival takes its place, and all are weighed again.
  void weigh_rivals() {
    forget_effects();
    // As many laws as may be, and what they leave is no noise: rivals are no likelier physics.
    result_.rivals_weighed =
        !problem_->noise_is_known() || result_.after.laws.size() < effect_limit() || rest_passes();
    int exchanges = 0;
    for (std::size_t law = 0; law < result_.after.laws.size(); ++law) {
      const auto weigh_again_with = [&](const ExtendedFit& fit) {
        result_.after = fit;
        forget_effects();
        law = static_cast<std::size_t>(-1);
      };
      FoundEffect effect;
      effect.law = result_.after.laws[law];
      const ExtendedFit without = fit_without(result_.after, law);
      // Beside what has taken another's place it may no longer be missed.
      if (exchanges > 0 && result_.after.laws.size() > 1 && without.usable &&
          is_superfluous(without)) {
        weigh_again_with(without);
        continue;
      }
      if (without.usable) {
        effect.bic_difference = compare_.disadvantage(without, result_.after);
        effect.explained_share = share_explained(without, result_.after);
      }
      if (result_.rivals_weighed) {
        std::vector<Rival> outpaced;
        const std::vector<Trial> trials = rivals_of(law, without, outpaced);
        const Trial* better = better_than_found(effect, trials);
        if (better != nullptr && exchanges++ < kExchanges) {
          weigh_again_with(better->fit);
          continue;
        }
        divide_rivals(effect, trials);
        std::ranges::move(outpaced, std::back_inserter(effect.excluded));
      }
      add_twins(effect);
      keep_best_generalisations(effect);
      result_.effects.push_back(std::move(effect));
    }
  }

  void forget_effects() {
    result_.effects.clear();
    class_fits_.clear();
  }

  // Of another law than the one found: which excludes that, with recordings kept out; else, of several, one that does
  // not merely generalise it, by BIC.
  [[nodiscard]] const Trial* better_than_found(const FoundEffect& effect,
                                               const std::vector<Trial>& trials) const {
    if (!problem_->noise_is_known()) return nullptr;
    const auto speaks = std::ranges::find_if(
        trials, [this](const Trial& trial) { return compare_.excludes(trial.fit, result_.after); });
    if (speaks != trials.end()) return &*speaks;
    if (result_.after.laws.size() < 2) return nullptr;
    const std::span<const Hypothesis> all = problem_->hypotheses();
    const Trial* best = nullptr;
    for (const Trial& trial : trials) {
      if (is_special_case(all[effect.law.hypothesis], all[trial.hypothesis])) continue;
      if (compare_.contradicts(trial.fit, result_.after)) continue;
      if (compare_.bic(trial.fit) <
          (best == nullptr ? compare_.bic(result_.after) : compare_.bic(best->fit)))
        best = &trial;
    }
    return best;
  }

  static double share_explained(const ExtendedFit& without, const ExtendedFit& with) {
    const double gain = without.estimation.chi_square - with.estimation.chi_square;
    return excess(without) > gain ? gain / excess(without) : 1.0;
  }

  // Where the model without the law can't be fitted, candidates are those of the first ranking, and start
  // beside the other laws as they are.
  std::vector<Trial> rivals_of(std::size_t law, const ExtendedFit& without,
                               std::vector<Rival>& outpaced) {
    const std::size_t found = result_.after.laws[law].hypothesis;
    if (!proceed("weighing rivals of " + name_of(found))) return {};
    std::vector<LawStart> others = starts_of(without.usable ? without : result_.after);
    if (!without.usable) others.erase(others.begin() + static_cast<std::ptrdiff_t>(law));
    ScoreTable table;
    table.scores = result_.ranking;
    if (without.usable && !without.laws.empty()) table = rank(without, 0);
    std::vector<LawStart> candidates;
    LawStart pace = starts_of(result_.after)[law];
    for (const LawStart& start : candidates_for(found, table)) {
      if (start.hypothesis == found) pace = start;
      if (others.empty() && was_far_behind(start.hypothesis, found, outpaced)) continue;
      const bool is_there =
          std::ranges::find(others, start.hypothesis, &LawStart::hypothesis) != others.end();
      if (start.hypothesis != found && (!is_there || is_repeatable(start.hypothesis))) {
        candidates.push_back(start);
      }
    }
    add_more_general(found, table, candidates);
    std::vector<Rival> on_few;
    std::vector<Trial> trials = refits_.refit_each(
        others, candidates, without.usable ? without : result_.after, &pace, &on_few);
    std::ranges::move(on_few, std::back_inserter(outpaced));
    std::ranges::stable_sort(outpaced, {}, &Rival::bic_difference);
    if (problem_->noise_is_known()) {
      std::ranges::stable_sort(trials, {},
                               [this](const Trial& trial) { return evidence_of_all(trial.fit); });
    }
    return trials;
  }

  // All laws at a place where none of those found there is quite right.
  [[nodiscard]] std::vector<LawStart> candidates_for(std::size_t found,
                                                     const ScoreTable& table) const {
    std::vector<LawStart> candidates = shortlist(table);
    const std::string& place = problem_->hypotheses()[found].place;
    if (departed_places_.count(place) == 0) return candidates;
    for (const HypothesisScore& score : table.scores) {
      if (place_of(score) == place && can_be_refitted(score) &&
          std::ranges::find(candidates, score.start) == candidates.end()) {
        candidates.push_back(score.start);
      }
    }
    return candidates;
  }

  // Where the law found generalises another, and not only its own slow limit: laws that generalise it, if the ranking has
  // not brought them. It ranks what a first step explains, in which they may have nothing over it.
  void add_more_general(std::size_t found, const ScoreTable& table,
                        std::vector<LawStart>& candidates) const {
    const std::span<const Hypothesis> all = problem_->hypotheses();
    const auto& plainer = all[found].special_cases;
    const auto slow_limits = std::ranges::count(plainer, "viscous");
    if (!problem_->noise_is_known() || std::ssize(plainer) == slow_limits) return;
    int room = kMoreGeneral;
    for (const HypothesisScore& score : table.scores) {
      const std::size_t hypothesis = score.start.hypothesis;
      if (room == 0) return;
      if (!can_be_refitted(score) || !is_special_case(all[found], all[hypothesis])) continue;
      if (std::ranges::find(candidates, hypothesis, &LawStart::hypothesis) != candidates.end()) {
        continue;
      }
      candidates.push_back(score.start);
      --room;
    }
  }

  [[nodiscard]] bool is_repeatable(std::size_t hypothesis) const {
    return problem_->hypotheses()[hypothesis].repeatable;
  }

  // Into those that are not excluded, and the others.
  void divide_rivals(FoundEffect& effect, const std::vector<Trial>& trials) {
    std::vector<const Trial*> standing;
    for (const Trial& trial : trials) {
      if (!compare_.excludes(result_.after, trial.fit)) standing.push_back(&trial);
    }
    // Fits of the class, the law found first. Laws of which no other that stands is a special case come
    // before the others.
    std::vector<const ExtendedFit*> members{&result_.after};
    for (const bool richer : {false, true}) {
      for (const Trial& trial : trials) {
        const std::optional<double> least = evidence_of_special_cases(trial, effect, standing);
        if (least.has_value() != richer) continue;
        Rival rival{.law = trial.fit.laws.back(),
                    .bic_difference = compare_.disadvantage(trial.fit, result_.after),
                    .evidence_difference = evidence(trial.fit) - evidence(result_.after),
                    .held_out_difference = compare_.held_out_difference(trial.fit, result_.after)};
        rival.is_contradicted =
            problem_->noise_is_known() && compare_.contradicts(trial.fit, result_.after);
        const bool is_rival = richer ? problem_->noise_is_known() && !rival.is_contradicted &&
                                           evidence_of_all(trial.fit) < *least - kAskedFor
                                     : std::ranges::find(standing, &trial) != standing.end();
        if (is_rival) {
          if (std::vector<FittedLaw>* same = same_law_among(members, trial.fit, effect)) {
            same->push_back(std::move(rival.law));
            continue;
          }
          members.push_back(&trial.fit);
          class_fits_.push_back(trial.fit);
          effect.rivals.push_back(std::move(rival));
        } else if (!richer || rival.is_contradicted) {
          effect.excluded.push_back(std::move(rival));
        } else if (!problem_->noise_is_known() ||
                   evidence_of_all(trial.fit) <= *least + options_.exclusion_margin) {
          class_fits_.push_back(trial.fit);
          effect.generalisations.push_back(std::move(rival));
        }
      }
    }
    if (!effect.rivals.empty()) effect.rivals.front().next = experiment_against(*members[1]);
  }

  // Where the last law of this fit is that of a member of the class, at a place that no experiment of this
  // kind would tell from the member's: the member's list of such places.
  [[nodiscard]] std::vector<FittedLaw>* same_law_among(
      const std::vector<const ExtendedFit*>& members, const ExtendedFit& fit,
      FoundEffect& effect) const {
    const std::span<const Hypothesis> all = problem_->hypotheses();
    for (std::size_t m = 0; m < members.size(); ++m) {
      const FittedLaw& law = m == 0 ? effect.law : effect.rivals[m - 1].law;
      if (all[law.hypothesis].law != all[fit.laws.back().hypothesis].law ||
          std::abs(members[m]->deviance - fit.deviance) > kSameDeviance) {
        continue;
      }
      const auto experiments = problem_->experiments_between(*members[m], fit);
      if (!experiments || experiments->distance_at_best > kSameDistance) continue;
      return m == 0 ? &effect.same_at : &effect.rivals[m - 1].same_at;
    }
    return nullptr;
  }

  // The least among the law found and others in its place of which this one is a generalisation.
  [[nodiscard]] std::optional<double> evidence_of_special_cases(
      const Trial& trial, const FoundEffect& effect,
      const std::vector<const Trial*>& others) const {
    const std::span<const Hypothesis> all = problem_->hypotheses();
    const Hypothesis& richer = all[trial.hypothesis];
    std::optional<double> least;
    const auto consider = [&](std::size_t plain, const ExtendedFit& fit) {
      if (is_special_case(all[plain], richer)) {
        least = std::min(least.value_or(evidence_of_all(fit)), evidence_of_all(fit));
      }
    };
    consider(effect.law.hypothesis, result_.after);
    for (const Trial* other : others) consider(other->hypothesis, other->fit);
    return least;
  }

  std::optional<NextExperiment> experiment_against(const ExtendedFit& rival) {
    if (!proceed("designing the experiment that excludes " +
                 name_of(rival.laws.back().hypothesis))) {
      return {};
    }
    const auto experiments = problem_->experiments_between(result_.after, rival);
    if (!experiments || !(experiments->distance_at_best > 0.0)) return {};
    try {
      return next_experiment(*experiments, options_.exclusion_margin);
    } catch (const InputError&) {
      return {};  // no experiment of this kind sees all parameters of the rival: no reason to end here
    }
  }

  void add_twins(FoundEffect& effect) const {
    const std::span<const Hypothesis> all = problem_->hypotheses();
    std::vector<Rival> members{{.law = effect.law}};
    members.insert(members.end(), effect.rivals.begin(), effect.rivals.end());
    std::vector<Rival> generalisations;  // in the order of the members
    for (const Rival& member : members) {
      for (const std::size_t twin : all[member.law.hypothesis].twins) {
        if (is_excluded(all[twin])) continue;
        Rival rival{.law = {twin, {}},
                    .bic_difference = member.bic_difference,
                    .evidence_difference = member.evidence_difference,
                    .held_out_difference = member.held_out_difference};
        if (is_special_case(all[member.law.hypothesis], all[twin])) {
          generalisations.push_back(std::move(rival));
        } else {
          effect.rivals.push_back(std::move(rival));
        }
      }
    }
    effect.generalisations.insert(effect.generalisations.begin(), generalisations.begin(),
                                  generalisations.end());
  }

  static void keep_best_generalisations(FoundEffect& effect) {
    std::size_t names = 1 + effect.same_at.size();
    for (const Rival& rival : effect.rivals) names += 1 + rival.same_at.size();
    const std::size_t room = kNames - std::min(kNames, names);
    if (effect.generalisations.size() > room) effect.generalisations.resize(room);
  }

  void verify() {
    result_.validation_after = problem_->validate(result_.after);
    result_.mismatch_after = problem_->mismatch(result_.after);
    result_.curves_after = problem_->residual_curves(result_.after);
    if (!result_.after.laws.empty()) result_.pictures = problem_->force_pictures(result_.after);
    if (!problem_->noise_is_known()) {
      verify_without_noise();
      return;
    }
    result_.verified = rest_passes();
    result_.predicts = !result_.validation_after || is_predicted(*result_.validation_after);
  }

  // Below the noise floor, or above it by chance.
  [[nodiscard]] bool is_predicted(const Assessment& held_out) const {
    return held_out.chi_square_per_dof() < options_.noise_floor ||
           chi_square_tail(held_out.chi_square, held_out.degrees_of_freedom) >=
               options_.verification_level;
  }

  // Where the noise is known.
  bool rest_passes() {
    if (const auto prediction = problem_->predict_held_out(result_.after)) {
      result_.validation_within_errors = prediction->within_errors;
    }
    result_.rest_p_value = practical_size_p_value(
        result_.validation_within_errors.value_or(result_.after.estimation), options_.tolerance);
    result_.fit_p_value =
        practical_size_p_value(result_.after.estimation, kFitTolerance * options_.tolerance);
    return std::min(result_.rest_p_value, result_.fit_p_value) >= options_.verification_level;
  }

  void verify_without_noise() {
    result_.remaining_structure = problem_->remaining_structure(result_.after);
    result_.autocorrelated_error = problem_->autocorrelated_error(result_.after);
    const bool generalises =
        !result_.validation_after || result_.validation_after->chi_square_per_dof() <=
                                         options_.generalisation * options_.generalisation *
                                             result_.after.estimation.chi_square_per_dof();
    result_.verified = generalises && result_.remaining_structure &&
                       looks_like_noise(result_.remaining_structure, result_.autocorrelated_error);
  }

  // Laws that only resemble what is there may leave no more than noise by the chi-square of all residuals.
  void look_for_departures() {
    if (!problem_->noise_is_known()) return;
    for (int round = 0; round < kShapeRounds; ++round) {
      const bool may_be_all = result_.verified || compare_.rest_is_noise(result_.after);
      if (!may_be_all || result_.effects.empty() || !result_.rivals_weighed) break;
      if (!only_resemble()) return;
      const bool is_last = round + 1 == kShapeRounds;
      if (is_last || (!open_departed_places() && !add_departing_law())) break;
      result_.departures.clear();
      result_.shared_characteristics.clear();
      weigh_rivals();
      verify();
    }
    // No use to tell apart what both are wrong.
    if (result_.departures.empty()) return;
    for (FoundEffect& effect : result_.effects) {
      for (Rival& rival : effect.rivals) rival.next.reset();
    }
  }

  bool only_resemble() {
    if (!proceed("comparing the shapes of what was found")) return false;
    note_shared_characteristics();
    ShapeComparison shapes = shapes_left_by(result_.after);
    result_.shapes_compared = shapes.could_tell;
    for (const ExtendedFit& other : class_fits_) {
      if (shapes.departures.empty()) break;
      const ShapeComparison of_other = shapes_left_by(other);
      if (of_other.could_tell && of_other.departures.empty()) shapes.departures.clear();
    }
    result_.departures = std::move(shapes.departures);
    return !result_.departures.empty() || !result_.shared_characteristics.empty();
  }

  // At the places of its own laws and of those found.
  [[nodiscard]] ShapeComparison shapes_left_by(const ExtendedFit& fit) const {
    std::set<std::string> places;
    for (const FittedLaw& law : fit.laws) places.insert(place_of(law));
    for (const FittedLaw& law : result_.after.laws) places.insert(place_of(law));
    std::vector<std::size_t> there = open_hypotheses(fit);
    std::erase_if(there, [&](std::size_t other) {
      return places.count(problem_->hypotheses()[other].place) == 0;
    });
    return compare_shapes(*problem_, fit, there,
                          {.level = options_.verification_level,
                           .imperfection = kImperfection,
                           .explained = result_.before.deviance - fit.deviance,
                           .seed = options_.seed});
  }

  void note_shared_characteristics() {
    std::map<std::pair<std::string, Characteristic>, std::vector<std::size_t>> found;
    for (const FoundEffect& effect : result_.effects) {
      const Hypothesis& law = problem_->hypotheses()[effect.law.hypothesis];
      if (law.characteristic != Characteristic::kNone) {
        found[{law.place, law.characteristic}].push_back(effect.law.hypothesis);
      }
    }
    result_.shared_characteristics.clear();
    for (auto& [which, laws] : found) {
      if (laws.size() < 2) continue;
      result_.shared_characteristics.push_back({which.first, which.second, std::move(laws)});
    }
  }

  // All that the catalogue has there is to be weighed now. Whether that is new.
  bool open_departed_places() {
    const std::size_t before = departed_places_.size();
    for (const Departure& departure : result_.departures) {
      departed_places_.insert(problem_->hypotheses()[departure.start.hypothesis].place);
    }
    for (const SharedCharacteristic& shared : result_.shared_characteristics) {
      departed_places_.insert(shared.place);
    }
    return departed_places_.size() > before;
  }

  // Of another characteristic than the law that is there, it may be a second effect: if nothing departs from both.
  bool add_departing_law() {
    if (result_.departures.empty() || result_.after.laws.size() >= effect_limit()) return false;
    const LawStart& besides = result_.departures.front().start;
    if (besides.parameters.empty() || shares_a_characteristic(besides.hypothesis)) return false;
    const std::vector<Trial> trials =
        refits_.refit_to_all(each_beside(starts_of(result_.after), {besides}), result_.after);
    if (trials.empty() || !stands_out(trials.front().fit) ||
        !shapes_left_by(trials.front().fit).departures.empty()) {
      return false;
    }
    result_.after = trials.front().fit;
    return true;
  }

  // With a law found at its place.
  [[nodiscard]] bool shares_a_characteristic(std::size_t hypothesis) const {
    const std::span<const Hypothesis> all = problem_->hypotheses();
    return all[hypothesis].characteristic != Characteristic::kNone &&
           std::ranges::any_of(result_.after.laws, [&](const FittedLaw& law) {
             return all[law.hypothesis].place == all[hypothesis].place &&
                    all[law.hypothesis].characteristic == all[hypothesis].characteristic;
           });
  }

  // Whatever was found, models that do not depend on time do not describe what does.
  void look_for_change() {
    if (!proceed("looking for what changes with time")) return;
    std::optional<TimeVariation> variation =
        problem_->time_variation(result_.after, result_.before.deviance - result_.after.deviance);
    result_.time_variation_was_tested = variation.has_value();
    if (variation && variation->p_value < options_.variation_level) {
      result_.time_variation = std::move(variation);
      result_.detection.detected = true;
    }
  }

  void conclude() {
    if (!result_.detection.detected) {
      result_.verdict = Verdict::kNone;
    } else if (result_.effects.empty() || !result_.verified || result_.time_variation ||
               !result_.departures.empty() || !result_.shared_characteristics.empty() ||
               result_.interrupted) {
      result_.verdict = Verdict::kUnknown;
    } else {
      const auto has_rivals = [](const FoundEffect& effect) {
        return !effect.rivals.empty() || !effect.same_at.empty();
      };
      const bool is_clear = result_.predicts && std::ranges::none_of(result_.effects, has_rivals);
      result_.verdict = is_clear ? Verdict::kExplained : Verdict::kAmbiguous;
    }
  }

  const MismatchProblem* problem_;
  std::unique_ptr<MismatchProblem>
      renewed_;  // what problem_ is, once recordings were freed of more
  const SearchOptions& options_;
  // Compound places are looked at when single ones explain no more.
  bool compounds_are_open_ = true;
  Diagnosis result_;
  FitComparison compare_;
  CandidateRefits refits_;
  // Before recordings were freed of more: the single law found, and rivals far behind it.
  std::optional<std::size_t> ahead_;
  std::vector<Rival> far_behind_;
  std::vector<ExtendedFit>
      class_fits_;  // with a rival or generalisation in the place of a law found
  std::set<std::string> departed_places_;  // of laws that are not quite what is there
  int first_fits_ = 0;                     // after the first
  bool tried_to_renew_ = false;            // with laws
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

HeldOutGain held_out_gain(const ExtendedFit& without, const ExtendedFit& with) {
  // Blocks whose parameters the others do not determine can't be predicted.
  if (!with.held_out.allFinite()) return {-std::numeric_limits<double>::infinity(), 0.0};
  if (!without.held_out.allFinite()) return {std::numeric_limits<double>::infinity(), 0.0};
  // Equal errors, zeros among them, gain nothing.
  const Eigen::ArrayXXd ratios = (without.held_out.array() == with.held_out.array())
                                     .select(1.0, without.held_out.array() / with.held_out.array());
  const Eigen::VectorXd gains = ratios.log().rowwise().sum();
  const auto blocks = static_cast<double>(gains.size());
  HeldOutGain result;
  result.mean = gains.mean();
  const double square = (gains.array() - result.mean).square().sum();
  result.standard_error = std::sqrt(square / (blocks - 1.0) / blocks);
  return result;
}

double practical_size_p_value(const Assessment& assessment, double tolerance) {
  if (!std::isfinite(assessment.chi_square)) return 0.0;
  return noncentral_chi_square_tail(assessment.chi_square, assessment.degrees_of_freedom,
                                    tolerance * assessment.degrees_of_freedom);
}

Diagnosis diagnose(const MismatchProblem& problem, const SearchOptions& options) {
  return Search(problem, options).run();
}

}  // namespace graybox
