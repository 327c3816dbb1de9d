#include "diagnosis/signal_faults/quantisation.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <set>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewest = 100;
constexpr double kWhole = 0.02;  // of a step of resolution
constexpr double kCoarse = 0.02;
constexpr std::size_t kFewestOfMotion = 5;  // levels

bool has_levels_of_motion(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::set<double> seen;
  for (const double value : values) {
    seen.insert(value);
    if (seen.size() >= kFewestOfMotion) return true;
  }
  return false;
}

}  // namespace

std::optional<Quantisation> find_coarse_quantisation(
    const Eigen::Ref<const Eigen::VectorXd>& values, SignalKind kind) {
  const bool is_motion = kind == SignalKind::kMeasuredMotion;
  if (values.size() < kFewest) return {};
  if (is_motion ? !has_levels_of_motion(values) : has_few_levels(values)) return {};
  const double deviation = std::sqrt((values.array() - values.mean()).square().mean());
  const Eigen::VectorXd steps = steps_of(values).cwiseAbs();
  double smallest = std::numeric_limits<double>::infinity();
  const double rounding = 1e-12 * values.cwiseAbs().maxCoeff();
  for (const double step : steps) {
    if (step > rounding && step < smallest) smallest = step;
  }
  const double error = smallest / std::sqrt(12.0) / deviation;
  if (!(error > kCoarse)) return {};
  for (const double step : steps) {
    const double count = step / smallest;
    if (std::abs(count - std::round(count)) > kWhole) return {};
  }
  return Quantisation{smallest, error, error / kCoarse};
}

}  // namespace graybox
