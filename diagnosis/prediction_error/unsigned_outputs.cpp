#include "diagnosis/prediction_error/unsigned_outputs.hpp"

#include <algorithm>
#include <limits>
#include <optional>

#include "diagnosis/prediction_error/search_start.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kBelow = 0.03;  // of the largest value: noise about zero
constexpr double kDown = 0.05;   // likewise, how near to zero it comes
// These limits of the cost and z are lower than others, since a speed that comes down to zero and
// never passes it speaks for itself, and what else is missing may leave much.
constexpr double kBetter = 0.9, kErrors = 3.0;

bool predicts_better(const PredictionFit& without_sign, const PredictionFit& stated) {
  if (!stated.usable) return without_sign.usable;
  return without_sign.usable && without_sign.cost < kBetter * stated.cost &&
         z_between(stated, without_sign) > kErrors;
}

}  // namespace

bool never_negative(Index output, const PredictionData& data) {
  double least = std::numeric_limits<double>::infinity(), largest = -least;
  for (const OutputErrorRecording& recording : data.recordings()) {
    const auto column = recording.outputs.col(output);
    least = std::min(least, column.minCoeff());
    largest = std::max(largest, column.maxCoeff());
  }
  return largest > 0.0 && least > -kBelow * largest && least < kDown * largest;
}

ExtendedLumpedModel with_unsigned_outputs(const ExtendedLumpedModel& start,
                                          const PredictionData& data,
                                          const PredictionHypotheses& hypotheses, int threads) {
  ExtendedLumpedModel best = scaled_to_predict(start, data, threads);
  std::optional<PredictionFit> stated;
  for (Index output = 0; output < data.output_count(); ++output) {
    if (!never_negative(output, data)) continue;
    const std::optional<LawExtension> rectifier =
        missing_at_sensor(best.model, static_cast<std::size_t>(output), "rectifier", hypotheses);
    if (!rectifier) continue;
    if (!stated) stated = short_fit(best, data, threads);
    ExtendedLumpedModel unsigned_start =
        scaled_to_predict(extended(best, *rectifier, 1.0), data, threads);
    PredictionFit fit = short_fit(unsigned_start, data, threads);
    if (!predicts_better(fit, *stated)) continue;
    best = std::move(unsigned_start);
    stated = std::move(fit);
  }
  return best;
}

}  // namespace graybox
