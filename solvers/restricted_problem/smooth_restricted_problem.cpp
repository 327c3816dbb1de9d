#include "solvers/restricted_problem/smooth_restricted_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kRoundingSlope = 1e-12;  // below it psi no longer shows whether a step descends

}  // namespace

SmoothRestrictedProblem::SmoothRestrictedProblem(const Criterion& criterion, std::size_t dimension,
                                                 std::span<const double> coordinates)
    : RestrictedProblem(dimension),
      frame_(criterion, dimension, coordinates),
      inverse_(dimension),
      trial_(dimension),
      matrix_(packed_size_),
      target_matrix_(packed_size_),
      trial_matrix_(packed_size_),
      unpacked_(static_cast<Index>(dimension), static_cast<Index>(dimension)),
      ridge_dual_(packed_size_),
      root_weight_(packed_size_) {}

double SmoothRestrictedProblem::psi(double f, const InverseCholesky& inverse,
                                    double weight_sum) const {
  return f - ridge_ / static_cast<double>(dimension_) * inverse.log_det() +
         (1.0 + ridge_) * weight_sum;
}

bool SmoothRestrictedProblem::refresh() {
  normalise();
  sum_information(weights_, matrix_);
  if (!inverse_.factor(matrix_)) return false;
  value_ = psi(frame_.compute(inverse_), inverse_, 1.0);
  std::ranges::copy(inverse_.trace_dual(), ridge_dual_.begin());
  for (double& entry : ridge_dual_) entry /= static_cast<double>(dimension_);
  return true;
}

void SmoothRestrictedProblem::price_members() {
  sensitivity_.resize(size());
  ridge_sensitivity_.assign(size(), 0.0);
  kernels().price(rows_.data(), size(), packed_size_, frame_.trace_dual().data(),
                  sensitivity_.data());
  if (ridge_ > 0.0) {
    kernels().price(rows_.data(), size(), packed_size_, ridge_dual_.data(),
                    ridge_sensitivity_.data());
  }
  gap_ = *std::ranges::max_element(sensitivity_) - 1.0;
}

void SmoothRestrictedProblem::choose_active() {
  active_.clear();
  slope_.clear();
  for (std::size_t i = 0; i < size(); ++i) {
    const double slope = sensitivity_[i] + ridge_ * ridge_sensitivity_[i] - (1.0 + ridge_);
    if (!(weights_[i] > 0.0 || slope > 0.0)) continue;
    active_.push_back(i);
    slope_.push_back(slope);
  }
}

// S of the active members, with the ridge.
void SmoothRestrictedProblem::form_hessian() {
  const std::size_t n = active_.size();
  const std::size_t stride = (packed_size_ + 7) / 8 * 8;
  const auto d = static_cast<Index>(dimension_);
  const Eigen::VectorXd& shares = frame_.shares();
  const Eigen::MatrixXd& axes = frame_.axes();
  if (gram_rows_.size() < n * stride) gram_rows_ = AlignedArray(2 * n * stride);
  for (Index a = 0, k = 0; a < d; ++a) {
    for (Index b = 0; b <= a; ++b, ++k) {
      const double omega =
          frame_.is_trace() ? shares(a) + shares(b) : std::max(shares(a), shares(b));
      const double both = a == b ? 1.0 : 2.0;
      root_weight_[static_cast<std::size_t>(k)] =
          std::sqrt(both * (omega + ridge_ / static_cast<double>(dimension_)));
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    unpack(row(active_[i]), dimension_, unpacked_.data());
    half_.noalias() = axes * unpacked_;
    rotated_information_.noalias() = half_ * axes.transpose();
    double* out = gram_rows_.data() + i * stride;
    std::size_t k = 0;
    for (Index a = 0; a < d; ++a) {
      for (Index b = 0; b <= a; ++b, ++k) out[k] = root_weight_[k] * rotated_information_(a, b);
    }
    std::fill(out + packed_size_, out + stride, 0.0);
  }
  hessian_.resize(n * n);
  dense_kernels().gram(gram_rows_.data(), n, stride, hessian_.data());
  if (!frame_.is_trace()) return;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = j; i < n; ++i) {
      hessian_[j * n + i] -= sensitivity_[active_[i]] * sensitivity_[active_[j]];
    }
  }
}

// The minimiser mu of the quadratic model over the active members, in target_.
bool SmoothRestrictedProblem::newton_target() {
  const std::size_t n = active_.size();
  form_hessian();
  quadratic_.reserve(n);
  linear_.resize(n);
  target_.resize(n);
  std::vector<double>& diagonal = trial_weights_;
  diagonal.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double w = slope_[i] + 1.0 + ridge_;
    diagonal[i] = std::max(hessian_[i * n + i], 1e-6 * w * w);
  }
  for (double proximal = 1e-7; proximal <= 1.0; proximal *= 1e2) {
    for (std::size_t i = 0; i < n; ++i) {
      hessian_[i * n + i] = (1.0 + proximal) * diagonal[i];
      linear_[i] = 2.0 * slope_[i] + 1.0 + ridge_ + proximal * diagonal[i] * weights_[active_[i]];
      target_[i] = 1.0;  // guess: all are free
    }
    if (quadratic_.solve({hessian_.data(), n * n}, {linear_.data(), n}, {target_.data(), n})) {
      return true;
    }
  }
  return false;
}

// Moves from the weights towards the target as far as psi falls enough; false where no step does.
bool SmoothRestrictedProblem::search_line() {
  double slope = 0.0, target_sum = 0.0;
  trial_weights_.assign(size(), 0.0);
  for (std::size_t k = 0; k < active_.size(); ++k) {
    slope += slope_[k] * (target_[k] - weights_[active_[k]]);
    target_sum += target_[k];
    trial_weights_[active_[k]] = target_[k];
  }
  if (!(slope > 0.0) || !(target_sum > 0.0)) return false;
  double step = 1.0;
  if (slope > kRoundingSlope) {
    sum_information(trial_weights_, target_matrix_);
    for (; step > 1e-8; step *= 0.4) {
      for (std::size_t k = 0; k < packed_size_; ++k) {
        trial_matrix_[k] = matrix_[k] + step * (target_matrix_[k] - matrix_[k]);
      }
      if (!trial_.factor(trial_matrix_)) continue;
      const double trial = psi(frame_.value(trial_), trial_, 1.0 + step * (target_sum - 1.0));
      if (trial <= value_ - 0.1 * step * slope) break;
    }
    if (step <= 1e-8) return false;
  }
  for (std::size_t i = 0; i < size(); ++i) {
    weights_[i] =
        step == 1.0 ? trial_weights_[i] : weights_[i] + step * (trial_weights_[i] - weights_[i]);
  }
  return true;
}

bool SmoothRestrictedProblem::multiplicative_steps(int count) {
  for (int k = 0; k < count; ++k) {
    if (!refresh()) return false;
    price_members();
    for (std::size_t i = 0; i < size(); ++i) {
      weights_[i] *= std::sqrt(std::max(sensitivity_[i], 0.0));
      if (!(weights_[i] > kSmallestWeight)) weights_[i] = 0.0;
    }
  }
  return true;
}

// Newton steps until the gap over the members is at most `tolerance`; false where it stalls.
bool SmoothRestrictedProblem::optimise(double tolerance, int step_limit) {
  double best_gap = std::numeric_limits<double>::infinity();
  int stalled = 0;
  for (int step = 0;; ++step) {
    if (!refresh()) {
      if (step == 0) return false;
      weights_ = regular_weights_;  // the step lost rank: back to where M had it
      if (refresh()) price_members();
      return false;
    }
    regular_weights_ = weights_;
    price_members();
    if (gap_ <= tolerance || step == step_limit) return true;
    stalled = gap_ < 0.9 * best_gap ? 0 : stalled + 1;
    best_gap = std::min(best_gap, gap_);
    if (stalled > 15) return false;
    choose_active();
    if (!newton_target() || !search_line()) {
      weights_ = regular_weights_;
      if (!multiplicative_steps(10)) return false;
    }
  }
}

bool SmoothRestrictedProblem::improve(double pool_gap, double tolerance) {
  constexpr int kStepLimit = 40;
  const double target = std::max(0.3 * tolerance, std::min(0.1 * pool_gap, pool_gap * pool_gap));
  ridge_ = frame_.complete() ? 0.0 : 0.5 * target;
  const bool progress = optimise(target, kStepLimit);
  const double threshold = 1.0 - std::sqrt(std::max(gap_, 0.0) + pool_gap);
  std::vector<bool> kept(size());
  for (std::size_t i = 0; i < size(); ++i) {
    kept[i] = weights_[i] > 0.0 || sensitivity_[i] >= threshold;
  }
  keep(kept);
  return progress;
}

}  // namespace graybox
