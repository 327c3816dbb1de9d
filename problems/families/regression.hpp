// Linear regression problems: a measurement at the point x informs about the coefficients of
// y = f(x)' theta + noise of unit variance by the rank-one matrix H = f(x) f(x)'. Their D-optimal
// designs are known in closed form, which makes them the truth of many tests.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// Polynomials of degree n on [-1, 1], d = n + 1, by one of three bases: f = (1, x, ..., x^n), the
// Legendre polynomials (P_0, ..., P_n) or those of Chebyshev (T_0, ..., T_n). The optimal design is
// the same for all: weight 1/(n+1) on each of the n + 1 roots of (1 - x^2) P_n'(x) (Guest 1958,
// Hoel 1958). The condition number of M is not: it grows like 5.8^n for monomials, like n for
// Legendre's and hardly for Chebyshev's.
enum class PolynomialBasis { kMonomial, kLegendre, kChebyshev };
// Throws InputError if degree + 1 distinct points are not there, or if the sum of the matrices is
// singular in double precision, naming the bases to take instead (monomials beyond degree 16 or
// so).
[[nodiscard]] InformationSet polynomial_regression(std::size_t degree,
                                                   std::span<const double> points,
                                                   PolynomialBasis basis);

// Cubic splines on [-1, 1] with `parameters` B-splines over even knots, the first and the last
// repeated (de Boor 1978); of lower degree where there are fewer than four parameters.
[[nodiscard]] InformationSet spline_regression(std::size_t parameters,
                                               std::span<const double> points);

// A sum of decays exp(-r_k t) of known rates r_k = 2^k, k = 0 .. parameters - 1, at the times
// t = (x + 1) / 2 of [0, 1]. Throws InputError where the decays can't be told apart in double
// precision.
[[nodiscard]] InformationSet exponential_regression(std::size_t parameters,
                                                    std::span<const double> points);

// Points -1 .. 1, evenly spaced; count >= 2.
[[nodiscard]] std::vector<double> even_points(std::size_t count);

// The roots of (1 - x^2) P_n'(x), ascending; degree n >= 1.
[[nodiscard]] std::vector<double> optimal_polynomial_points(std::size_t degree);

// All 2^k points of {-1, 1}^k; f = (1, x_1, ..., x_k) and, for interactions = 2, the products
// x_i x_j. The uniform design is optimal with M = I, log det M = 0. Ties abound: every candidate
// has sensitivity d at the optimum. 1 <= factors <= 24, interactions 1 or 2.
[[nodiscard]] InformationSet two_level_factorial(std::size_t factors, std::size_t interactions);

// The grid of `levels` evenly spaced levels of [-1, 1] in 7 factors, the last varying fastest;
// f = (1, x_1, ..., x_7, x_1^2, ..., x_4^2), d = 12. Any design whose margins are uniform on
// {-1, 0, 1} for the first four factors and on {-1, 1} for the others, all pairwise independent, is
// optimal: up to 3^4 2^3 = 648 candidates of equal weight, fewer in many other ways. With
// E x^2 = 2/3 and Var x^2 = 2/9, log det M = 4 (log 2/3 + log 2/9). `levels` must be odd, at least
// 3.
[[nodiscard]] InformationSet cube_regression(std::size_t levels);

}  // namespace graybox
