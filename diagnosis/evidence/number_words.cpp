#include "diagnosis/evidence/number_words.hpp"

#include <fmt/format.h>

#include <cmath>

namespace graybox {

std::string three_digits(double value) {
  constexpr double kPlainFrom = 999.5, kPlainTo = 1e6;
  const double size = std::abs(value);
  if (!(size >= kPlainFrom && size < kPlainTo)) return fmt::format("{:.3g}", value);
  const double unit = std::pow(10.0, std::floor(std::log10(size)) - 2.0);
  return fmt::format("{:.0f}", unit * std::round(value / unit));
}

}  // namespace graybox
