// LogDetLine: the exact line search of the exchange methods, for directions of any rank.
//
// Along a line of symmetric matrices M + a D, with M = L L^T positive definite and C = L^-1 D L^-T,
//
//   phi(a) = log det(M + a D) - log det M = log det(I + a C) = sum_k log(1 + a c_k)
//
// is concave; c_k are the generalised eigenvalues of (D, M). Instead of computing them, C is
// reduced once to tridiagonal form T by Householder reflections (Golub and Van Loan, Matrix
// Computations, Algorithm 8.3.1; 4/3 d^3 flops), after which the pivots of I + a T,
//
//   q_1 = 1 + a t_1,      q_k = 1 + a t_k - (a b_{k-1})^2 / q_{k-1},
//
// give phi = sum log q_k and, differentiated term by term, phi' and phi'' in O(d). M + a D is
// positive definite exactly where all pivots are positive. Newton's method on phi' = 0, kept in a
// bracket by bisection, takes 3 to 6 such evaluations. For the rank-one exchange H_i = x x^T, H_j =
// y y^T this is the closed form of Boehning 1986, to rounding.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class LogDetLine {
 public:
  explicit LogDetLine(std::size_t dimension);

  // Direction C, symmetric, full row-major d x d. Overwrites it.
  void set_direction(std::span<double> direction);

  // phi'(0) = tr C.
  [[nodiscard]] double slope_at_zero() const;

  // The a in [lowest, highest] (lowest <= 0 <= highest, either may be infinite) that maximises phi
  // among those with M + a D positive definite. An end is returned exactly where it is the
  // maximiser.
  [[nodiscard]] double maximise(double lowest, double highest) const;

  // phi(a); minus infinity where M + a D is not positive definite.
  [[nodiscard]] double value(double a) const;

 private:
  struct Derivatives {
    bool definite = false;
    double slope = 0.0;
    double curvature = 0.0;
  };
  [[nodiscard]] Derivatives derivatives(double a) const;
  [[nodiscard]] double slope_rounding() const;

  std::size_t dimension_;
  std::vector<double> diagonal_;      // t
  std::vector<double> off_diagonal_;  // b, d - 1 of them
  std::vector<double> reflector_;
  std::vector<double> product_;
};

}  // namespace graybox
