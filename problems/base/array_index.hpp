// Eigen counts with signed integers, the standard library with unsigned ones.
#pragma once

#include <cstddef>

namespace graybox {

// The place in a standard container of Eigen's (non-negative) index.
[[nodiscard]] constexpr std::size_t at(std::ptrdiff_t index) {
  return static_cast<std::size_t>(index);
}

}  // namespace graybox
