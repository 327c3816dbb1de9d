// DualNumber: a value with its first derivatives by n variables. A formula that is evaluated on
// dual numbers gives its own derivatives, exact to rounding. This is forward-mode automatic
// differentiation (Griewank and Walther, Evaluating Derivatives, SIAM 2008, chapter 3).
//
//   g(a + v) = g(a) + g'(a) v,   v the derivatives of the argument, v^2 = 0
//
//   using Dual = DualNumber<2>;
//   const Dual x(3.0, 0), y(2.0, 1);
//   const Dual f = x * exp(y);
//   f.v[1];                                                      // 3 exp(2), the derivative by y
//
// Comparisons look at values alone. Where a function has no derivative the derivative is an
// infinity or NaN, as the formula gives it. Cost: n multiplications an operation; no allocation.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace graybox {

template <int n>
struct DualNumber {
  using Derivatives = Eigen::Matrix<double, n, 1>;

  double a = 0.0;
  Derivatives v = Derivatives::Zero();

  DualNumber() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): a number is a formula's constant
  DualNumber(double value) : a(value) {}
  // The variable number `index`.
  DualNumber(double value, int index) : a(value) { v[index] = 1.0; }
  template <typename Vector>
  DualNumber(double value, const Eigen::MatrixBase<Vector>& derivatives)
      : a(value), v(derivatives) {}

  friend DualNumber operator-(const DualNumber& x) { return {-x.a, -x.v}; }
  friend DualNumber operator+(const DualNumber& x, const DualNumber& y) {
    return {x.a + y.a, x.v + y.v};
  }
  friend DualNumber operator+(const DualNumber& x, double y) { return {x.a + y, x.v}; }
  friend DualNumber operator+(double x, const DualNumber& y) { return {x + y.a, y.v}; }
  friend DualNumber operator-(const DualNumber& x, const DualNumber& y) {
    return {x.a - y.a, x.v - y.v};
  }
  friend DualNumber operator-(const DualNumber& x, double y) { return {x.a - y, x.v}; }
  friend DualNumber operator-(double x, const DualNumber& y) { return {x - y.a, -y.v}; }
  friend DualNumber operator*(const DualNumber& x, const DualNumber& y) {
    return {x.a * y.a, x.a * y.v + x.v * y.a};
  }
  friend DualNumber operator*(const DualNumber& x, double y) { return {x.a * y, x.v * y}; }
  friend DualNumber operator*(double x, const DualNumber& y) { return {x * y.a, y.v * x}; }
  // (x / y)' = (x' - (x / y) y') / y, with one division.
  friend DualNumber operator/(const DualNumber& x, const DualNumber& y) {
    const double inverse = 1.0 / y.a, quotient = x.a * inverse;
    return {quotient, (x.v - quotient * y.v) * inverse};
  }
  friend DualNumber operator/(const DualNumber& x, double y) {
    const double inverse = 1.0 / y;
    return {x.a * inverse, x.v * inverse};
  }
  friend DualNumber operator/(double x, const DualNumber& y) {
    return {x / y.a, y.v * (-x / (y.a * y.a))};
  }

  friend bool operator<(const DualNumber& x, const DualNumber& y) { return x.a < y.a; }
  friend bool operator>(const DualNumber& x, const DualNumber& y) { return x.a > y.a; }
  friend bool operator<=(const DualNumber& x, const DualNumber& y) { return x.a <= y.a; }
  friend bool operator>=(const DualNumber& x, const DualNumber& y) { return x.a >= y.a; }
  friend bool operator==(const DualNumber& x, const DualNumber& y) { return x.a == y.a; }

  friend DualNumber abs(const DualNumber& x) {
    return {std::abs(x.a), std::copysign(1.0, x.a) * x.v};
  }
  friend DualNumber sqrt(const DualNumber& x) {
    const double root = std::sqrt(x.a);
    return {root, x.v * (1.0 / (2.0 * root))};
  }
  friend DualNumber exp(const DualNumber& x) {
    const double e = std::exp(x.a);
    return x.mapped(e, e);
  }
  friend DualNumber log(const DualNumber& x) { return x.mapped(std::log(x.a), 1.0 / x.a); }
  friend DualNumber sin(const DualNumber& x) { return x.mapped(std::sin(x.a), std::cos(x.a)); }
  friend DualNumber cos(const DualNumber& x) { return x.mapped(std::cos(x.a), -std::sin(x.a)); }
  friend DualNumber tan(const DualNumber& x) {
    const double t = std::tan(x.a);
    return x.mapped(t, 1.0 + t * t);
  }
  friend DualNumber asin(const DualNumber& x) {
    return x.mapped(std::asin(x.a), 1.0 / std::sqrt(1.0 - x.a * x.a));
  }
  friend DualNumber acos(const DualNumber& x) {
    return x.mapped(std::acos(x.a), -1.0 / std::sqrt(1.0 - x.a * x.a));
  }
  friend DualNumber atan(const DualNumber& x) {
    return x.mapped(std::atan(x.a), 1.0 / (1.0 + x.a * x.a));
  }
  friend DualNumber sinh(const DualNumber& x) { return x.mapped(std::sinh(x.a), std::cosh(x.a)); }
  friend DualNumber cosh(const DualNumber& x) { return x.mapped(std::cosh(x.a), std::sinh(x.a)); }
  friend DualNumber tanh(const DualNumber& x) {
    const double t = std::tanh(x.a);
    return x.mapped(t, 1.0 - t * t);
  }

  // x^y, with (x^y)' = y x^(y-1) x' + x^y log(x) y'. At x = 0 with y >= 1 the second term is 0, its
  // limit. A negative base takes constant whole powers only: others have no derivative by y.
  friend DualNumber pow(const DualNumber& x, const DualNumber& y) {
    if (x.a == 0.0 && y.a > 1.0) return {0.0};
    if (x.a == 0.0 && y.a == 1.0) return x;
    const double value = std::pow(x.a, y.a), by_base = y.a * std::pow(x.a, y.a - 1.0);
    if (x.a < 0.0 && y.a == std::floor(y.a)) {
      DualNumber result(value, by_base * x.v);
      for (int i = 0; i < n; ++i) {
        if (y.v[i] != 0.0) result.v[i] = std::numeric_limits<double>::quiet_NaN();
      }
      return result;
    }
    return {value, by_base * x.v + value * std::log(x.a) * y.v};
  }

 private:
  [[nodiscard]] DualNumber mapped(double value, double slope) const { return {value, slope * v}; }
};

}  // namespace graybox
