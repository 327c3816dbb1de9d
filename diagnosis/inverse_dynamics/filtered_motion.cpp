#include "diagnosis/inverse_dynamics/filtered_motion.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSamplesAWave = 12.0;
constexpr double kMostSteps = 20.0;

// Between samples `step` apart, by values and slopes.
MatrixXd interpolated(const MatrixXd& values, const MatrixXd& slopes, double step, Index steps) {
  const Index intervals = values.rows() - 1;
  MatrixXd result(intervals * steps + 1, values.cols());
  for (Index k = 0; k < intervals; ++k) {
    for (Index i = 0; i < steps; ++i) {
      const double s = static_cast<double>(i) / static_cast<double>(steps), r = 1.0 - s;
      result.row(k * steps + i) = r * r * (1.0 + 2.0 * s) * values.row(k) +
                                  s * s * (3.0 - 2.0 * s) * values.row(k + 1) +
                                  step * s * r * (r * slopes.row(k) - s * slopes.row(k + 1));
    }
  }
  result.row(intervals * steps) = values.row(intervals);
  return result;
}

}  // namespace

FilteredMotion::FilteredMotion(const Motion& piece) {
  motion_ = piece;
  const Index last = piece.samples() - 1;
  if (piece.filters.empty() || last < 1) return;
  const double sample = piece.sample_time();
  double highest = 0.0;
  for (const FilterPass& filter : piece.filters) highest = std::max(highest, filter.frequency);
  const double steps = std::clamp(std::ceil(kSamplesAWave * highest * sample), 1.0, kMostSteps);
  if (!(highest * sample / steps < 0.5)) return;
  filters_ = piece.filters;
  steps_ = static_cast<Index>(steps);
  step_ = sample / steps;
  if (steps_ == 1) return;
  const MatrixXd none = MatrixXd::Zero(piece.samples(), piece.position.cols());
  motion_.position = interpolated(piece.position, piece.velocity, sample, steps_);
  motion_.velocity = interpolated(piece.velocity, piece.acceleration, sample, steps_);
  motion_.acceleration = interpolated(piece.acceleration, none, sample, steps_);
  motion_.time = VectorXd::LinSpaced(last * steps_ + 1, piece.time(0), piece.time(last));
}

FilteredMotion::Prepared FilteredMotion::prepared(const VectorXd& input) const {
  Prepared place{input,
                 {motion_.time, motion_.position * input, motion_.velocity * input,
                  motion_.acceleration * input},
                 {},
                 {}};
  if (filters_.empty()) return place;
  place.linear.resize(motion_.time.size(), 3);
  place.linear << place.motion.deflection, place.motion.rate, place.motion.acceleration;
  place.linear.array().rowwise() /= place.linear.colwise().norm().cwiseMax(1e-300).array().eval();
  const MatrixXd gram = place.linear.transpose() * place.linear;
  place.inverse = gram.completeOrthogonalDecomposition().pseudoInverse();
  return place;
}

void FilteredMotion::prepare(const VectorXd& input) { prepared_.push_back(prepared(input)); }

VectorXd FilteredMotion::force(const Law& law, const VectorXd& input) const {
  const auto found = std::ranges::find_if(
      prepared_, [&input](const Prepared& place) { return place.input == input; });
  return found != prepared_.end() ? force(law, *found) : force(law, prepared(input));
}

VectorXd FilteredMotion::force(const Law& law, const Prepared& place) const {
  const VectorXd force = law_force(law, place.motion);
  if (filters_.empty() || !force.allFinite()) {
    return force(Eigen::seq(Index{0}, Eigen::last, steps_));
  }
  return filtered(force, place)(Eigen::seq(Index{0}, Eigen::last, steps_));
}

VectorXd FilteredMotion::filtered(const VectorXd& force, const Prepared& place) const {
  const VectorXd followed = place.linear * (place.inverse * (place.linear.transpose() * force));
  VectorXd rest = force - followed;
  for (const FilterPass& filter : filters_) {
    rest = zero_phase_low_pass(rest, filter.frequency * step_, filter.order);
  }
  return followed + rest;
}

}  // namespace graybox
