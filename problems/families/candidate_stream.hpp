// Random numbers for candidate i of a family that depend on the seed and on i alone: a family of
// Q candidates is the beginning of the family of 2 Q, and threads can't change it.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "problems/base/random.hpp"

namespace graybox {

// The finaliser of splitmix64 (Steele, Lea and Flood 2014): a bijection that scatters bits.
[[nodiscard]] constexpr std::uint64_t scatter_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

[[nodiscard]] inline Random candidate_stream(std::uint64_t seed, std::size_t candidate) {
  return Random(scatter_bits(scatter_bits(seed + 0x9e3779b97f4a7c15ULL) +
                             0xd1342543de82ef95ULL * (candidate + 1)));
}

// Gamma variate of the given shape >= 1 and scale 1 (Marsaglia and Tsang 2000).
[[nodiscard]] inline double gamma_variate(Random& random, double shape) {
  const double d = shape - 1.0 / 3.0;
  const double c = 1.0 / std::sqrt(9.0 * d);
  while (true) {
    const double x = random.normal();
    const double root = 1.0 + c * x;
    if (root <= 0.0) continue;
    const double v = root * root * root;
    const double u = 1.0 - random.uniform();  // in (0, 1]
    if (u < 1.0 - 0.0331 * x * x * x * x) return d * v;
    if (std::log(u) < 0.5 * x * x + d * (1.0 - v + std::log(v))) return d * v;
  }
}

// Chi-squared variate; degrees >= 1.
[[nodiscard]] inline double chi_squared_variate(Random& random, std::size_t degrees) {
  if (degrees == 1) {
    const double x = random.normal();
    return x * x;
  }
  return 2.0 * gamma_variate(random, 0.5 * static_cast<double>(degrees));
}

}  // namespace graybox
