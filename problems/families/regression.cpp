#include "graybox/problems/families/regression.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "graybox/problems/error.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

void outer_product(const std::vector<double>& f, double* packed) {
  for (std::size_t i = 0; i < f.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) *packed++ = f[i] * f[j];
  }
}

// Candidates x (rows of the table) to information matrices, by regressors(x, f).
template <typename Regressors>
InformationSet regression_set(CandidateTable table, std::vector<std::string> parameters,
                              Regressors regressors) {
  const std::size_t n = table.names.size();
  const std::size_t d = parameters.size();
  const std::size_t candidates = table.values.size() / n;
  AlignedArray information(candidates * packed_size(d));
  std::vector<double> f(d);
  for (std::size_t i = 0; i < candidates; ++i) {
    regressors(table.values.data() + i * n, f);
    outer_product(f, information.data() + i * packed_size(d));
  }
  table.units.resize(n);
  return InformationSet(d, std::move(information), std::move(table), std::move(parameters));
}

// P_0 .. P_n at x by the three-term recurrence.
void legendre(double x, std::vector<double>& values) {
  values[0] = 1.0;
  if (values.size() > 1) values[1] = x;
  for (std::size_t k = 2; k < values.size(); ++k) {
    const auto m = static_cast<double>(k);
    values[k] = ((2.0 * m - 1.0) * x * values[k - 1] - (m - 1.0) * values[k - 2]) / m;
  }
}

std::vector<std::string> numbered(const char* letter, std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 1; i <= count; ++i) names.push_back(fmt::format("{}{}", letter, i));
  return names;
}

// All points of a grid with the same levels in each factor, the last factor fastest.
std::vector<double> grid(const std::vector<double>& levels, std::size_t factors) {
  std::size_t count = 1;
  for (std::size_t k = 0; k < factors; ++k) count *= levels.size();
  std::vector<double> values(count * factors);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = factors, rest = i; k-- > 0; rest /= levels.size()) {
      values[i * factors + k] = levels[rest % levels.size()];
    }
  }
  return values;
}

}  // namespace

InformationSet polynomial_regression(std::size_t degree, std::span<const double> points,
                                     PolynomialBasis basis) {
  const std::set<double> distinct(points.begin(), points.end());
  if (distinct.size() < degree + 1) {
    throw InputError(fmt::format("a polynomial of degree {} needs {} distinct points, there are {}",
                                 degree, degree + 1, distinct.size()));
  }
  const bool monomial = basis == PolynomialBasis::kMonomial;
  std::vector<std::string> parameters;
  for (std::size_t k = 0; k <= degree; ++k) {
    parameters.push_back(fmt::format("{}{}", monomial ? "x^" : "P_", k));
  }
  return regression_set({{"x"}, {}, {points.begin(), points.end()}}, std::move(parameters),
                        [monomial](const double* x, std::vector<double>& f) {
                          if (!monomial) return legendre(*x, f);
                          f[0] = 1.0;
                          for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] * *x;
                        });
}

std::vector<double> even_points(std::size_t count) {
  if (count < 2) throw InputError(fmt::format("{} points do not span an interval", count));
  std::vector<double> points(count);
  const auto last = static_cast<double>(count - 1);
  // Symmetric to the last bit, and 0 exactly in the middle.
  for (std::size_t i = 0; i < count; ++i) {
    points[i] = (2.0 * static_cast<double>(i) - last) / last;
  }
  return points;
}

std::vector<double> optimal_polynomial_points(std::size_t degree) {
  if (degree == 0) throw InputError("the degree of the polynomial must be at least 1");
  const auto n = static_cast<double>(degree);
  std::vector<double> points(degree + 1), p(degree + 1);
  for (std::size_t i = 0; i <= degree; ++i) {
    // Newton on P_n'(x) from the Chebyshev-Lobatto points. With (1-x^2) P_n' = n (P_{n-1} - x P_n)
    // and Legendre's equation, P_n'' = (2 x P_n' - n (n+1) P_n) / (1 - x^2).
    double x = -std::cos(std::numbers::pi * static_cast<double>(i) / n);
    if (i == 0 || i == degree) {
      points[i] = i == 0 ? -1.0 : 1.0;
      continue;
    }
    for (int iteration = 0; iteration < 50; ++iteration) {
      legendre(x, p);
      const double slope = n * (p[degree - 1] - x * p[degree]) / (1.0 - x * x);
      const double curvature = (2.0 * x * slope - n * (n + 1.0) * p[degree]) / (1.0 - x * x);
      const double step = slope / curvature;
      x -= step;
      if (std::abs(step) < 1e-15) break;
    }
    points[i] = x;
  }
  return points;
}

InformationSet two_level_factorial(std::size_t factors, std::size_t interactions) {
  if (factors < 1 || factors > 24) {
    throw InputError(fmt::format("{} factors: a two-level factorial takes 1 to 24", factors));
  }
  if (interactions != 1 && interactions != 2) {
    throw InputError(
        fmt::format("interactions of order {}: choose 1 (main effects) or 2", interactions));
  }
  std::vector<std::string> parameters{"1"};
  const auto names = numbered("x", factors);
  parameters.insert(parameters.end(), names.begin(), names.end());
  for (std::size_t i = 0; interactions == 2 && i < factors; ++i) {
    for (std::size_t j = i + 1; j < factors; ++j) parameters.push_back(names[i] + " " + names[j]);
  }
  return regression_set({names, {}, grid({-1.0, 1.0}, factors)}, std::move(parameters),
                        [=](const double* x, std::vector<double>& f) {
                          std::size_t k = 0;
                          f[k++] = 1.0;
                          for (std::size_t i = 0; i < factors; ++i) f[k++] = x[i];
                          for (std::size_t i = 0; interactions == 2 && i < factors; ++i) {
                            for (std::size_t j = i + 1; j < factors; ++j) f[k++] = x[i] * x[j];
                          }
                        });
}

InformationSet cube_regression(std::size_t levels) {
  constexpr std::size_t kFactors = 7;
  constexpr std::size_t kQuadratic = 4;
  if (levels < 3 || levels % 2 == 0) {
    throw InputError(fmt::format("{} levels: the cube needs an odd number, at least 3", levels));
  }
  const auto names = numbered("x", kFactors);
  std::vector<std::string> parameters{"1"};
  parameters.insert(parameters.end(), names.begin(), names.end());
  for (std::size_t i = 0; i < kQuadratic; ++i) parameters.push_back(names[i] + "^2");
  return regression_set({names, {}, grid(even_points(levels), kFactors)}, std::move(parameters),
                        [](const double* x, std::vector<double>& f) {
                          f[0] = 1.0;
                          for (std::size_t i = 0; i < kFactors; ++i) f[1 + i] = x[i];
                          for (std::size_t i = 0; i < kQuadratic; ++i) {
                            f[1 + kFactors + i] = x[i] * x[i];
                          }
                        });
}

}  // namespace graybox
