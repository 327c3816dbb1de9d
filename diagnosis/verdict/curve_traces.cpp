#include "diagnosis/verdict/curve_traces.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace graybox {
namespace {

std::vector<double> predicted_of(const ResidualCurve& curve) {
  std::vector<double> predicted;
  for (std::size_t i = 0; i < curve.measured.size(); ++i) {
    predicted.push_back(curve.measured[i] - curve.residual[i]);
  }
  return predicted;
}

std::string error_words(const ResidualCurve& before, const ResidualCurve* after) {
  std::string words = fmt::format("Error {:.4g} % of the signal", curve_nrmse(before));
  if (after != nullptr) words += fmt::format(" before, {:.4g} % after", curve_nrmse(*after));
  return words + (before.predicted_how.empty() ? "." : "; predicted " + before.predicted_how + ".");
}

}  // namespace

double curve_nrmse(const ResidualCurve& curve) {
  double square = 0.0, mean = 0.0, spread = 0.0, predicted = 0.0, measured = 0.0;
  for (const double value : curve.measured) {
    if (!std::isfinite(value)) continue;
    measured += 1.0;
    mean += value;
  }
  mean /= measured;
  for (std::size_t i = 0; i < curve.measured.size(); ++i) {
    if (std::isfinite(curve.measured[i])) spread += std::pow(curve.measured[i] - mean, 2);
    if (!std::isfinite(curve.residual[i])) continue;
    predicted += 1.0;
    square += curve.residual[i] * curve.residual[i];
  }
  if (!(predicted > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  return 100.0 * std::sqrt(square / predicted / (spread / measured));
}

const ResidualCurve* same_curve(const std::vector<ResidualCurve>& curves,
                                const ResidualCurve& wanted) {
  for (const ResidualCurve& curve : curves) {
    if (curve.channel == wanted.channel && curve.experiment == wanted.experiment &&
        curve.held_out == wanted.held_out && curve.over_time == wanted.over_time) {
      return &curve;
    }
  }
  return nullptr;
}

std::vector<Trace> diagnosis_traces(const Diagnosis& diagnosis) {
  std::vector<Trace> traces;
  for (const ResidualCurve& before : diagnosis.curves_before) {
    if (!before.over_time) continue;
    const ResidualCurve* after =
        diagnosis.effects.empty() ? nullptr : same_curve(diagnosis.curves_after, before);
    // A channel that was moved in time, or a recording that was cut, has no counterpart.
    if (after != nullptr && after->axis.size() != before.axis.size()) after = nullptr;
    Trace trace{
        before.experiment, before.channel, before.unit, before.held_out, {}, before.axis, {}};
    trace.words = error_words(before, after);
    trace.series.push_back({"measured", before.measured});
    trace.series.push_back(
        {after != nullptr ? "predicted before" : "predicted", predicted_of(before)});
    if (after != nullptr) trace.series.push_back({"predicted after", predicted_of(*after)});
    traces.push_back(std::move(trace));
  }
  std::ranges::stable_partition(traces, [](const Trace& trace) { return trace.is_kept_out; });
  return traces;
}

}  // namespace graybox
