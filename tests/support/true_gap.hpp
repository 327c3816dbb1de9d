// The duality gap of a D-optimal design, max_i tr(M^-1 H_i) / d - 1, in 113 bits. No condition
// number that double precision can hold matters there.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

__extension__ typedef __float128 Binary128;  // NOLINT(modernize-use-using)

// M^-1 by way of M = L D L^T, packed; empty where a pivot is not positive.
inline std::vector<Binary128> quadruple_inverse(std::vector<Binary128> m, std::size_t d) {
  for (std::size_t i = 0; i < d; ++i) {  // L below the diagonal, D on it
    for (std::size_t j = 0; j < i; ++j) {
      for (std::size_t k = 0; k < j; ++k) {
        m[packed_index(i, j)] -=
            m[packed_index(i, k)] * m[packed_index(j, k)] * m[packed_index(k, k)];
      }
      m[packed_index(i, j)] /= m[packed_index(j, j)];
    }
    for (std::size_t k = 0; k < i; ++k) {
      m[packed_index(i, i)] -=
          m[packed_index(i, k)] * m[packed_index(i, k)] * m[packed_index(k, k)];
    }
    if (!(m[packed_index(i, i)] > 0)) return {};
  }
  std::vector<Binary128> inverse(m.size(), 0), column(d);
  for (std::size_t c = 0; c < d; ++c) {
    for (std::size_t i = 0; i < d; ++i) {
      column[i] = i == c ? 1 : 0;
      for (std::size_t k = c; k < i; ++k) column[i] -= m[packed_index(i, k)] * column[k];
    }
    for (std::size_t i = 0; i < d; ++i) column[i] /= m[packed_index(i, i)];
    for (std::size_t i = d; i-- > 0;) {
      for (std::size_t k = i + 1; k < d; ++k) column[i] -= m[packed_index(k, i)] * column[k];
    }
    for (std::size_t i = c; i < d; ++i) inverse[packed_index(i, c)] = column[i];
  }
  return inverse;
}

// H_i exactly, packed: of factors, the sums of their products.
inline std::vector<Binary128> exact_information(const InformationSet& set, std::size_t i) {
  if (!set.has_factors()) return {set.information(i).begin(), set.information(i).end()};
  const std::size_t d = set.dimension();
  std::vector<Binary128> h(set.packed_size(), 0);
  for (std::size_t r = 0; r < set.rank(); ++r) {
    for (std::size_t j = 0, k = 0; j < d; ++j) {
      for (std::size_t l = 0; l <= j; ++l, ++k) {
        h[k] += static_cast<Binary128>(set.factor(i)[r * d + j]) * set.factor(i)[r * d + l];
      }
    }
  }
  return h;
}

inline double true_gap(const InformationSet& set, const Design& design) {
  if (design.weights.size() != set.candidate_count()) {
    return std::numeric_limits<double>::infinity();
  }
  const std::size_t d = set.dimension();
  std::vector<Binary128> m(set.packed_size(), 0);
  Binary128 sum = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    if (design.weights[i] == 0.0) continue;
    const Binary128 weight = design.weights[i];
    sum += weight;
    const std::vector<Binary128> h = exact_information(set, i);
    for (std::size_t k = 0; k < m.size(); ++k) m[k] += weight * h[k];
  }
  for (Binary128& entry : m) entry /= sum;
  std::vector<Binary128> dual = quadruple_inverse(std::move(m), d);
  if (dual.empty()) return std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < i; ++j) dual[packed_index(i, j)] *= 2;
  }
  Binary128 largest = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    Binary128 value = 0;
    const std::vector<Binary128> h = exact_information(set, i);
    for (std::size_t k = 0; k < dual.size(); ++k) value += dual[k] * h[k];
    if (value > largest) largest = value;
  }
  return static_cast<double>(largest / d - 1);
}

}  // namespace graybox
