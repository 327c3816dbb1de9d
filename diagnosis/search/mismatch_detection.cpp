#include "diagnosis/search/mismatch_detection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/search/candidate_ranking.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

double required_noncentrality(const SearchState& state, double degrees_of_freedom) {
  const double threshold = chi_square_quantile(
      1.0 - std::max(state.result.detection.threshold, 1e-15), degrees_of_freedom);
  double low = 0.0;
  double high = 4.0 * (threshold + 10.0);
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    const double power = noncentral_chi_square_tail(threshold, degrees_of_freedom, middle);
    (power < state.options.detection_power ? low : high) = middle;
  }
  return high;
}

// The amplitude at which the score test of that hypothesis alone is below the family-wise threshold
// with the stated power.
void list_detectable(SearchState& state, const ScoreTable& table) {
  if (!(state.result.detection.threshold > 0.0)) return;
  for (const HypothesisScore& score : table.scores) {
    DetectableEffect effect{score.start.hypothesis, std::numeric_limits<double>::infinity(),
                            score.amplitude_unit};
    // Also where noise gave it a sign that it can't have, and so no start.
    if (score.amplitude_deviation > 0.0 && std::isfinite(score.amplitude_deviation)) {
      const double freedom = std::max(1.0, score.score.degrees_of_freedom);
      effect.amplitude =
          score.amplitude_deviation * std::sqrt(required_noncentrality(state, freedom));
    }
    state.result.detectable.push_back(std::move(effect));
  }
}

}  // namespace

void detect_mismatch(SearchState& state) {
  state.proceed("testing all hypotheses");
  // Half the level must lie within the draws' minima.
  const int needed = static_cast<int>(std::ceil(2.0 / state.options.level));
  ScoreTable table =
      rank_hypotheses(state, state.result.before, std::max(state.options.null_draws, needed));
  state.result.detection = {};
  state.result.detectable.clear();
  Detection& detection = state.result.detection;
  for (const HypothesisScore& score : table.scores) {
    detection.smallest_p_value = std::min(detection.smallest_p_value, score.score.p_value);
  }
  double share = state.options.level;
  if (state.problem->noise_is_known()) {
    share = 0.5 * state.options.level;
    const Assessment& fitted = state.result.before.estimation;
    detection.lack_of_fit_p_value = chi_square_tail(fitted.chi_square, fitted.degrees_of_freedom);
  }
  detection.threshold = table.scores.empty() ? 0.0 : family_threshold(table.null_minima, share);
  detection.detected =
      detection.lack_of_fit_p_value < 0.5 * state.options.level ||
      detection.smallest_p_value < detection.threshold ||
      !state.compare.looks_like_noise(state.problem->remaining_structure(state.result.before),
                                      state.problem->autocorrelated_error(state.result.before));
  list_detectable(state, table);
  state.result.ranking = table.scores;
}

}  // namespace graybox
