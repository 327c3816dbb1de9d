#include "graybox/diagnosis/hypotheses/law_departure.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

constexpr double kDrawsAtLevel = 4.0;  // expected below the threshold

}  // namespace

std::vector<Departure> departures(const MismatchProblem& problem, const ExtendedFit& fit,
                                  std::span<const std::size_t> hypotheses,
                                  const DepartureTest& test) {
  if (hypotheses.empty()) return {};
  const int draws = static_cast<int>(std::ceil(kDrawsAtLevel / test.level));
  const ScoreTable table = problem.scores(fit, hypotheses, draws, test.seed);
  const double threshold = family_threshold(table.null_minima, test.level);
  std::vector<Departure> result;
  for (const HypothesisScore& each : table.scores) {
    const CandidateScore& score = each.score;
    const double beyond_chance = score.statistic - score.degrees_of_freedom;
    if (score.degrees_of_freedom > 0.0 && score.p_value < threshold &&
        beyond_chance > test.imperfection * test.explained) {
      result.push_back({each.start.hypothesis, score.statistic, score.degrees_of_freedom,
                        score.p_value, score.statistic / test.explained});
    }
  }
  std::ranges::stable_sort(result, {}, &Departure::p_value);
  return result;
}

}  // namespace graybox
