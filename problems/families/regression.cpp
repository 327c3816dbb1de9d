#include "problems/families/regression.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"

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

// T_0 .. T_n at x.
void chebyshev(double x, std::vector<double>& values) {
  values[0] = 1.0;
  if (values.size() > 1) values[1] = x;
  for (std::size_t k = 2; k < values.size(); ++k) {
    values[k] = 2.0 * x * values[k - 1] - values[k - 2];
  }
}

void monomials(double x, std::vector<double>& values) {
  values[0] = 1.0;
  for (std::size_t k = 1; k < values.size(); ++k) values[k] = values[k - 1] * x;
}

// The B-splines of the clamped even knots over [-1, 1] at x, by the recurrence of Cox and de Boor.
class SplineBasis {
 public:
  explicit SplineBasis(std::size_t count) : degree_(std::min<std::size_t>(3, count - 1)) {
    const std::size_t intervals = count - degree_;
    knots_.assign(degree_, -1.0);
    for (std::size_t k = 0; k <= intervals; ++k) {
      knots_.push_back(-1.0 + 2.0 * static_cast<double>(k) / static_cast<double>(intervals));
    }
    knots_.insert(knots_.end(), degree_, 1.0);
  }

  void operator()(double x, std::vector<double>& values) const {
    std::ranges::fill(values, 0.0);
    // The interval of x; the last is closed.
    std::size_t last = degree_;
    while (last + 1 < values.size() && x >= knots_[last + 1]) ++last;
    values[last] = 1.0;
    for (std::size_t k = 1; k <= degree_; ++k) {
      for (std::size_t i = last - k; i <= last; ++i) {
        const double left = i == last - k ? 0.0 : share(x, i, k) * values[i];
        const double right = i == last ? 0.0 : (1.0 - share(x, i + 1, k)) * values[i + 1];
        values[i] = left + right;
      }
    }
  }

 private:
  // How far x stands in the support of spline i of degree k - 1.
  [[nodiscard]] double share(double x, std::size_t i, std::size_t k) const {
    return (x - knots_[i]) / (knots_[i + k] - knots_[i]);
  }

  std::size_t degree_;
  std::vector<double> knots_;
};

// Regression on one factor x.
template <typename Regressors>
InformationSet curve_set(std::span<const double> points, std::vector<std::string> parameters,
                         Regressors regressors) {
  return regression_set({{"x"}, {}, {points.begin(), points.end()}}, std::move(parameters),
                        [&](const double* x, std::vector<double>& f) { regressors(*x, f); });
}

void require_distinct(std::span<const double> points, std::size_t wanted, const std::string& who) {
  const std::set<double> distinct(points.begin(), points.end());
  if (distinct.size() >= wanted) return;
  throw InputError(
      fmt::format("{} needs {} distinct points, there are {}", who, wanted, distinct.size()));
}

// The ratio of the extreme eigenvalues of the sum of the matrices, each of unit size, after scaling
// to unit diagonal: what InformationSet::validate() judges.
double reciprocal_condition(const InformationSet& set) {
  const std::size_t d = set.dimension();
  std::vector<double> sum(set.packed_size(), 0.0);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto h = set.information(i);
    double size = 0.0;
    for (std::size_t j = 0; j < d; ++j) size = std::max(size, h[packed_index(j, j)]);
    for (std::size_t k = 0; size > 0.0 && k < sum.size(); ++k) sum[k] += h[k] / size;
  }
  Eigen::MatrixXd total(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(d));
  unpack(sum.data(), d, total.data());
  if (!(total.diagonal().minCoeff() > 0.0)) return 0.0;
  const Eigen::VectorXd scale = total.diagonal().cwiseSqrt().cwiseInverse();
  total = scale.asDiagonal() * total * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(total, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()(0) / eigen.eigenvalues()(total.rows() - 1);
}

InformationSet require_regular(InformationSet set, const std::string& what,
                               const std::string& remedy) {
  const double condition = reciprocal_condition(set);
  if (condition > 1e-14 * static_cast<double>(set.dimension())) return set;
  throw InputError(
      fmt::format("{} on these {} points can't be told apart in double precision (reciprocal "
                  "condition {:.1e} of the sum of the information matrices); {}",
                  what, set.candidate_count(), condition, remedy));
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
  require_distinct(points, degree + 1, fmt::format("a polynomial of degree {}", degree));
  const bool monomial = basis == PolynomialBasis::kMonomial;
  const bool is_legendre = basis == PolynomialBasis::kLegendre;
  const char* const letter = monomial ? "x^" : is_legendre ? "P_" : "T_";
  std::vector<std::string> parameters;
  for (std::size_t k = 0; k <= degree; ++k) parameters.push_back(fmt::format("{}{}", letter, k));
  const auto regressors = monomial ? monomials : is_legendre ? legendre : chebyshev;
  const std::string what = fmt::format("{} up to degree {}",
                                       monomial      ? "monomials"
                                       : is_legendre ? "Legendre polynomials"
                                                     : "Chebyshev polynomials",
                                       degree);
  return require_regular(curve_set(points, std::move(parameters), regressors), what,
                         monomial ? "take the basis legendre or chebyshev: the optimal designs are "
                                    "the same"
                                  : "take more points or a lower degree");
}

InformationSet spline_regression(std::size_t parameters, std::span<const double> points) {
  require_distinct(points, parameters, fmt::format("a spline of {} parameters", parameters));
  return require_regular(curve_set(points, numbered("B", parameters), SplineBasis(parameters)),
                         fmt::format("{} B-splines", parameters),
                         "take more points or fewer splines");
}

InformationSet exponential_regression(std::size_t parameters, std::span<const double> points) {
  require_distinct(points, parameters, fmt::format("a sum of {} decays", parameters));
  const auto decays = [](double x, std::vector<double>& f) {
    double rate = 1.0;
    for (double& value : f) {
      value = std::exp(-rate * 0.5 * (x + 1.0));
      rate *= 2.0;
    }
  };
  return require_regular(curve_set(points, numbered("decay", parameters), decays),
                         fmt::format("{} decays of rates 1, 2, 4, ...", parameters),
                         "take fewer of them, or an orthogonal basis of the same curves: the "
                         "optimal designs are the same");
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
