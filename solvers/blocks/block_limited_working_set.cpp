#include "solvers/blocks/block_limited_working_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/lapack.hpp"
#include "solvers/interior_point/interior_point.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {

BlockLimitedWorkingSet::BlockLimitedWorkingSet(std::size_t dimension, std::size_t block_count,
                                               double limit)
    : dimension_(dimension),
      packed_size_(graybox::packed_size(dimension)),
      stride_((packed_size_ + 7) / 8 * 8),
      limit_(limit),
      block_place_(block_count, kNone),
      scratch_(8 * dimension * (dimension + 1)),
      matrix_(packed_size_),
      matrix_step_(packed_size_),
      trial_matrix_(packed_size_),
      inverse_(dimension),
      trial_(dimension),
      prices_(block_count, 0.0) {
  lapack::require_room(1);
}

bool BlockLimitedWorkingSet::add(std::size_t candidate, std::uint32_t block,
                                 const double* information) {
  if (std::ranges::find(indices_, candidate) != indices_.end()) return false;
  std::uint32_t& place = block_place_[block];
  if (place == kNone) {
    place = static_cast<std::uint32_t>(occurring_.size());
    occurring_.push_back(block);
    member_count_.push_back(0);
  }
  indices_.push_back(candidate);
  block_.push_back(place);
  ++member_count_[place];
  weights_.push_back(0.0);
  rows_.insert(rows_.end(), information, information + packed_size_);
  return true;
}

bool BlockLimitedWorkingSet::feasible() const {
  return limit_ * static_cast<double>(occurring_.size()) > 1.0 + 1e-7;
}

void BlockLimitedWorkingSet::reserve() {
  const std::size_t n = size(), blocks = occurring_.size();
  for (auto* array : {&reduced_cost_, &weight_step_, &reduced_cost_step_, &sensitivity_, &right_,
                      &ones_solution_}) {
    array->resize(n);
  }
  for (auto* array : {&slack_, &price_, &slack_step_, &price_step_}) array->resize(blocks);
  system_.resize(n * n);
  if (whitened_.size() < n * stride_) whitened_ = AlignedArray(2 * n * stride_);
  all_members_.resize(n);
  std::iota(all_members_.begin(), all_members_.end(), std::size_t{0});
}

// An interior point: the last weights, moved towards equal shares of the blocks by as much as the
// gap of the last pricing promises to change; at first equal shares alone. Multipliers on the
// central path for a mu of that size.
bool BlockLimitedWorkingSet::start(double pool_gap) {
  const double mixed = std::exchange(started_, true) ? std::clamp(0.3 * pool_gap, 1e-3, 0.5) : 1.0;
  const auto blocks = static_cast<double>(occurring_.size());
  std::ranges::fill(slack_, limit_);
  for (std::size_t i = 0; i < size(); ++i) {
    const double equal = 1.0 / (blocks * static_cast<double>(member_count_[block_[i]]));
    weights_[i] = (1.0 - mixed) * weights_[i] + mixed * equal;
    slack_[block_[i]] -= weights_[i];
  }
  const double mu =
      mixed * static_cast<double>(dimension_) / static_cast<double>(size() + occurring_.size());
  for (std::size_t i = 0; i < size(); ++i) reduced_cost_[i] = mu / weights_[i];
  for (std::size_t b = 0; b < slack_.size(); ++b) price_[b] = mu / slack_[b];
  multiplier_ = static_cast<double>(dimension_);
  return evaluate();
}

void BlockLimitedWorkingSet::information(std::span<const double> weights,
                                         std::span<double> packed) const {
  std::ranges::fill(packed, 0.0);
  kernels().accumulate(rows_.data(), size(), packed_size_, weights.data(), packed.data());
}

// M, its inverse, the whitened rows, the sensitivities and the bound of the gap at the present
// point.
bool BlockLimitedWorkingSet::evaluate() {
  information(weights_, matrix_);
  if (!inverse_.factor(matrix_)) return false;
  dense_kernels().whiten(rows_.data(), all_members_.data(), size(), dimension_,
                         inverse_.inverse_factor().data(), whitened_.data(), stride_,
                         sensitivity_.data(), scratch_.data());
  level_ = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < size(); ++i) {
    level_ = std::max(level_, sensitivity_[i] - price_[block_[i]]);
  }
  price_sum_ = std::accumulate(price_.begin(), price_.end(), 0.0);
  gap_ = (level_ + limit_ * price_sum_) / static_cast<double>(dimension_) - 1.0;
  return std::isfinite(gap_);
}

// The mu to aim for: superlinear, but no smaller than the gap asked for needs, since D and Gamma
// grow like 1/mu and take digits from the Newton system.
void BlockLimitedWorkingSet::choose_centring(double tolerance) {
  double product = 0.0;
  for (std::size_t i = 0; i < size(); ++i) product += weights_[i] * reduced_cost_[i];
  for (std::size_t b = 0; b < slack_.size(); ++b) product += slack_[b] * price_[b];
  const auto pairs = static_cast<double>(size() + slack_.size());
  const double mean = product / pairs;
  centring_ = std::max(std::min(0.2 * mean, mean * std::sqrt(mean)),
                       0.005 * tolerance * static_cast<double>(dimension_) / pairs);
}

// The factor of K + T. Near the optimum Gamma is large where a block is at its limit, and rounding
// beside it hides what tells copies and near-copies in that block apart: where the factorisation
// fails, a proximal term of that size is added. It shortens the step along what can't be told apart
// and leaves the optimum where it is.
bool BlockLimitedWorkingSet::factorise() {
  constexpr double kSmallest = 1e-15, kLargest = 1e-10;
  if (factorise(0.0)) return true;
  for (double share = kSmallest; share <= kLargest; share *= 10.0) {
    if (factorise(share)) return true;
  }
  return false;
}

// The same with `share` of its largest diagonal entry added to the diagonal.
bool BlockLimitedWorkingSet::factorise(double share) {
  const std::size_t n = size();
  dense_kernels().gram(whitened_.data(), n, stride_, system_.data());
  double largest = 0.0;
  for (std::size_t j = 0; j < n; ++j) {
    double* column = system_.data() + j * n;
    const std::uint32_t block = block_[j];
    const double gamma = price_[block] / slack_[block];
    column[j] += reduced_cost_[j] / weights_[j];
    for (std::size_t i = j; i < n; ++i) {
      if (block_[i] == block) column[i] += gamma;
    }
    largest = std::max(largest, column[j]);
  }
  for (std::size_t j = 0; j < n; ++j) system_[j * n + j] += share * largest;
  return lapack::factorise_cholesky(n, system_.data());
}

bool BlockLimitedWorkingSet::direction() {
  if (!factorise()) return false;
  for (std::size_t i = 0; i < size(); ++i) {
    right_[i] =
        sensitivity_[i] - multiplier_ + centring_ / weights_[i] - centring_ / slack_[block_[i]];
  }
  weight_step_ = right_;
  lapack::solve_cholesky(size(), system_.data(), 1, weight_step_.data());
  std::ranges::fill(ones_solution_, 1.0);
  lapack::solve_cholesky(size(), system_.data(), 1, ones_solution_.data());
  const auto sum = [](const std::vector<double>& x) {
    return std::accumulate(x.begin(), x.end(), 0.0);
  };
  multiplier_step_ = (sum(weight_step_) - (1.0 - sum(weights_))) / sum(ones_solution_);
  std::ranges::fill(slack_step_, 0.0);
  for (std::size_t i = 0; i < size(); ++i) {
    weight_step_[i] -= multiplier_step_ * ones_solution_[i];
    slack_step_[block_[i]] -= weight_step_[i];
    reduced_cost_step_[i] =
        (centring_ - reduced_cost_[i] * weight_step_[i]) / weights_[i] - reduced_cost_[i];
  }
  for (std::size_t b = 0; b < slack_.size(); ++b) {
    price_step_[b] = (centring_ - price_[b] * slack_step_[b]) / slack_[b] - price_[b];
  }
  return std::isfinite(multiplier_step_) && std::isfinite(sum(weight_step_));
}

// -log det M - mu (sum log lambda + sum log s) after `step` of the direction.
double BlockLimitedWorkingSet::barrier(double step) {
  for (std::size_t k = 0; k < packed_size_; ++k) {
    trial_matrix_[k] = matrix_[k] + step * matrix_step_[k];
  }
  double value = -trial_.log_det_of(trial_matrix_);
  for (std::size_t i = 0; i < size(); ++i) {
    value -= centring_ * std::log(weights_[i] + step * weight_step_[i]);
  }
  for (std::size_t b = 0; b < slack_.size(); ++b) {
    value -= centring_ * std::log(slack_[b] + step * slack_step_[b]);
  }
  return value;
}

// Along the direction as far as the boundary and the barrier function allow.
bool BlockLimitedWorkingSet::step() {
  constexpr double kFraction = 0.995;
  double t = std::min(1.0, kFraction * std::min(step_to_boundary(weights_, weight_step_),
                                                step_to_boundary(slack_, slack_step_)));
  const double u =
      std::min(1.0, kFraction * std::min(step_to_boundary(reduced_cost_, reduced_cost_step_),
                                         step_to_boundary(price_, price_step_)));
  double slope = 0.0;
  for (std::size_t i = 0; i < size(); ++i) {
    slope += (right_[i] + multiplier_) * weight_step_[i];
  }
  if (slope > 1e-3) {  // below that Newton's model is exact enough to take the full step
    information(weight_step_, matrix_step_);
    const double value = barrier(0.0);
    while (!(barrier(t) <= value - 1e-4 * t * slope)) {
      t *= 0.5;
      if (t < 1e-8) return false;
    }
  }
  for (std::size_t i = 0; i < size(); ++i) {
    weights_[i] += t * weight_step_[i];
    // Near the central path, so that D does not lose its meaning after a shortened step.
    reduced_cost_[i] = std::clamp(reduced_cost_[i] + u * reduced_cost_step_[i],
                                  1e-8 * centring_ / weights_[i], 1e8 * centring_ / weights_[i]);
  }
  for (std::size_t b = 0; b < slack_.size(); ++b) {
    slack_[b] += t * slack_step_[b];
    price_[b] = std::clamp(price_[b] + u * price_step_[b], 1e-8 * centring_ / slack_[b],
                           1e8 * centring_ / slack_[b]);
  }
  multiplier_ += u * multiplier_step_;
  return true;
}

// Weight zero for the members that the pair (lambda_i, z_i) marks as outside the support, lambda_i
// < threshold z_i. What they had goes to the blocks that stay, in proportion to what their limits
// leave, so no limit is broken. False where there is not enough room.
bool BlockLimitedWorkingSet::drop_below(double threshold) {
  std::vector<double> share(occurring_.size(), 0.0);
  double kept = 0.0, room = 0.0;
  for (std::size_t i = 0; i < size(); ++i) {
    if (weights_[i] < threshold * reduced_cost_[i]) weights_[i] = 0.0;
    share[block_[i]] += weights_[i];
    kept += weights_[i];
  }
  for (const double s : share) room += s > 0.0 ? std::max(0.0, limit_ - s) : 0.0;
  const double missing = 1.0 - kept;
  if (!(kept > 0.0) || std::abs(missing) > room) return false;
  for (std::size_t i = 0; i < size(); ++i) {
    const double s = share[block_[i]];
    if (s > 0.0) weights_[i] *= 1.0 + missing / room * std::max(0.0, limit_ - s) / s;
  }
  return true;
}

// The largest of a few thresholds that keeps the gap.
bool BlockLimitedWorkingSet::drop_negligible(double tolerance) {
  const std::vector<double> interior = weights_;
  const double accepted = std::max(2.0 * gap_, tolerance);
  for (const double threshold : {1.0, 1e-2, 1e-4, 1e-6}) {
    if (drop_below(threshold) && evaluate() && gap_ <= accepted) return true;
    weights_ = interior;
  }
  return evaluate();
}

void BlockLimitedWorkingSet::drop_idle(double reduced_cost) {
  // Blocks stay until they can hold a tenth more than the weight, by their best members.
  const auto needed = std::min(occurring_.size(), static_cast<std::size_t>(1.1 / limit_) + 2);
  std::vector<std::size_t> order = all_members_;
  std::ranges::stable_sort(
      order, {}, [&](std::size_t i) { return weights_[i] > 0.0 ? -1.0 : reduced_cost_[i]; });
  std::vector<bool> occurs(occurring_.size(), false), kept(size(), false);
  std::size_t blocks = 0;
  for (const std::size_t i : order) {
    const bool is_new = !occurs[block_[i]];
    kept[i] = weights_[i] > 0.0 || reduced_cost_[i] < reduced_cost || (is_new && blocks < needed);
    if (kept[i] && is_new) {
      occurs[block_[i]] = true;
      ++blocks;
    }
  }
  BlockLimitedWorkingSet rest(dimension_, block_place_.size(), limit_);
  for (std::size_t i = 0; i < size(); ++i) {
    if (!kept[i]) continue;
    rest.add(indices_[i], occurring_[block_[i]], rows_.data() + i * packed_size_);
    rest.weights_.back() = weights_[i];
  }
  indices_.swap(rest.indices_);
  block_.swap(rest.block_);
  rows_.swap(rest.rows_);
  occurring_.swap(rest.occurring_);
  block_place_.swap(rest.block_place_);
  member_count_.swap(rest.member_count_);
  weights_.swap(rest.weights_);
}

bool BlockLimitedWorkingSet::optimise(double pool_gap, double tolerance, int step_limit) {
  reserve();
  if (!start(pool_gap)) return false;
  double best = gap_;
  int stalled = 0;
  // A little beyond the tolerance: the next step costs little and leaves less weight to drop.
  for (int k = 0; k < step_limit && gap_ > 0.1 * tolerance && stalled < 15; ++k) {
    choose_centring(tolerance);
    if (!direction() || !step() || !evaluate()) break;
    stalled = gap_ < 0.9 * best ? 0 : stalled + 1;
    best = std::min(best, gap_);
  }
  if (!drop_negligible(tolerance)) return false;
  std::ranges::fill(prices_, 0.0);
  for (std::size_t b = 0; b < occurring_.size(); ++b) prices_[occurring_[b]] = price_[b];
  return true;
}

}  // namespace graybox
