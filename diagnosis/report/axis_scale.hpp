// Where values stand on an axis of a chart, linear or logarithmic, and its round numbers.
#pragma once

#include <limits>
#include <vector>

namespace graybox {

// Maps data to the page along one axis. include() all values, then settle(), then place().
class AxisScale {
 public:
  // From one end of the axis on the page to the other; `to` may be the smaller.
  AxisScale(bool logarithmic, double from, double to) : log_(logarithmic), a_(from), b_(to) {}

  void include(double value);
  void settle(double margin = 0.04);
  [[nodiscard]] bool shows(double value) const;
  [[nodiscard]] double place(double value) const;
  [[nodiscard]] std::vector<double> ticks() const;
  // The ends of the axis after settle(), as logarithms to base ten on a logarithmic one.
  [[nodiscard]] double low() const { return low_; }
  [[nodiscard]] double high() const { return high_; }

 private:
  [[nodiscard]] std::vector<double> decades(bool with_steps) const;

  bool log_;
  double a_, b_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
};

// About `count` round numbers from `low` to `high`.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int count);

}  // namespace graybox
