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
constexpr double kSharpRoundingSlope = 1e-15;  // G, whose curvature is as large as its sharpness

// A norm of the variances reaches finer gaps, and a barrier bears more points.
constexpr std::size_t kManyPoints = 500;

}  // namespace

SmoothRestrictedProblem::SmoothRestrictedProblem(const Criterion& criterion, std::size_t dimension,
                                                 std::span<const double> coordinates)
    : RestrictedProblem(dimension),
      dual_(packed_size_),
      inverse_(dimension),
      trial_(dimension),
      matrix_(packed_size_),
      target_matrix_(packed_size_),
      trial_matrix_(packed_size_),
      unpacked_(static_cast<Index>(dimension), static_cast<Index>(dimension)),
      ridge_dual_(packed_size_),
      root_weight_(packed_size_) {
  const auto d = static_cast<Index>(dimension);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::MatrixXd r =
      coordinates.empty() ? Eigen::MatrixXd(Eigen::MatrixXd::Identity(d, d))
                          : Eigen::MatrixXd(Eigen::Map<const RowMajor>(coordinates.data(), d, d));
  const auto add = [&](double share, const Criterion& each) {
    parts_.push_back({share, each.kind(), CriterionFrame(each, dimension, coordinates), r});
  };
  if (criterion.kind() == CriterionKind::kCompound) {
    for (const CriterionPart& part : criterion.parts()) add(part.share, part.criterion);
  } else {
    add(1.0, criterion);
  }
  for (Part& part : parts_) {
    if (parts_.size() > 1 || part.frame.point_count() > kManyPoints) part.frame.smooth_by_barrier();
    complete_ = complete_ || part.frame.complete();
    is_smoothed_ = is_smoothed_ || part.frame.is_smoothed();
    largest_power_ = std::max(largest_power_, part.frame.rank_one());
    exponent_ = std::min(exponent_, 1.0 / (1.0 + part.frame.rank_one()));
  }
}

std::vector<double> SmoothRestrictedProblem::dual_weights() const {
  std::vector<double> weights;
  for (const Part& part : parts_) {
    if (part.kind != CriterionKind::kG) continue;
    const std::vector<double> own = part.frame.point_weights();
    weights.insert(weights.end(), own.begin(), own.end());
  }
  return weights;
}

std::vector<double> SmoothRestrictedProblem::dual_matrix() const {
  std::vector<double> packed;
  for (const Part& part : parts_) {
    if (part.kind != CriterionKind::kE) continue;
    const Eigen::MatrixXd axes = part.frame.axes() * part.coordinates;
    const Eigen::MatrixXd own = axes.transpose() * part.frame.shares().asDiagonal() * axes;
    const Eigen::MatrixXd symmetric = (own + own.transpose()) / (2.0 * own.trace());
    packed.resize(packed_size_);
    pack(symmetric.data(), dimension_, packed.data());
  }
  return packed;
}

double SmoothRestrictedProblem::psi(const InverseCholesky& inverse, double weight_sum,
                                    Frames frames) {
  double f = 0.0;
  for (Part& part : parts_) {
    f += part.share *
         (frames == Frames::kMove ? part.frame.compute(inverse) : part.frame.value(inverse));
  }
  return f - ridge_ / static_cast<double>(dimension_) * inverse.log_det() +
         (1.0 + ridge_) * weight_sum;
}

bool SmoothRestrictedProblem::refresh() {
  normalise();
  sum_information(weights_, matrix_);
  if (!inverse_.factor(matrix_)) return false;
  value_ = psi(inverse_, 1.0, Frames::kMove);
  smoothing_ = 1.0;
  std::ranges::fill(dual_, 0.0);
  for (const Part& part : parts_) {
    const double factor = part.frame.smoothing_factor();
    smoothing_ += part.share * (factor - 1.0);
    for (std::size_t k = 0; k < packed_size_; ++k) {
      dual_[k] += factor * part.share * part.frame.trace_dual()[k];
    }
  }
  std::ranges::copy(inverse_.trace_dual(), ridge_dual_.begin());
  for (double& entry : ridge_dual_) entry /= static_cast<double>(dimension_);
  return true;
}

void SmoothRestrictedProblem::price_members() {
  sensitivity_.assign(size(), 0.0);
  ridge_sensitivity_.assign(size(), 0.0);
  for (Part& part : parts_) {
    part.sensitivity.resize(size());
    kernels().price(rows_.data(), size(), packed_size_, part.frame.trace_dual().data(),
                    part.sensitivity.data());
    for (std::size_t i = 0; i < size(); ++i) sensitivity_[i] += part.share * part.sensitivity[i];
  }
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
  hessian_.assign(n * n, 0.0);
  gram_diagonal_.assign(n, 0.0);
  part_hessian_.resize(n * n);
  // The ridge is the same in the axes of every part.
  for (const Part& part : parts_) {
    add_second_derivative(part, &part == &parts_.front() ? ridge_ / part.share : 0.0);
  }
}

// share times the second derivative of f_k + ridge (log det M^-1)/d.
void SmoothRestrictedProblem::add_second_derivative(const Part& part, double ridge) {
  const CriterionFrame& frame = part.frame;
  const std::size_t n = active_.size();
  const std::size_t stride = (packed_size_ + 7) / 8 * 8;
  const auto d = static_cast<Index>(dimension_);
  const Eigen::MatrixXd& axes = frame.axes();
  if (gram_rows_.size() < n * stride) gram_rows_ = AlignedArray(2 * n * stride);
  for (Index a = 0, k = 0; a < d; ++a) {
    for (Index b = 0; b <= a; ++b, ++k) {
      const double both = a == b ? 1.0 : 2.0;
      root_weight_[static_cast<std::size_t>(k)] = std::sqrt(
          both * part.share * (frame.omega(a, b) + ridge / static_cast<double>(dimension_)));
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
  dense_kernels().gram(gram_rows_.data(), n, stride, part_hessian_.data());
  for (std::size_t k = 0; k < n * n; ++k) hessian_[k] += part_hessian_[k];
  for (std::size_t i = 0; i < n; ++i) gram_diagonal_[i] += part_hessian_[i * n + i];
  if (frame.rank_one() != 0.0) subtract_outer(part.share * frame.rank_one(), part.sensitivity);
  outer_sensitivity_.resize(size());
  for (const CriterionFrame::OuterTerm& term : frame.outer_terms()) {
    kernels().price(rows_.data(), size(), packed_size_, term.dual.data(),
                    outer_sensitivity_.data());
    subtract_outer(-part.share * term.coefficient, outer_sensitivity_);
  }
}

// coefficient v v^T, v of all members, from the lower triangle of the active ones.
void SmoothRestrictedProblem::subtract_outer(double coefficient, std::span<const double> v) {
  const std::size_t n = active_.size();
  for (std::size_t j = 0; j < n; ++j) {
    const double scaled = coefficient * v[active_[j]];
    for (std::size_t i = j; i < n; ++i) hessian_[j * n + i] -= scaled * v[active_[i]];
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
  curvature_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double w = slope_[i] + 1.0 + ridge_;
    // The curvature that sharpness adds says nothing of the directions in which there is none.
    const double curvature = is_smoothed_ ? gram_diagonal_[i] : hessian_[i * n + i];
    diagonal[i] = std::max(curvature, 1e-6 * w * w);
    curvature_[i] = std::max(hessian_[i * n + i], 1e-6 * w * w);
  }
  for (double proximal = 1e-7; proximal <= 1.0; proximal *= 1e2) {
    for (std::size_t i = 0; i < n; ++i) {
      hessian_[i * n + i] = curvature_[i] + proximal * diagonal[i];
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
  if (slope > (is_smoothed_ ? kSharpRoundingSlope : kRoundingSlope)) {
    sum_information(trial_weights_, target_matrix_);
    for (; step > 1e-8; step *= 0.4) {
      for (std::size_t k = 0; k < packed_size_; ++k) {
        trial_matrix_[k] = matrix_[k] + step * (target_matrix_[k] - matrix_[k]);
      }
      if (!trial_.factor(trial_matrix_)) continue;
      const double trial = psi(trial_, 1.0 + step * (target_sum - 1.0), Frames::kStay);
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
      weights_[i] *= std::pow(std::max(sensitivity_[i], 0.0), exponent_);
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
      if (is_smoothed_ || !multiplicative_steps(10)) return false;
    }
  }
}

void SmoothRestrictedProblem::set_sharpness(double sharpness) {
  sharpness_ = sharpness;
  for (Part& part : parts_) part.frame.set_sharpness(sharpness);
}

// Follows the optimum while the sharpness of G and E rises until smoothing takes less than a third
// of `target`, and while p rises to its value.
void SmoothRestrictedProblem::sharpen(double target) {
  constexpr int kStepLimit = 25;
  double most = 0.0;
  for (const Part& part : parts_) {
    const std::size_t points = part.frame.point_count();
    const bool has_norm = parts_.size() == 1 && points <= kManyPoints;
    most += has_norm ? 2.0 * std::log(1.0 + static_cast<double>(points))
                     : 4.0 * static_cast<double>(std::max(points, dimension_));
  }
  while (is_smoothed_) {
    set_sharpness(sharpness_);
    if (!optimise(std::min(0.3 / sharpness_, target), kStepLimit)) break;
    if (smoothing_ - 1.0 <= 0.3 * target || sharpness_ > most / target) break;
    sharpness_ *= 8.0;
  }
  while (power_ < largest_power_) {
    power_ = std::min(2.0 * power_, largest_power_);
    for (Part& part : parts_) part.frame.set_power_at_most(power_);
    if (!optimise(0.3 / power_, kStepLimit)) power_ = largest_power_;
  }
  for (Part& part : parts_) part.frame.set_power_at_most(power_);
}

bool SmoothRestrictedProblem::improve(double pool_gap, double tolerance) {
  constexpr int kStepLimit = 40;
  const double target = std::max(0.3 * tolerance, std::min(0.1 * pool_gap, pool_gap * pool_gap));
  ridge_ = complete_ ? 0.0 : 0.5 * target;
  // New members call for a smoother criterion, in which steps are longer.
  if (is_smoothed_) sharpness_ = std::min(sharpness_, std::max(1.0, 0.3 / pool_gap));
  sharpen(target);
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
