#include "diagnosis/hypotheses/law_departure.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

constexpr double kDrawsAtLevel = 10.0;  // expected below the threshold

// More than imperfections explain.
bool is_large(const CandidateScore& score, const ShapeTest& test) {
  return noncentral_chi_square_tail(score.statistic, score.degrees_of_freedom,
                                    test.imperfection * test.explained) < test.level;
}

// Of what departs, the best at each place.
std::vector<Departure> best_of_each_place(std::vector<Departure> departures,
                                          std::span<const Hypothesis> hypotheses) {
  std::ranges::stable_sort(departures, {}, &Departure::p_value);
  std::set<std::string> seen;
  std::erase_if(departures, [&](const Departure& departure) {
    return !seen.insert(hypotheses[departure.start.hypothesis].place).second;
  });
  return departures;
}

}  // namespace

ShapeComparison compare_shapes(const MismatchProblem& problem, const ExtendedFit& fit,
                               std::span<const std::size_t> hypotheses, const ShapeTest& test) {
  ShapeComparison comparison;
  if (hypotheses.empty() || !(test.explained > 0.0)) return comparison;
  for (const HypothesisScore& each : problem.scores(fit, hypotheses, 0, test.seed).scores) {
    const CandidateScore& score = each.score;
    if (!(score.degrees_of_freedom > 0.0)) continue;
    comparison.could_tell = true;
    // The threshold of a family lies below its level.
    if (score.p_value < test.level && is_large(score, test)) {
      comparison.departures.push_back({each.start, score.statistic, score.degrees_of_freedom,
                                       score.p_value, score.statistic / test.explained});
    }
  }
  if (comparison.departures.empty()) return comparison;
  const int draws = static_cast<int>(std::ceil(kDrawsAtLevel / test.level));
  const ScoreTable table = problem.scores(fit, hypotheses, draws, test.seed);
  const double threshold = family_threshold(table.null_minima, test.level);
  std::erase_if(comparison.departures,
                [&](const Departure& departure) { return departure.p_value >= threshold; });
  comparison.departures =
      best_of_each_place(std::move(comparison.departures), problem.hypotheses());
  return comparison;
}

}  // namespace graybox
