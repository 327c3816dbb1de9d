#include "problems/families/smooth_family.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/families/candidate_stream.hpp"

namespace graybox {
namespace {

constexpr std::size_t kAngles = 4;
constexpr std::size_t kWaves = 8;
constexpr std::size_t kTerms = 2 * kWaves + 1;
constexpr double kGoldenRatio = 1.1673039782614187;  // the real root of a^5 = a + 1

using Angles = std::array<double, kAngles>;

// What all candidates share, drawn once.
struct Manifold {
  std::size_t dimension;
  std::size_t rank;
  std::array<Angles, kWaves> waves;
  Angles offset;
  std::vector<double> coefficients;  // kTerms blocks of rank x dimension, dimension fastest
};

Manifold draw_manifold(std::size_t dimension, std::size_t rank, double decades,
                       std::uint64_t seed) {
  Random random(scatter_bits(seed));
  Manifold manifold{dimension, rank, {}, {}, std::vector<double>(kTerms * rank * dimension)};
  for (Angles& wave : manifold.waves) {
    do {
      for (double& n : wave) n = static_cast<double>(random.below(3)) - 1.0;
    } while (std::ranges::all_of(wave, [](double n) { return n == 0.0; }));
  }
  for (double& u : manifold.offset) u = random.uniform();
  std::vector<double> scale(dimension, 1.0);
  for (std::size_t j = 1; j < dimension; ++j) {
    scale[j] =
        std::pow(10.0, -decades * static_cast<double>(j) / static_cast<double>(dimension - 1));
  }
  for (std::size_t k = 0; k < manifold.coefficients.size(); ++k) {
    manifold.coefficients[k] = random.normal() * scale[k % dimension] / std::sqrt(double{kTerms});
  }
  return manifold;
}

Angles angles_of(const Manifold& manifold, std::size_t candidate) {
  Angles angles{};
  double step = 1.0;
  for (std::size_t k = 0; k < kAngles; ++k) {
    step /= kGoldenRatio;
    const double turn = manifold.offset[k] + static_cast<double>(candidate) * step;
    angles[k] = std::numbers::pi * (turn - std::floor(turn) - 0.5);
  }
  return angles;
}

std::array<double, kTerms> terms_of(const Manifold& manifold, const Angles& angles) {
  std::array<double, kTerms> terms{};
  terms[0] = 1.0;
  for (std::size_t m = 0; m < kWaves; ++m) {
    double phase = 0.0;
    for (std::size_t k = 0; k < kAngles; ++k) phase += manifold.waves[m][k] * angles[k];
    terms[2 * m + 1] = std::cos(phase);
    terms[2 * m + 2] = std::sin(phase);
  }
  return terms;
}

// H = F F' packed, with F' the rank x dimension array `factor` that is made on the way.
void assemble(const Manifold& manifold, const std::array<double, kTerms>& terms,
              std::vector<double>& factor, double* packed) {
  const std::size_t d = manifold.dimension;
  std::ranges::fill(factor, 0.0);
  for (std::size_t m = 0; m < kTerms; ++m) {
    const double* block = manifold.coefficients.data() + m * factor.size();
    for (std::size_t k = 0; k < factor.size(); ++k) factor[k] += terms[m] * block[k];
  }
  std::fill(packed, packed + packed_size(d), 0.0);
  for (std::size_t r = 0; r < manifold.rank; ++r) {
    const double* column = factor.data() + r * d;
    double* out = packed;
    for (std::size_t i = 0; i < d; ++i) {
      for (std::size_t j = 0; j <= i; ++j) *out++ += column[i] * column[j];
    }
  }
}

}  // namespace

InformationSet smooth_family(std::size_t candidates, std::size_t dimension, std::size_t rank,
                             double decades, std::uint64_t seed) {
  const Manifold manifold = draw_manifold(dimension, std::min(rank, dimension), decades, seed);
  const std::size_t p = packed_size(dimension);
  AlignedArray information(candidates * p);
  CandidateTable table{{"q1", "q2", "q3", "q4"},
                       std::vector<std::string>(kAngles, "rad"),
                       std::vector<double>(candidates * kAngles)};
#pragma omp parallel
  {
    std::vector<double> factor(manifold.rank * dimension);
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < candidates; ++i) {
      const Angles angles = angles_of(manifold, i);
      std::copy(angles.begin(), angles.end(), table.values.data() + i * kAngles);
      assemble(manifold, terms_of(manifold, angles), factor, information.data() + i * p);
    }
  }
  return InformationSet(dimension, std::move(information), std::move(table));
}

}  // namespace graybox
