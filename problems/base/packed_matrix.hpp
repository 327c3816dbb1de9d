// Symmetric d x d matrices as packed lower triangles, row by row:
//   H11, H21, H22, H31, H32, H33, ...      p = d (d + 1) / 2 numbers.
// Element (i, j), i >= j, counted from zero, stands at i (i + 1) / 2 + j.
#pragma once

#include <cstddef>
#include <span>

namespace graybox {

[[nodiscard]] constexpr std::size_t packed_size(std::size_t dimension) {
  return dimension * (dimension + 1) / 2;
}

[[nodiscard]] constexpr std::size_t packed_index(std::size_t row, std::size_t column) {
  return row >= column ? row * (row + 1) / 2 + column : column * (column + 1) / 2 + row;
}

// Unpacks to a full d x d matrix (symmetric, so row- or column-major alike).
inline void unpack(const double* packed, std::size_t dimension, double* full) {
  for (std::size_t i = 0, k = 0; i < dimension; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) {
      full[i * dimension + j] = packed[k];
      full[j * dimension + i] = packed[k];
    }
  }
}

// Packs the lower triangle of a full row-major d x d matrix.
inline void pack(const double* full, std::size_t dimension, double* packed) {
  for (std::size_t i = 0, k = 0; i < dimension; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) packed[k] = full[i * dimension + j];
  }
}

// Packs symmetric W so that a plain dot product with packed H gives tr(W H): entries off the
// diagonal are doubled.
inline void pack_trace_dual(const double* full, std::size_t dimension, double* packed) {
  for (std::size_t i = 0, k = 0; i < dimension; ++i) {
    for (std::size_t j = 0; j < i; ++j, ++k) packed[k] = 2.0 * full[i * dimension + j];
    packed[k++] = full[i * dimension + i];
  }
}

}  // namespace graybox
