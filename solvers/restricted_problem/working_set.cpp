#include "solvers/restricted_problem/working_set.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

constexpr double kMostProximal = 1e-6;     // of the mean diagonal entry of S
constexpr double kLeastProximal = 1e-9;    // a factorisation of S needs about as much
constexpr double kNear = 1e-7;             // relative difference of the entries of near copies
constexpr double kErrorForCopies = 1e-10;  // sensitivity_error() beyond which there are none

bool nearly_equal(const double* a, const double* b, std::size_t size) {
  for (std::size_t k = 0; k < size; ++k) {
    if (!(std::abs(a[k] - b[k]) <= kNear * std::abs(a[k]))) return false;
  }
  return true;
}

}  // namespace

WorkingSet::WorkingSet(std::size_t dimension)
    : dimension_(dimension),
      packed_size_(graybox::packed_size(dimension)),
      stride_((packed_size_ + 7) / 8 * 8),
      scratch_(dimension * (dimension + 1) * 8),
      matrix_(packed_size_),
      target_matrix_(packed_size_),
      trial_matrix_(packed_size_),
      inverse_(dimension),
      trial_(dimension) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  copies_.directions.resize(packed_size_);
  for (std::size_t k = 0; k < packed_size_; ++k) {
    const double turns = kGoldenRatio * static_cast<double>(k);
    copies_.directions[k] = 0.5 + (turns - std::floor(turns));
  }
  reserve(8 * dimension_);
}

void WorkingSet::reserve(std::size_t members) {
  if (whitened_rows_ >= members) return;
  indices_.reserve(members);
  weights_.reserve(members);
  rows_.reserve(members * packed_size_);
  copies_.marks.reserve(members);
  whitened_ = AlignedArray(members * stride_);
  whitened_rows_ = members;
  sensitivity_.resize(members);
  active_.reserve(members);
  active_sensitivity_.resize(members);
  linear_.resize(members);
  target_.resize(members);
}

// The arrays that grow with the square are as large as the active members ask for.
void WorkingSet::reserve_active() {
  constexpr std::size_t kStep = 32;
  const std::size_t wanted = (active_.size() + kStep - 1) / kStep * kStep;
  if (hessian_.size() < wanted * wanted) hessian_ = AlignedArray(wanted * wanted);
  quadratic_.reserve(wanted);
}

void WorkingSet::clear() {
  indices_.clear();
  weights_.clear();
  rows_.clear();
  copies_.marks.clear();
  copies_.replaced.clear();
}

// A number that tells matrices apart: their sum with fixed factors between 0.5 and 1.5. Equal
// matrices have equal marks, near copies marks that differ by less than `slack`.
WorkingSet::Mark WorkingSet::mark_of(const double* information) const {
  Mark mark;
  kernels().price(information, 1, packed_size_, copies_.directions.data(), &mark.value);
  double magnitude = 0.0;
  for (std::size_t k = 0; k < packed_size_; ++k) magnitude += std::abs(information[k]);
  mark.slack = 2.0 * kNear * magnitude;
  return mark;
}

// The member that a violator nearly equals. None where the violator has been a member before: then
// both are wanted.
std::optional<std::size_t> WorkingSet::near_copy(std::size_t candidate, const double* information,
                                                 Mark mark) const {
  if (std::ranges::find(copies_.replaced, candidate) != copies_.replaced.end()) return std::nullopt;
  for (std::size_t k = 0; k < size(); ++k) {
    if (!(std::abs(copies_.marks[k] - mark.value) <= mark.slack)) continue;
    if (nearly_equal(rows_.data() + k * packed_size_, information, packed_size_)) {
      if (sensitivity_error() > kErrorForCopies) return std::nullopt;
      return k;
    }
  }
  return std::nullopt;
}

// Whether the violator is worth more than the member; if so it takes its place and weight.
bool WorkingSet::take_place(std::size_t member, std::size_t candidate, const double* information,
                            Mark mark) {
  double* row = rows_.data() + member * packed_size_;
  double now = 0.0, then = 0.0;
  const double* dual = inverse_.trace_dual().data();
  kernels().price(row, 1, packed_size_, dual, &now);
  kernels().price(information, 1, packed_size_, dual, &then);
  if (!(then > now)) return false;
  copies_.replaced.push_back(indices_[member]);
  indices_[member] = candidate;
  copies_.marks[member] = mark.value;
  std::copy_n(information, packed_size_, row);
  return true;
}

bool WorkingSet::add(std::size_t candidate, const double* information, double weight) {
  const std::size_t bytes = packed_size_ * sizeof(double);
  const Mark mark = mark_of(information);
  for (std::size_t k = 0; k < size(); ++k) {
    if (copies_.marks[k] != mark.value) continue;
    const double* row = rows_.data() + k * packed_size_;
    if (indices_[k] == candidate || std::memcmp(row, information, bytes) == 0) {
      weights_[k] += weight;
      return false;
    }
  }
  if (weight == 0.0) {
    if (const auto copy = near_copy(candidate, information, mark)) {
      return take_place(*copy, candidate, information, mark);
    }
  }
  if (size() == whitened_rows_) reserve(2 * size());
  indices_.push_back(candidate);
  weights_.push_back(weight);
  copies_.marks.push_back(mark.value);
  rows_.insert(rows_.end(), information, information + packed_size_);
  return true;
}

void WorkingSet::drop_below(double sensitivity) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    if (weights_[k] == 0.0 && sensitivity_[k] < sensitivity) continue;
    if (kept != k) {
      indices_[kept] = indices_[k];
      weights_[kept] = weights_[k];
      sensitivity_[kept] = sensitivity_[k];
      copies_.marks[kept] = copies_.marks[k];
      std::copy_n(rows_.begin() + static_cast<std::ptrdiff_t>(k * packed_size_), packed_size_,
                  rows_.begin() + static_cast<std::ptrdiff_t>(kept * packed_size_));
    }
    ++kept;
  }
  indices_.resize(kept);
  weights_.resize(kept);
  copies_.marks.resize(kept);
  rows_.resize(kept * packed_size_);
}

void WorkingSet::information(std::span<const double> weights, std::span<double> packed) const {
  std::ranges::fill(packed, 0.0);
  kernels().accumulate(rows_.data(), size(), packed_size_, weights.data(), packed.data());
}

void WorkingSet::normalise() {
  const double sum = std::accumulate(weights_.begin(), weights_.end(), 0.0);
  for (double& weight : weights_) weight /= sum;
}

bool WorkingSet::refresh() {
  normalise();
  information(weights_, matrix_);
  return inverse_.factor(matrix_);
}

void WorkingSet::choose_active() {
  active_.clear();
  const auto d = static_cast<double>(dimension_);
  for (std::size_t i = 0; i < size(); ++i) {
    if (weights_[i] > 0.0 || sensitivity_[i] > d) active_.push_back(i);
  }
}

// The minimiser mu of the quadratic model over the active members, in target_.
bool WorkingSet::newton_target() {
  reserve_active();
  const std::size_t n = active_.size();
  const auto d = static_cast<double>(dimension_);
  dense_kernels().whiten(rows_.data(), active_.data(), n, dimension_,
                         inverse_.inverse_factor().data(), whitened_.data(), stride_,
                         active_sensitivity_.data(), scratch_.data());
  if (stop_requested()) return false;
  dense_kernels().gram(whitened_.data(), n, stride_, hessian_.data());
  double trace = 0.0;
  for (std::size_t i = 0; i < n; ++i) trace += hessian_[i * n + i];
  const std::span<double> target(target_.data(), n);
  double added = 0.0;
  const double share = std::clamp(gap_, kLeastProximal, kMostProximal);
  for (double proximal = share * trace / static_cast<double>(n); proximal <= 1e-2 * trace;
       proximal *= 1e3) {
    for (std::size_t i = 0; i < n; ++i) {
      hessian_[i * n + i] += proximal - added;
      linear_[i] = 2.0 * active_sensitivity_[i] - d + proximal * weights_[active_[i]];
      target[i] = 1.0;  // guess: all are free
    }
    added = proximal;
    if (quadratic_.solve({hessian_.data(), n * n}, {linear_.data(), n}, target)) return true;
  }
  return false;
}

// Moves from the weights towards the target as far as f increases enough (Armijo's rule on the
// scale-free objective); false where no step does.
bool WorkingSet::search_line() {
  const auto d = static_cast<double>(dimension_);
  double slope = 0.0, target_sum = 0.0;
  trial_weights_.assign(size(), 0.0);
  for (std::size_t k = 0; k < active_.size(); ++k) {
    slope += (active_sensitivity_[k] - d) * (target_[k] - weights_[active_[k]]);
    target_sum += target_[k];
    trial_weights_[active_[k]] = target_[k];
  }
  if (!(slope > 0.0) || !(target_sum > 0.0)) return false;
  double step = 1.0;
  if (slope > 1e-2) {  // below that the quadratic model is exact enough to take the full step
    information(trial_weights_, target_matrix_);
    const double value = inverse_.log_det() - d;  // the weights sum to one
    for (; step > 1e-6; step *= 0.4) {
      for (std::size_t k = 0; k < packed_size_; ++k) {
        trial_matrix_[k] = matrix_[k] + step * (target_matrix_[k] - matrix_[k]);
      }
      const double trial = trial_.log_det_of(trial_matrix_) - d * (1.0 + step * (target_sum - 1.0));
      if (trial >= value + 0.1 * step * slope) break;
    }
    if (step <= 1e-6) return false;
  }
  for (std::size_t i = 0; i < size(); ++i) {
    weights_[i] =
        step == 1.0 ? trial_weights_[i] : weights_[i] + step * (trial_weights_[i] - weights_[i]);
  }
  return true;
}

// Monotone whatever the state; used where Newton's step finds no increase.
bool WorkingSet::multiplicative_steps(int count) {
  for (int k = 0; k < count; ++k) {
    std::ranges::fill(matrix_, 0.0);
    kernels().reweigh(rows_.data(), size(), packed_size_, inverse_.trace_dual().data(),
                      1.0 / static_cast<double>(dimension_), weights_.data(), sensitivity_.data(),
                      matrix_.data());
    for (double& weight : weights_) weight = weight > kSmallestWeight ? weight : 0.0;
    if (!refresh()) return false;
  }
  return true;
}

WorkingSetStatus WorkingSet::optimise(double tolerance, int step_limit) {
  const auto d = static_cast<double>(dimension_);
  double best_gap = std::numeric_limits<double>::infinity();
  int stalled = 0;
  for (int step = 0;; ++step) {
    if (!refresh()) {
      if (step == 0) return WorkingSetStatus::kSingular;
      weights_ = regular_weights_;  // the step lost rank: back to where M had it
      return refresh() ? WorkingSetStatus::kNoProgress : WorkingSetStatus::kSingular;
    }
    regular_weights_ = weights_;
    kernels().price(rows_.data(), size(), packed_size_, inverse_.trace_dual().data(),
                    sensitivity_.data());
    gap_ = *std::max_element(sensitivity_.begin(),
                             sensitivity_.begin() + static_cast<std::ptrdiff_t>(size())) /
               d -
           1.0;
    if (gap_ <= tolerance) return WorkingSetStatus::kConverged;
    if (step == step_limit || stop_requested()) return WorkingSetStatus::kStopped;
    stalled = gap_ < 0.9 * best_gap ? 0 : stalled + 1;
    best_gap = std::min(best_gap, gap_);
    if (stalled > 12) return WorkingSetStatus::kNoProgress;
    ++newton_steps_;
    choose_active();
    if (!newton_target() || !search_line()) {
      if (stop_requested()) return WorkingSetStatus::kStopped;
      if (!multiplicative_steps(10)) return WorkingSetStatus::kSingular;
    }
  }
}

WorkingSetStatus WorkingSet::improve(double pool_gap, double tolerance) {
  constexpr int kStepLimit = 30;
  const double target = std::max(0.3 * tolerance, std::min(0.1 * pool_gap, pool_gap * pool_gap));
  const WorkingSetStatus status = optimise(target, kStepLimit);
  drop_below(static_cast<double>(dimension_) * (1.0 - std::sqrt(gap_ + pool_gap)));
  return status;
}

}  // namespace graybox
