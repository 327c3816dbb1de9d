#include "diagnosis/report/axis_scale.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {

void AxisScale::include(double value) {
  if (!shows(value)) return;
  low_ = std::min(low_, value);
  high_ = std::max(high_, value);
}

void AxisScale::settle(double margin) {
  if (!(low_ <= high_)) low_ = log_ ? 0.1 : 0.0, high_ = 1.0;
  if (log_) {
    low_ = std::log10(low_), high_ = std::log10(high_);
    if (high_ - low_ < 0.3) low_ -= 0.3, high_ += 0.3;
  } else if (high_ - low_ <= 1e-12 * std::max(std::abs(low_), std::abs(high_))) {
    const double half = low_ == 0.0 ? 1.0 : 0.1 * std::abs(low_);
    low_ -= half, high_ += half;
  }
  const double room = margin * (high_ - low_);
  low_ -= room, high_ += room;
}

bool AxisScale::shows(double value) const { return std::isfinite(value) && (!log_ || value > 0.0); }

double AxisScale::place(double value) const {
  const double at = log_ ? std::log10(value) : value;
  return a_ + (at - low_) / (high_ - low_) * (b_ - a_);
}

std::vector<double> AxisScale::ticks() const {
  if (!log_) return round_ticks(low_, high_, 5);
  std::vector<double> ticks = decades(high_ - low_ < 1.5);
  if (ticks.size() < 2) {
    ticks.clear();
    for (const double tick : round_ticks(std::pow(10, low_), std::pow(10, high_), 4)) {
      if (tick > 0.0) ticks.push_back(tick);
    }
  }
  return ticks;
}

std::vector<double> AxisScale::decades(bool with_steps) const {
  std::vector<double> ticks;
  const int stride = std::max(1, static_cast<int>(std::ceil((high_ - low_) / 8.0)));
  const auto first = static_cast<int>(std::floor(low_));
  for (int decade = first; decade <= static_cast<int>(std::ceil(high_)); ++decade) {
    if ((decade - first) % stride != 0) continue;
    for (const double step : {1.0, 2.0, 5.0}) {
      if (step > 1.0 && !with_steps) break;
      const double tick = step * std::pow(10.0, decade);
      if (std::log10(tick) >= low_ && std::log10(tick) <= high_) ticks.push_back(tick);
    }
  }
  return ticks;
}

std::vector<double> round_ticks(double low, double high, int count) {
  if (!(high > low) || count < 1) return {};
  const double raw = (high - low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> ticks;
  for (double k = std::ceil(low / step); k * step <= high * (1.0 + 1e-12) + 1e-300; k += 1.0) {
    ticks.push_back(k * step);
    if (ticks.size() > 100) break;
  }
  return ticks;
}

}  // namespace graybox
