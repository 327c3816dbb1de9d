#include "diagnosis/prediction_error/unsigned_outputs.hpp"

#include <algorithm>
#include <limits>
#include <optional>

#include "diagnosis/prediction_error/search_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kBelow = 0.03;         // of the largest value: noise about zero
constexpr double kDown = 0.05;          // likewise, how near to zero it comes
constexpr double kClearlyBetter = 0.5;  // of the cost
constexpr double kErrors = 3.0;         // z
constexpr int kIterations = 15;

bool never_negative(Index output, const PredictionData& data) {
  double least = std::numeric_limits<double>::infinity(), largest = -least;
  for (const OutputErrorRecording& recording : data.recordings()) {
    const auto column = recording.outputs.col(output);
    least = std::min(least, column.minCoeff());
    largest = std::max(largest, column.maxCoeff());
  }
  return largest > 0.0 && least > -kBelow * largest && least < kDown * largest;
}

bool has_rectifier(const LumpedModel& model, Index output) {
  return std::ranges::any_of(model.parts, [output](const Element& part) {
    return part.location.kind == LocationKind::kSensor && part.law_name == "rectifier" &&
           part.location.channel == output;
  });
}

std::optional<LawExtension> rectifier_at(Index output, const PredictionHypotheses& hypotheses) {
  for (std::size_t h = 0; h < hypotheses.hypotheses().size(); ++h) {
    const Location& place = hypotheses.location(h);
    if (place.kind != LocationKind::kSensor || place.channel != output ||
        hypotheses.hypotheses()[h].law != "rectifier") {
      continue;
    }
    LawExtension law;
    law.hypothesis = h;
    law.location = place;
    law.law = "rectifier";
    law.base = {0.0};
    law.direction = {1.0};
    law.fixed = {false};
    return law;
  }
  return {};
}

}  // namespace

ExtendedLumpedModel with_unsigned_outputs(const ExtendedLumpedModel& start,
                                          const PredictionData& data,
                                          const PredictionHypotheses& hypotheses, int threads) {
  ExtendedLumpedModel best = scaled_to_predict(start, data, threads);
  const PredictionTask task = data.windows(kFirstHorizon);
  std::optional<PredictionFit> stated;
  for (Index output = 0; output < data.output_count(); ++output) {
    const std::optional<LawExtension> law = rectifier_at(output, hypotheses);
    if (!law || has_rectifier(start.model, output) || !never_negative(output, data)) continue;
    if (!stated) stated = best_intensity(best, data, task, kIterations, threads).fit;
    ExtendedLumpedModel unsigned_start =
        scaled_to_predict(extended(best, *law, 1.0), data, threads);
    PredictionFit fit = best_intensity(unsigned_start, data, task, kIterations, threads).fit;
    const bool is_better =
        fit.usable && (!stated->usable || (fit.cost < kClearlyBetter * stated->cost &&
                                           z_between(*stated, fit) > kErrors));
    if (!is_better) continue;
    best = std::move(unsigned_start);
    stated = std::move(fit);
  }
  return best;
}

}  // namespace graybox
