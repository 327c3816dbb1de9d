#include "problems/families/random_families.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/families/candidate_stream.hpp"

namespace graybox {
namespace {

void draw_scale(Random& random, ScaleDistribution scale, std::vector<double>& s) {
  for (double& value : s) {
    switch (scale) {
      case ScaleDistribution::kNone:
        value = 1.0;
        break;
      case ScaleDistribution::kLogNormal:
        value = std::exp(random.normal());
        break;
      case ScaleDistribution::kDecades:
        value = std::pow(10.0, random.uniform(-3.0, 3.0));
        break;
    }
  }
}

// Packed lower-triangular Bartlett factor.
void draw_factor(Random& random, std::size_t degrees, std::size_t dimension,
                 std::vector<double>& factor) {
  for (std::size_t j = 0, k = 0; j < dimension; ++j) {
    for (std::size_t column = 0; column < j; ++column) factor[k++] = random.normal();
    factor[k++] = std::sqrt(chi_squared_variate(random, degrees - j));
  }
}

// S L L' S / degrees, packed.
void assemble(const std::vector<double>& factor, const std::vector<double>& s, std::size_t degrees,
              double* packed) {
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double* row = factor.data() + packed_size(i);
    for (std::size_t j = 0; j <= i; ++j) {
      const double* other = factor.data() + packed_size(j);
      double sum = 0.0;
      for (std::size_t k = 0; k <= j; ++k) sum += row[k] * other[k];
      *packed++ = s[i] * s[j] * (sum / static_cast<double>(degrees));
    }
  }
}

// Runs draw(random, numbers) for every candidate, each with its own stream and `each` numbers.
// `make_draw` gives each thread a draw with its own workspace.
template <typename MakeDraw>
AlignedArray draw_candidates(std::size_t candidates, std::size_t each, std::uint64_t seed,
                             MakeDraw make_draw) {
  AlignedArray information(candidates * each);
#pragma omp parallel
  {
    auto draw = make_draw();
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < candidates; ++i) {
      Random random = candidate_stream(seed, i);
      draw(random, information.data() + i * each);
    }
  }
  return information;
}

}  // namespace

InformationSet wishart_family(std::size_t candidates, std::size_t dimension, std::size_t degrees,
                              ScaleDistribution scale, std::uint64_t seed) {
  if (degrees < dimension) {
    throw InputError(fmt::format("a Wishart matrix of {} degrees of freedom is singular for d = {}",
                                 degrees, dimension));
  }
  const auto make_draw = [=] {
    return [=, s = std::vector<double>(dimension),
            factor = std::vector<double>(packed_size(dimension))](Random& random,
                                                                  double* packed) mutable {
      draw_scale(random, scale, s);
      draw_factor(random, degrees, dimension, factor);
      assemble(factor, s, degrees, packed);
    };
  };
  return InformationSet(dimension,
                        draw_candidates(candidates, packed_size(dimension), seed, make_draw));
}

InformationSet rank_one_family(std::size_t candidates, std::size_t dimension,
                               ScaleDistribution scale, std::uint64_t seed, SetForm form) {
  if (form == SetForm::kFactors) {
    const auto make_factor = [=] {
      return [=, x = std::vector<double>(dimension)](Random& random, double* factor) mutable {
        draw_scale(random, scale, x);
        for (std::size_t j = 0; j < dimension; ++j) factor[j] = x[j] * random.normal();
      };
    };
    return InformationSet::of_factors(dimension, 1,
                                      draw_candidates(candidates, dimension, seed, make_factor));
  }
  const auto make_draw = [=] {
    return [=, x = std::vector<double>(dimension)](Random& random, double* packed) mutable {
      draw_scale(random, scale, x);
      for (double& value : x) value *= random.normal();
      for (std::size_t i = 0; i < dimension; ++i) {
        for (std::size_t j = 0; j <= i; ++j) *packed++ = x[i] * x[j];
      }
    };
  };
  return InformationSet(dimension,
                        draw_candidates(candidates, packed_size(dimension), seed, make_draw));
}

InformationSet duplicated_family(std::size_t candidates, std::size_t copies, std::size_t dimension,
                                 std::uint64_t seed) {
  if (copies == 0 || candidates % copies != 0) {
    throw InputError(
        fmt::format("{} candidates are not {} copies of each; ask for a multiple of {}", candidates,
                    copies, copies));
  }
  const std::size_t distinct = candidates / copies;
  const InformationSet original =
      wishart_family(distinct, dimension, dimension, ScaleDistribution::kLogNormal, seed);
  std::vector<std::size_t> indices(candidates);
  for (std::size_t i = 0; i < candidates; ++i) indices[i] = i % distinct;
  return original.subset(indices);
}

}  // namespace graybox
