#include "diagnosis/predictor/drive_hold.hpp"

#include <cmath>

namespace graybox {
namespace {

using Eigen::VectorXd;

constexpr int kIterations = 25;

}  // namespace

HoldComparison compare_holds(const PredictionData& data, const PredictionData& other,
                             const ExtendedLumpedModel& model, const PredictionTask& task,
                             double intensity, int threads) {
  HoldComparison result;
  result.horizon = task.horizon;
  result.seconds = data.sample_time() * static_cast<double>(result.horizon);
  const VectorXd& scale = data.output_scale();
  const PredictionFitter stated(data, task, intensity, threads);
  const PredictionFitter changed(other, task, intensity, threads);
  const PredictionFit as_stated = stated.fit(model, scale, {}, kIterations);
  const PredictionFit as_changed = changed.fit(model, scale, {}, kIterations);
  if (!as_stated.usable || !as_changed.usable) return result;
  const auto share = [&](const VectorXd& error) {
    return std::sqrt((error.array() / scale.array()).square().mean());
  };
  result.usable = true;
  result.z = z_between(as_stated, as_changed);
  result.error = share(stated.errors(as_stated, scale));
  result.error_other = share(changed.errors(as_changed, scale));
  return result;
}

}  // namespace graybox
