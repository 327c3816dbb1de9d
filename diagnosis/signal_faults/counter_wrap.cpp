#include "diagnosis/signal_faults/counter_wrap.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kFewest = 100;
constexpr double kMended = 0.125;  // of the period
constexpr double kOthers = 5.0;
constexpr std::array kCounters = {256.0, 65536.0, 4294967296.0};

std::optional<CounterWrap> wrap_of(const Eigen::VectorXd& steps, double period,
                                   std::size_t fewest) {
  const Eigen::VectorXd mended = steps - period * (steps / period).array().round().matrix();
  const auto wraps = steps.array().abs() > 0.5 * period;
  const auto count = static_cast<std::size_t>(wraps.count());
  if (count < fewest || count > static_cast<std::size_t>(steps.size()) / 2) return {};
  Eigen::VectorXd others(steps.size() - static_cast<Index>(count));
  double largest = 0.0;
  Index first = steps.size(), next = 0;
  for (Index k = 0; k < steps.size(); ++k) {
    if (!wraps(k)) {
      others(next++) = std::abs(steps(k));
      continue;
    }
    largest = std::max(largest, std::abs(mended(k)));
    first = std::min(first, k);
  }
  // The usual steps of the mended signal, where it does not wrap; not zero at standstill.
  const double usual = kOthers * std::max(quantile(others, 0.99), 1e-9 * period);
  if (largest > kMended * period || largest > usual) return {};
  const double strength = kMended * period / std::max(largest, 1e-3 * period);
  return CounterWrap{period, count, first + 1, strength};
}

}  // namespace

std::optional<CounterWrap> find_wrap(const Eigen::Ref<const Eigen::VectorXd>& values, double turn) {
  if (values.size() < kFewest) return {};
  const double span = values.maxCoeff() - values.minCoeff();
  const Eigen::VectorXd steps = steps_of(values);
  const double longest = steps.cwiseAbs().maxCoeff();
  if (turn > 0.0 && span <= turn && longest > 0.5 * turn) {
    if (auto wrap = wrap_of(steps, turn, 1)) return wrap;
  }
  const bool whole = (values.array() == values.array().round()).all();
  if (!whole) return {};
  for (const double period : kCounters) {
    if (span > period - 0.5 || longest <= 0.5 * period) continue;
    if (auto wrap = wrap_of(steps, period, 2)) return wrap;
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
