// Derivatives by dual numbers: against differences, and bit for bit against Ceres's.
#include "problems/laws/dual_number.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace graybox {
namespace {

constexpr int kFormulas = 26;

// Every operation and function, for arguments between 0 and 1.
template <typename T>
T formula(int which, const T& x, const T& y) {
  using std::abs, std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::asin, std::acos,
      std::atan, std::sinh, std::cosh, std::tanh, std::pow;
  switch (which) {
    case 0:
      return -x + y;
    case 1:
      return x + 2.5;
    case 2:
      return 2.5 + x;
    case 3:
      return x - y;
    case 4:
      return x - 2.5;
    case 5:
      return 2.5 - x;
    case 6:
      return x * y;
    case 7:
      return x * 0.3;
    case 8:
      return 0.3 * x;
    case 9:
      return x / y;
    case 10:
      return x / 0.3;
    case 11:
      return 0.3 / x;
    case 12:
      return abs(x - y);
    case 13:
      return sqrt(x * y);
    case 14:
      return exp(x - y * y);
    case 15:
      return log(x + y);
    case 16:
      return sin(x * y);
    case 17:
      return cos(x / y);
    case 18:
      return tan(x * y);
    case 19:
      return asin(x * y);
    case 20:
      return acos(x * y);
    case 21:
      return atan(x - y);
    case 22:
      return sinh(x - y);
    case 23:
      return cosh(x - y);
    case 24:
      return tanh(x / y);
    default:
      return pow(x, y);
  }
}

std::vector<double> points() {
  std::vector<double> result;
  for (int i = 0; i < 40; ++i) result.push_back(0.011 + 0.0241 * i);
  return result;
}

TEST(DualNumber, DerivativesAreThoseOfDifferences) {
  const double h = 1e-6;
  for (int which = 0; which < kFormulas; ++which) {
    for (const double x : points()) {
      const double y = 1.03 - x;
      const auto f = formula(which, DualNumber<2>(x, 0), DualNumber<2>(y, 1));
      EXPECT_EQ(f.a, formula(which, DualNumber<1>(x), DualNumber<1>(y)).a);
      const double by_x = (formula(which, x + h, y) - formula(which, x - h, y)) / (2 * h);
      const double by_y = (formula(which, x, y + h) - formula(which, x, y - h)) / (2 * h);
      EXPECT_NEAR(f.v[0], by_x, 1e-4 * (1.0 + std::abs(by_x))) << which << " at " << x;
      EXPECT_NEAR(f.v[1], by_y, 1e-4 * (1.0 + std::abs(by_y))) << which << " at " << x;
    }
  }
}

void expect_same_bits(double ours, double ceres) {
  if (std::isnan(ours) && std::isnan(ceres)) return;
  EXPECT_EQ(std::bit_cast<std::uint64_t>(ours), std::bit_cast<std::uint64_t>(ceres));
}

TEST(DualNumber, EqualsThatOfCeresBitForBit) {
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> values = points();
  values.insert(values.end(), {0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 3.0, 1e-300, infinity});
  for (int which = 0; which < kFormulas; ++which) {
    for (const double x : values) {
      for (const double y : values) {
        SCOPED_TRACE(testing::Message() << which << " at " << x << ", " << y);
        const auto ours = formula(which, DualNumber<2>(x, 0), DualNumber<2>(y, 1));
        const auto theirs =
            formula(which, ceres::Jet<double, 2>(x, 0), ceres::Jet<double, 2>(y, 1));
        expect_same_bits(ours.a, theirs.a);
        expect_same_bits(ours.v[0], theirs.v[0]);
        expect_same_bits(ours.v[1], theirs.v[1]);
      }
    }
  }
}

TEST(DualNumber, ComparesByValueAlone) {
  const DualNumber<2> x(1.0, 0), y(2.0, 1);
  EXPECT_TRUE(x < y && y > x && x <= y && y >= x && x <= 1.0 && x < 1.5 && x == 1.0 &&
              x == DualNumber<2>(1.0, 1));
  EXPECT_FALSE(x > y || x >= y || y <= x || y < x || x == y);
}

}  // namespace
}  // namespace graybox
