#include "problems/families/families.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/families/random_families.hpp"
#include "problems/families/regression.hpp"
#include "problems/families/smooth_family.hpp"

namespace graybox {
namespace {

using Maker = std::function<InformationSet(std::size_t candidates, std::size_t dimension,
                                           std::uint64_t seed)>;

constexpr std::size_t kStudyCandidates = 7920;
constexpr std::size_t kStudyDimension = 12;
constexpr std::size_t kFlatDegrees = 200;
constexpr std::size_t kCopies = 10;

Maker wishart(ScaleDistribution scale) {
  return [scale](std::size_t q, std::size_t d, std::uint64_t seed) {
    return wishart_family(q, d, d, scale, seed);
  };
}

Maker rank_one(ScaleDistribution scale) {
  return [scale](std::size_t q, std::size_t d, std::uint64_t seed) {
    return rank_one_family(q, d, scale, seed);
  };
}

Maker cube(std::size_t levels) {
  return [levels](std::size_t, std::size_t, std::uint64_t) { return cube_regression(levels); };
}

InformationSet flat(std::size_t q, std::size_t d, std::uint64_t seed) {
  return wishart_family(q, d, std::max(kFlatDegrees, d), ScaleDistribution::kNone, seed);
}

InformationSet smooth(std::size_t q, std::size_t d, std::uint64_t seed) {
  return smooth_family(q, d, d, 5.0, seed);
}

InformationSet smooth_rank_six(std::size_t q, std::size_t d, std::uint64_t seed) {
  return smooth_family(q, d, 6, 0.0, seed);
}

InformationSet duplicated(std::size_t q, std::size_t d, std::uint64_t seed) {
  return duplicated_family(q, kCopies, d, seed);
}

// Regression on even points of [-1, 1]; the seed does not matter.
Maker polynomials(PolynomialBasis basis) {
  return [basis](std::size_t q, std::size_t d, std::uint64_t) {
    return polynomial_regression(d - 1, even_points(q), basis);
  };
}

InformationSet splines(std::size_t q, std::size_t d, std::uint64_t) {
  return spline_regression(d, even_points(q));
}

InformationSet exponentials(std::size_t q, std::size_t d, std::uint64_t) {
  return exponential_regression(d, even_points(q));
}

struct Entry {
  Family family;
  Maker make;
};

const std::vector<Entry>& entries() {
  constexpr std::size_t q = kStudyCandidates;
  constexpr std::size_t d = kStudyDimension;
  static const std::vector<Entry> list{
      {{"rob", "log-normal Wishart matrices: a few outliers dominate", q, d, false},
       wishart(ScaleDistribution::kLogNormal)},
      {{"wis", "plain Wishart matrices", q, d, false}, wishart(ScaleDistribution::kNone)},
      {{"flat", "Wishart, 200 degrees of freedom: nearly equal candidates", q, d, false}, flat},
      {{"smo", "smooth manifold over four angles, scaled over five decades", q, d, false}, smooth},
      {{"smr6", "smooth manifold over four angles, rank 6", q, d, false}, smooth_rank_six},
      {{"r1g", "rank one, Gaussian", q, d, false}, rank_one(ScaleDistribution::kNone)},
      {{"r1l", "rank one, log-normal scales", q, d, false},
       rank_one(ScaleDistribution::kLogNormal)},
      {{"cube3", "quadratic-type regression on the 3^7 grid: massive ties", 2187, d, true},
       cube(3)},
      {{"cube5", "quadratic-type regression on the 5^7 grid: massive ties", 78125, d, true},
       cube(5)},
      {{"dup", "every matrix of rob ten times", 5000, d, false}, duplicated},
      {{"decades", "Wishart matrices whose diagonals spread over twelve decades", q, d, false},
       wishart(ScaleDistribution::kDecades)},
      {{"legendre", "Legendre polynomials on even points of [-1, 1]", q, d, false, false},
       polynomials(PolynomialBasis::kLegendre)},
      {{"chebyshev", "Chebyshev polynomials on the same points", q, d, false, false},
       polynomials(PolynomialBasis::kChebyshev)},
      {{"monomials", "1, x, x^2, ... on the same points: ill-conditioned", q, d, false, false},
       polynomials(PolynomialBasis::kMonomial)},
      {{"splines", "cubic B-splines on the same points", q, d, false, false}, splines},
      {{"exponentials", "decays exp(-2^k t) at even times of [0, 1]", q, 8, false, false},
       exponentials},
  };
  return list;
}

const Entry& find(std::string_view name) {
  std::string known;
  for (const Entry& entry : entries()) {
    if (entry.family.name == name) return entry;
    known += (known.empty() ? "" : ", ") + entry.family.name;
  }
  throw InputError(fmt::format("unknown family '{}'; choose one of {}", name, known));
}

}  // namespace

const std::vector<Family>& families() {
  static const std::vector<Family> list = [] {
    std::vector<Family> made;
    for (const Entry& entry : entries()) made.push_back(entry.family);
    return made;
  }();
  return list;
}

InformationSet make_family(std::string_view name, std::size_t candidates, std::size_t dimension,
                           std::uint64_t seed, SetForm form) {
  const Entry& entry = find(name);
  const Family& family = entry.family;
  const std::size_t q = candidates == 0 ? family.default_candidates : candidates;
  const std::size_t d = dimension == 0 ? family.default_dimension : dimension;
  if (family.fixed_size && (q != family.default_candidates || d != family.default_dimension)) {
    throw InputError(
        fmt::format("family {} has {} candidates and {} parameters, no others; take a "
                    "subset of it",
                    name, family.default_candidates, family.default_dimension));
  }
  if (form == SetForm::kFactors) {
    if (name != "r1g" && name != "r1l") {
      throw InputError(fmt::format("family {} has no factors; --factors is for r1g and r1l", name));
    }
    const auto scale = name == "r1g" ? ScaleDistribution::kNone : ScaleDistribution::kLogNormal;
    return rank_one_family(q, d, scale, seed, form).renamed(std::string(name));
  }
  InformationSet made = entry.make(q, d, seed);
  return std::move(made).renamed(std::string(name));
}

}  // namespace graybox
