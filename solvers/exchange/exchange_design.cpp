#include "solvers/exchange/exchange_design.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

constexpr std::size_t kNowhere = std::numeric_limits<std::size_t>::max();

}  // namespace

ExchangeDesign::ExchangeDesign(const InformationSet& set)
    : set_(set),
      weights_(set.candidate_count(), 0.0),
      place_(set.candidate_count(), kNowhere),
      information_(set.packed_size()),
      factor_(set.dimension()),
      line_(set.dimension()),
      direction_(set.packed_size()),
      former_(set.packed_size()),
      full_(set.dimension() * set.dimension()),
      product_(set.dimension() * set.dimension()) {}

void ExchangeDesign::clear() {
  for (const std::size_t i : support_) {
    weights_[i] = 0.0;
    place_[i] = kNowhere;
  }
  support_.clear();
}

bool ExchangeDesign::assign_weights(std::span<const double> weights) {
  clear();
  for (std::size_t i = 0; i < weights.size(); ++i) set_weight(i, weights[i]);
  return refresh();
}

bool ExchangeDesign::assign(std::span<const std::size_t> candidates) {
  clear();
  const double share = 1.0 / static_cast<double>(candidates.size());
  for (const std::size_t i : candidates) set_weight(i, weights_[i] + share);
  return refresh();
}

void ExchangeDesign::set_weight(std::size_t i, double weight) {
  if (weight > 0.0 && place_[i] == kNowhere) {
    place_[i] = support_.size();
    support_.push_back(i);
  } else if (!(weight > 0.0) && place_[i] != kNowhere) {
    const std::size_t last = support_.back();
    support_[place_[i]] = last;
    place_[last] = place_[i];
    support_.pop_back();
    place_[i] = kNowhere;
  }
  weights_[i] = weight > 0.0 ? weight : 0.0;
}

bool ExchangeDesign::refresh() {
  double total = 0.0;
  for (const std::size_t i : support_) total += weights_[i];
  std::ranges::fill(information_, 0.0);
  for (const std::size_t i : support_) {
    weights_[i] /= total;
    const auto h = set_.information(i);
    for (std::size_t k = 0; k < information_.size(); ++k) information_[k] += weights_[i] * h[k];
  }
  candidates_read_ += support_.size();
  return factor_.factor(information_);
}

double ExchangeDesign::sensitivity(std::size_t i) const {
  double result = 0.0;
  kernels().price(set_.information(i).data(), 1, information_.size(), factor_.trace_dual().data(),
                  &result);
  return result;
}

double ExchangeDesign::gap_rounding() const {
  return graybox::gap_rounding(information_, factor_.trace_dual(), set_.dimension());
}

// Prepares the line search along D + shift M: C = L^-1 D L^-T + shift I.
void ExchangeDesign::set_line(std::span<const double> packed_direction, double shift) {
  const std::size_t d = set_.dimension();
  const std::span<const double> inverse = factor_.inverse_factor();
  unpack(packed_direction.data(), d, full_.data());
  for (std::size_t i = 0; i < d; ++i) {
    double* row = product_.data() + i * d;
    std::fill_n(row, d, 0.0);
    for (std::size_t k = 0; k <= i; ++k) {
      const double entry = inverse[packed_index(i, k)];
      for (std::size_t j = 0; j < d; ++j) row[j] += entry * full_[k * d + j];
    }
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double entry = 0.0;
      for (std::size_t k = 0; k <= j; ++k) {
        entry += product_[i * d + k] * inverse[packed_index(j, k)];
      }
      full_[i * d + j] = full_[j * d + i] = entry;
    }
    full_[i * d + i] += shift;
  }
  line_.set_direction(full_);
}

// Moves M along the direction; takes it back if the result has no factor.
bool ExchangeDesign::accept(double step, std::span<const double> packed_direction) {
  std::ranges::copy(information_, former_.begin());
  for (std::size_t k = 0; k < information_.size(); ++k) {
    information_[k] += step * packed_direction[k];
  }
  if (factor_.factor(information_)) return true;
  std::ranges::copy(former_, information_.begin());
  static_cast<void>(factor_.factor(information_));  // it had a factor before
  return false;
}

ExchangeDesign::Move ExchangeDesign::exchange(std::size_t to, std::size_t from,
                                              bool only_nullifying) {
  if (to == from || (weights_[to] == 0.0 && weights_[from] == 0.0)) return {};
  const auto h_to = set_.information(to);
  const auto h_from = set_.information(from);
  for (std::size_t k = 0; k < direction_.size(); ++k) direction_[k] = h_to[k] - h_from[k];
  candidates_read_ += 2;
  set_line(direction_, 0.0);
  const double step = line_.maximise(-weights_[to], weights_[from]);
  const bool empties_from = step == weights_[from];
  const bool empties_to = step == -weights_[to];
  const bool nullifying = step != 0.0 && (empties_from || empties_to);
  if (step == 0.0 || (only_nullifying && !nullifying)) return {};
  if (!accept(step, direction_)) return {};
  const double pair = weights_[to] + weights_[from];
  set_weight(to, empties_to ? 0.0 : (empties_from ? pair : weights_[to] + step));
  set_weight(from, empties_from ? 0.0 : (empties_to ? pair : weights_[from] - step));
  return {step, nullifying};
}

ExchangeDesign::Move ExchangeDesign::step_to_vertex(std::size_t i) {
  const double weight = weights_[i];
  if (weight >= 1.0) return {};
  const auto h = set_.information(i);
  candidates_read_ += 1;
  set_line(h, -1.0);
  for (std::size_t k = 0; k < direction_.size(); ++k) direction_[k] = h[k] - information_[k];
  const double lowest = -weight / (1.0 - weight);
  const double step = line_.maximise(lowest, 1.0);
  if (step == 0.0 || !accept(step, direction_)) return {};
  if (step == 1.0) {
    const std::vector<std::size_t> old = support_;
    for (const std::size_t j : old) set_weight(j, j == i ? 1.0 : 0.0);
    set_weight(i, 1.0);
    return {step, false};
  }
  for (const std::size_t j : support_) weights_[j] *= 1.0 - step;
  const bool empties = step == lowest;
  set_weight(i, empties ? 0.0 : weights_[i] + step);
  return {step, empties};
}

bool ExchangeDesign::reweigh() {
  const double d = static_cast<double>(set_.dimension());
  // Sensitivities first: refresh() below replaces the factor they come from.
  next_.resize(support_.size());
  double total = 0.0;
  for (std::size_t k = 0; k < support_.size(); ++k) {
    next_[k] = std::max(weights_[support_[k]] * sensitivity(support_[k]) / d, 0.0);
    total += next_[k];
  }
  candidates_read_ += support_.size();
  if (!(total > 0.0) || !std::isfinite(total)) return false;
  for (std::size_t k = 0; k < support_.size(); ++k) {
    weights_[support_[k]] = std::max(next_[k] / total, std::numeric_limits<double>::min());
  }
  return refresh();
}

std::size_t ExchangeDesign::take_candidates_read() {
  const std::size_t read = candidates_read_;
  candidates_read_ = 0;
  return read;
}

Extremes price_all(const InformationSet& set, const ExchangeDesign& design, std::span<double> out) {
  sensitivities(set, design.trace_dual(), out);
  Extremes extremes;
  extremes.largest = static_cast<std::size_t>(std::ranges::max_element(out) - out.begin());
  extremes.smallest = *std::ranges::min_element(
      design.support(), [&](std::size_t a, std::size_t b) { return out[a] < out[b]; });
  extremes.largest_sensitivity = out[extremes.largest];
  extremes.smallest_sensitivity = out[extremes.smallest];
  return extremes;
}

}  // namespace graybox
