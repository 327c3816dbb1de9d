#include "solvers/exact/local_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSmallestGain = 1e-12;  // of log det: less is rounding
constexpr double kRidge = 1e-6;          // in coordinates where the optimum of one run is I

void add_scaled(std::span<const double> row, double factor, std::span<double> sum) {
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += factor * row[k];
}

}  // namespace

LocalExchange::LocalExchange(const WhitenedPool& pool, StopClock clock)
    : pool_(pool),
      clock_(clock),
      factor_(pool.dimension()),
      trial_factor_(pool.dimension()),
      information_(pool.packed_size()),
      base_(pool.packed_size()),
      ridged_(pool.packed_size()),
      trial_(pool.packed_size()),
      prices_(pool.size()) {}

void LocalExchange::sum(std::span<const std::int64_t> counts) {
  std::ranges::fill(information_, 0.0);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] > 0) add_scaled(pool_.row(k), static_cast<double>(counts[k]), information_);
  }
}

double LocalExchange::log_det(std::span<const std::int64_t> counts) {
  sum(counts);
  return trial_factor_.log_det_of(information_);
}

bool LocalExchange::best_addition(std::span<const double> base, Best& best) {
  std::ranges::copy(base, ridged_.begin());
  if (!factor_.factor(ridged_)) {
    for (std::size_t i = 0; i < pool_.dimension(); ++i) ridged_[packed_index(i, i)] += kRidge;
    if (!factor_.factor(ridged_)) return false;
  }
  kernels().price(pool_.rows(), pool_.size(), pool_.packed_size(), factor_.trace_dual().data(),
                  prices_.data());
  const auto rank = static_cast<double>(pool_.largest_rank());
  // exp of the bound test, so that the loop over the pool needs no logarithm.
  const auto needed = [&] {
    return best.log_det == -kInfinity
               ? -kInfinity
               : rank * std::expm1((best.log_det + kSmallestGain - factor_.log_det()) / rank);
  };
  bool found = false;
  double least = needed();
  const auto consider = [&](std::size_t j) {
    if (!(prices_[j] > least) || clock_.stops()) return;
    std::ranges::copy(base, trial_.begin());
    add_scaled(pool_.row(j), 1.0, trial_);
    const double value = trial_factor_.log_det_of(trial_);
    if (value > best.log_det + kSmallestGain) {
      best = {value, j};
      found = true;
      least = needed();
    }
  };
  consider(static_cast<std::size_t>(std::ranges::max_element(prices_) - prices_.begin()));
  for (std::size_t j = 0; j < pool_.size(); ++j) consider(j);
  return found;
}

std::optional<LocalExchange::Exchanged> LocalExchange::best_exchange(
    std::span<const std::int64_t> counts, double current) {
  sum(counts);
  Best best{current, 0};
  std::optional<std::size_t> remove;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    if (clock_.stops()) return std::nullopt;
    std::ranges::copy(information_, base_.begin());
    add_scaled(pool_.row(i), -1.0, base_);
    if (best_addition(base_, best)) remove = i;
  }
  if (!remove) return std::nullopt;
  return Exchanged{*remove, best.add};
}

double LocalExchange::improve(std::span<std::int64_t> counts) {
  double current = log_det(counts);
  while (const std::optional<Exchanged> exchange = best_exchange(counts, current)) {
    --counts[exchange->remove];
    ++counts[exchange->add];
    const double gained = log_det(counts);
    if (!(gained > current + kSmallestGain)) {  // it was rounding
      ++counts[exchange->remove];
      --counts[exchange->add];
      break;
    }
    current = gained;
    ++steps_;
  }
  return current;
}

void LocalExchange::grow(std::int64_t experiments, std::span<std::int64_t> counts) {
  std::ranges::fill(counts, 0);
  std::ranges::fill(base_, 0.0);
  for (std::size_t i = 0; i < pool_.dimension(); ++i) base_[packed_index(i, i)] = kRidge;
  for (std::int64_t run = 0; run < experiments; ++run) {
    Best best{-kInfinity, 0};
    if (clock_.stops() || !best_addition(base_, best)) return;
    ++counts[best.add];
    add_scaled(pool_.row(best.add), 1.0, base_);
  }
}

void LocalExchange::perturb(std::int64_t moves, Random& random,
                            std::span<std::int64_t> counts) const {
  std::int64_t total = 0;
  for (const std::int64_t count : counts) total += count;
  for (std::int64_t move = 0; move < moves; ++move) {
    auto run = static_cast<std::int64_t>(random.below(static_cast<std::uint64_t>(total)));
    std::size_t from = 0;
    while (run >= counts[from]) run -= counts[from++];
    --counts[from];
    ++counts[static_cast<std::size_t>(random.below(counts.size()))];
  }
}

}  // namespace graybox
