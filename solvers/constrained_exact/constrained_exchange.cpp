#include "solvers/constrained_exact/constrained_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTolerance = 1e-9;  // relative, of rows
constexpr double kLeastGain = 1e-12;

bool inside(const LinearConstraint& row, double value, double size) {
  const double slack = kTolerance * std::max(size, 1e-300);
  return value >= row.lower - slack && value <= row.upper + slack;
}

// The rows of a design, kept while counts change.
class RowSums {
 public:
  RowSums(const DesignConstraints& constraints, std::span<const std::int64_t> counts)
      : constraints_(constraints),
        value_(constraints.rows.size(), 0.0),
        size_(constraints.rows.size(), 0.0) {
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] != 0) change(i, static_cast<double>(counts[i]));
    }
  }

  void change(std::size_t i, double by) {
    for (std::size_t j = 0; j < value_.size(); ++j) {
      const double term = constraints_.rows[j].coefficients[i] * by;
      value_[j] += term;
      size_[j] += std::copysign(std::abs(term), by);
    }
  }

  // With one run of `out` less and one of `in` more, where there are such.
  [[nodiscard]] bool obeyed_after(std::optional<std::size_t> out,
                                  std::optional<std::size_t> in) const {
    for (std::size_t j = 0; j < value_.size(); ++j) {
      const LinearConstraint& row = constraints_.rows[j];
      double value = value_[j];
      if (out) value -= row.coefficients[*out];
      if (in) value += row.coefficients[*in];
      if (!inside(row, value, size_[j])) return false;
    }
    return true;
  }

 private:
  const DesignConstraints& constraints_;
  std::vector<double> value_, size_;
};

struct Exchange1 {
  std::optional<std::size_t> out, in;
  double value = -kInfinity;
};

}  // namespace

DesignValue::DesignValue(const InformationSet& set, const DesignConstraints& constraints,
                         const Criterion& criterion)
    : set_(set),
      constraints_(constraints),
      is_determinant_(criterion.kind() == CriterionKind::kD),
      inverse_(set.dimension()),
      matrix_(set.packed_size()),
      dual_(set.packed_size()) {
  if (criterion.kind() == CriterionKind::kCompound) {
    for (const CriterionPart& part : criterion.parts()) {
      parts_.push_back({part.share, CriterionFrame(part.criterion, set.dimension(), {})});
    }
  } else {
    parts_.push_back({1.0, CriterionFrame(criterion, set.dimension(), {})});
  }
  for (Part& part : parts_) part.frame.smooth_by_barrier();
}

void DesignValue::start() {
  if (constraints_.prior.empty()) {
    std::ranges::fill(matrix_, 0.0);
  } else {
    std::ranges::copy(constraints_.prior, matrix_.begin());
  }
}

double DesignValue::of(std::span<const double> packed) {
  if (is_determinant_) {
    return inverse_.log_det_of(packed) / static_cast<double>(set_.dimension());
  }
  if (!inverse_.factor(packed)) return -kInfinity;
  double value = 0.0;
  for (Part& part : parts_) value -= part.share * part.frame.sharp_value(inverse_);
  return value;
}

void DesignValue::add(std::size_t candidate, double count, std::span<double> packed) const {
  const auto h = set_.information(candidate);
  for (std::size_t k = 0; k < h.size(); ++k) packed[k] += count * h[k];
}

std::span<const double> DesignValue::trace_dual(double sharpness) {
  if (!inverse_.factor(matrix_)) return {};
  std::ranges::fill(dual_, 0.0);
  for (Part& part : parts_) {
    part.frame.set_sharpness(sharpness);
    part.frame.compute(inverse_);
    const double scale = part.share * part.frame.smoothing_factor();
    for (std::size_t k = 0; k < dual_.size(); ++k) dual_[k] += scale * part.frame.trace_dual()[k];
  }
  double condition = 0.0;
  for (std::size_t i = 0, k = 0; i < set_.dimension(); k += i + 2, ++i) {
    condition += matrix_[k] * inverse_.trace_dual()[k];
  }
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  rounding_ = static_cast<double>(set_.dimension()) * kEpsilon * condition;
  return dual_;
}

double DesignValue::prior_gain() const {
  double gain = 0.0;
  for (std::size_t k = 0; k < constraints_.prior.size(); ++k) {
    gain += constraints_.prior[k] * dual_[k];
  }
  return gain;
}

bool obeys(const DesignConstraints& constraints, std::span<const std::int64_t> counts) {
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto count = static_cast<double>(counts[i]);
    if (count < constraints.lower_of(i) || count > constraints.upper_of(i)) return false;
  }
  return RowSums(constraints, counts).obeyed_after({}, {});
}

double improve_by_exchange(const DesignConstraints& constraints, std::span<const std::size_t> pool,
                           DesignValue& value, std::span<std::int64_t> counts) {
  RowSums rows(constraints, counts);
  double current = value(std::span<const std::int64_t>(counts));
  std::vector<double> base, trial;
  const auto can_enter = [&](std::size_t i) {
    return static_cast<double>(counts[i]) + 1.0 <= constraints.largest_effort(i) + kTolerance;
  };
  while (!stop_requested()) {
    std::vector<std::optional<std::size_t>> leaving{std::nullopt};
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] > 0 && static_cast<double>(counts[i]) - 1.0 >= constraints.lower_of(i)) {
        leaving.emplace_back(i);
      }
    }
    Exchange1 best{.out = {}, .in = {}, .value = current};
    (void)value(std::span<const std::int64_t>(counts));
    const std::vector<double> matrix(value.matrix().begin(), value.matrix().end());
    for (const std::optional<std::size_t> out : leaving) {
      if (stop_requested()) break;
      base = matrix;
      if (out) value.add(*out, -1.0, base);
      for (const std::size_t in : pool) {
        if (out == in || !can_enter(in) || !rows.obeyed_after(out, in)) continue;
        trial = base;
        value.add(in, 1.0, trial);
        const double gained = value.of(trial);
        if (gained > best.value + kLeastGain) best = {out, in, gained};
      }
    }
    if (!best.in) break;
    if (best.out) {
      --counts[*best.out];
      rows.change(*best.out, -1.0);
    }
    ++counts[*best.in];
    rows.change(*best.in, 1.0);
    const double fresh = value(std::span<const std::int64_t>(counts));
    if (!(fresh > current)) break;  // it was better by rounding
    current = fresh;
  }
  return current;
}

}  // namespace graybox
