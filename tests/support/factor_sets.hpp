// Information sets in factor form for tests, and the same as matrices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>

#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"

namespace graybox::testing_sets {

// `count` factors of `rank` rows, each entry by entry(candidate, row, column).
inline InformationSet factor_set(
    std::size_t count, std::size_t rank, std::size_t d,
    const std::function<double(std::size_t, std::size_t, std::size_t)>& entry) {
  AlignedArray factors(count * rank * d);
  for (std::size_t k = 0; k < factors.size(); ++k) {
    factors[k] = entry(k / (rank * d), k / d % rank, k % d);
  }
  return InformationSet::of_factors(d, rank, std::move(factors));
}

inline InformationSet gaussian_factors(std::size_t count, std::size_t rank, std::size_t d,
                                       std::uint64_t seed) {
  Random random(seed);
  return factor_set(count, rank, d,
                    [&](std::size_t, std::size_t, std::size_t) { return random.normal(); });
}

// Entries changed by change(x, candidate, row, column).
inline InformationSet changed_factors(
    const InformationSet& set,
    const std::function<double(double, std::size_t, std::size_t, std::size_t)>& change) {
  return factor_set(set.candidate_count(), set.rank(), set.dimension(),
                    [&](std::size_t i, std::size_t r, std::size_t j) {
                      return change(set.factor(i)[r * set.dimension() + j], i, r, j);
                    });
}

// The same problem as matrices, made one by one.
inline InformationSet as_matrices(const InformationSet& set) {
  const std::size_t p = set.packed_size(), d = set.dimension();
  AlignedArray information(set.candidate_count() * p, 0.0);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    double* packed = information.data() + i * p;
    for (std::size_t r = 0; r < set.rank(); ++r) {
      const double* f = set.factor(i).data() + r * d;
      for (std::size_t j = 0, k = 0; j < d; ++j) {
        for (std::size_t l = 0; l <= j; ++l, ++k) packed[k] += f[j] * f[l];
      }
    }
  }
  return {d, std::move(information)};
}

}  // namespace graybox::testing_sets
