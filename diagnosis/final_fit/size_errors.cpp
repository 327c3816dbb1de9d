#include "diagnosis/final_fit/size_errors.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "diagnosis/prediction_error/robust_covariance.hpp"
#include "diagnosis/predictor/parameter_trend.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The next shorter windows of the search, or the next longer ones.
std::optional<PredictionTask> another_horizon(const LastFit& last) {
  if (last.findings->followed) return {};  // a longer one hides what was found
  std::optional<Index> shorter, longer;
  for (const Rung& rung : last.findings->rungs) {
    const Index horizon = last.findings->samples_of(*last.data, rung.horizon);
    if (horizon == 0) continue;
    if (last.task.is_free() || horizon < last.task.horizon) {
      shorter = std::max(shorter.value_or(0), horizon);
    } else if (horizon > last.task.horizon) {
      longer = std::min(longer.value_or(horizon), horizon);
    }
  }
  const std::optional<Index> other = shorter ? shorter : longer;
  if (!other) return {};
  return last.data->windows(*other);
}

// The model found, fitted by this task and weighed by what it leaves there.
PredictionFit fitted_at(const LastFit& last, const PredictionTask& task) {
  const PredictionFitter other = last.fitter(task);
  const VectorXd& scale = last.data->output_scale();
  const PredictionFit first = other.fit(last.found.fit.model, scale, {}, 0);
  if (!first.usable) return {};
  const VectorXd weights = other.errors(first, scale).cwiseMax(1e-9 * scale);
  return other.fit(last.found.fit.model, weights, {}, kLastFitIterations);
}

// The errors of the model found, with what fits over other windows disagree by.
VectorXd with_disagreement(const LastFit& last, VectorXd deviations) {
  const std::optional<PredictionTask> task = another_horizon(last);
  if (!task) return deviations;
  const PredictionFit fit = fitted_at(last, *task);
  if (!fit.usable || fit.free != last.found.fit.free) return deviations;
  const VectorXd own = deviations_of(fit);
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const double apart = fit.model.model.parameters[fit.free[i]].value -
                         last.found.fit.model.model.parameters[fit.free[i]].value;
    const double square = deviations(at) * deviations(at);
    const double beyond = apart * apart - square - own(at) * own(at);
    if (beyond > 0.0) deviations(at) = std::sqrt(square + beyond);
  }
  return deviations;
}

// Where much is left, the same errors may be reached in another valley: what those valleys lie
// apart by is not known better than that.
VectorXd with_other_valleys(const LastFit& last, VectorXd deviations) {
  constexpr double kMuch = 0.05;   // of the signal
  constexpr double kAsGood = 1.0;  // z
  const ExtendedLumpedModel& model = last.found.fit.model;
  if (relative_size(last.found.error, last.data->output_scale()) < kMuch) return deviations;
  for (const PlacedFinding& law : model.laws) {
    for (const double factor : {0.7, 1.4}) {
      std::vector<double> values = model.values();
      const std::size_t first = model.first_parameter(law.part);
      const ParameterSpace& space = model.space[first];
      values[first] = std::clamp(factor * values[first], space.low, space.high);
      const PredictionFit other = last.judged(with_values(model, values), kLastFitIterations).fit;
      if (!other.usable || other.free != last.found.fit.free) continue;
      if (z_between(other, last.found.fit) > kAsGood) continue;
      for (std::size_t i = 0; i < other.free.size(); ++i) {
        const std::size_t at = other.free[i];
        const double apart = std::abs(other.model.values()[at] - model.values()[at]);
        deviations(static_cast<Index>(i)) = std::fmax(deviations(static_cast<Index>(i)), apart);
      }
    }
  }
  return deviations;
}

}  // namespace

VectorXd deviations_of(const PredictionFit& fit) {
  const MatrixXd covariance = robust_covariance(fit.residuals, fit.jacobian, fit.edges);
  VectorXd deviations(static_cast<Index>(fit.free.size()));
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const ParameterSpace& space = fit.model.space[fit.free[i]];
    const double value = fit.model.model.parameters[fit.free[i]].value;
    const double slope = space.logarithmic ? std::abs(value) : space.scale;
    const auto at = static_cast<Index>(i);
    deviations(at) = slope * std::sqrt(covariance(at, at));
  }
  return deviations;
}

VectorXd steady_deviations(const LastFit& last, const PredictionFit& fit) {
  return deviations_of(last.fitter(last.task).with_steady_slopes(fit, last.weights));
}

VectorXd deviations_with_disagreement(const LastFit& last) {
  return with_other_valleys(last, with_disagreement(last, steady_deviations(last, last.found.fit)));
}

std::vector<LawTrend> size_trends(const LastFit& last) {
  std::optional<PredictionTask> task = last.task;
  if (last.task.is_free()) task = another_horizon(last);
  if (!task || last.found.fit.model.laws.empty()) return {};
  const PredictionFit fit = last.task.is_free() ? fitted_at(last, *task) : last.found.fit;
  if (!fit.usable) return {};
  return law_trends(*task, last.data->output_count(), fit, last.fitter(*task).motion(fit),
                    last.hypotheses->hypotheses());
}

}  // namespace graybox
