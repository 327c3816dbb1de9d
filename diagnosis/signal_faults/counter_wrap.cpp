#include "diagnosis/signal_faults/counter_wrap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr Index kFewestSigned = 20;
constexpr double kMended = 0.125;  // of the period
constexpr double kOthers = 5.0;
constexpr double kSmall = 1.0 / 256.0;  // of the period
constexpr std::array kCounters = {256.0, 65536.0, 4294967296.0};

// Steps by whether they are longer than half a period.
struct StepKinds {
  std::size_t count = 0;  // of those that are
  Index first = 0;        // the first of them
  double largest = 0.0;   // of them, with whole periods added
  double usual = 0.0;     // 5 times what 99 % of the others keep below; not zero at standstill
};

StepKinds kinds_of(const Eigen::VectorXd& steps, double period) {
  const auto wraps = steps.array().abs() > 0.5 * period;
  StepKinds kinds{.count = static_cast<std::size_t>(wraps.count()), .first = steps.size()};
  if (static_cast<Index>(kinds.count) == steps.size()) return kinds;
  Eigen::VectorXd others(steps.size() - static_cast<Index>(kinds.count));
  for (Index k = 0, next = 0; k < steps.size(); ++k) {
    if (!wraps(k)) {
      others(next++) = std::abs(steps(k));
      continue;
    }
    const double mended = steps(k) - period * std::round(steps(k) / period);
    kinds.largest = std::max(kinds.largest, std::abs(mended));
    kinds.first = std::min(kinds.first, k);
  }
  kinds.usual = kOthers * std::max(quantile(others, 0.99), 1e-9 * period);
  return kinds;
}

CounterWrap found(const StepKinds& kinds, double period, bool is_signed) {
  const double strength = kMended * period / std::max(kinds.largest, 1e-3 * period);
  return {period, kinds.count, kinds.first + 1, strength, is_signed};
}

std::optional<CounterWrap> wrap_of(const Eigen::VectorXd& steps, double period,
                                   std::size_t fewest) {
  const StepKinds kinds = kinds_of(steps, period);
  if (kinds.count < fewest || kinds.count > static_cast<std::size_t>(steps.size()) / 2) return {};
  if (kinds.largest > kMended * period || kinds.largest > kinds.usual) return {};
  return found(kinds, period, false);
}

// Whole numbers near 0 and near the period, with nothing between.
bool has_two_ends(const Eigen::Ref<const Eigen::VectorXd>& values, double period) {
  constexpr std::size_t kFewestOfASide = 2, kFewestOfAll = 5;
  if (values.minCoeff() < 0.0 || values.maxCoeff() > period - 1.0) return false;
  std::set<double> low, high;
  for (const double value : values) {
    if (value > kMended * period && value < (1.0 - kMended) * period) return false;
    (value < 0.5 * period ? low : high).insert(value);
  }
  return low.size() >= kFewestOfASide && high.size() >= kFewestOfASide &&
         low.size() + high.size() >= kFewestOfAll;
}

std::optional<CounterWrap> wrap_of_signed(const Eigen::Ref<const Eigen::VectorXd>& values,
                                          const Eigen::VectorXd& steps, double period) {
  if (!has_two_ends(values, period)) return {};
  const StepKinds kinds = kinds_of(steps, period);
  if (kinds.count == 0 || kinds.largest > std::max(kinds.usual, kSmall * period)) return {};
  return found(kinds, period, true);
}

}  // namespace

std::optional<CounterWrap> find_wrap(const Eigen::Ref<const Eigen::VectorXd>& values, double turn) {
  if (values.size() < kFewestSigned) return {};
  const bool is_long = values.size() >= kFewest;
  const double span = values.maxCoeff() - values.minCoeff();
  const Eigen::VectorXd steps = steps_of(values);
  const double longest = steps.cwiseAbs().maxCoeff();
  for (const double period : {turn, 0.5 * turn}) {
    if (!is_long || !(period > 0.0) || span > period || longest <= 0.5 * period) continue;
    if (auto wrap = wrap_of(steps, period, 1)) return wrap;
  }
  const bool whole = (values.array() == values.array().round()).all();
  if (!whole) return {};
  for (const double period : kCounters) {
    if (span > period - 0.5 || longest <= 0.5 * period) continue;
    if (is_long) {
      if (auto wrap = wrap_of(steps, period, 2)) return wrap;
    }
    if (auto wrap = wrap_of_signed(values, steps, period)) return wrap;
  }
  return {};
}

Eigen::VectorXd unwrapped(const Eigen::Ref<const Eigen::VectorXd>& values, double period) {
  Eigen::VectorXd result = values;
  double added = 0.0;
  for (Index k = 1; k < values.size(); ++k) {
    added -= period * std::round((values(k) - values(k - 1)) / period);
    result(k) = values(k) + added;
  }
  return result;
}

}  // namespace graybox
