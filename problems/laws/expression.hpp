// Expression: a formula in text, compiled once and evaluated for any number type, so that
// derivatives come from dual numbers (dual_number.hpp) as those of the laws in formula_law.hpp do.
//
//   const Expression force("k * z^5 + c * z^2 * v", names);      // names = {"z", "v", "k", "c"}
//   force.evaluate<double>(values);                              // in the order of the names
//
// Numbers, names, + - * / ^ (right to left, before the sign: -z^2 = -(z^2)), parentheses, pi, and
// abs, sign, sqrt, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, min(a, b), max(a,
// b). Cost: one operation a number, name or sign of the text; no allocation.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace graybox {

// What is wrong with the text, and where.
class ExpressionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Expression {
 public:
  // Throws ExpressionError.
  Expression(const std::string& text, std::span<const std::string> names);

  template <typename T>
  [[nodiscard]] T evaluate(std::span<const T> values) const;

  // Whether the name of this index occurs.
  [[nodiscard]] bool uses(std::size_t name) const;

  // The formula in C99, with these names in place of its own. It calls functions of math.h, and
  // sign_of(x), -1, 0 or 1, which the caller's program must have.
  [[nodiscard]] std::string c_text(std::span<const std::string> names) const;

 private:
  friend class ExpressionReader;

  enum class Operation : std::uint8_t {
    kNumber,
    kName,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kNegate,
    kPower,
    kWholePower,  // to a whole number, of any sign of the base
    kAbs,
    kSign,
    kSqrt,
    kExp,
    kLog,
    kSin,
    kCos,
    kTan,
    kAsin,
    kAcos,
    kAtan,
    kSinh,
    kCosh,
    kTanh,
    kMin,
    kMax,
  };
  struct Step {
    Operation operation = Operation::kNumber;
    double number = 0.0;
    std::size_t name = 0;
  };

  static constexpr std::size_t kMaxDepth = 32;

  template <typename T>
  static T whole_power(const T& base, double exponent);
  template <typename T>
  static T of_one(Operation operation, const T& x);
  template <typename T>
  static T of_two(Operation operation, const T& x, const T& y);
  // How many operands an operation takes from the stack.
  static int operands(Operation operation);
  struct Phrase;  // a part of the formula in C
  static Phrase phrase_of(const Step& step, const std::string& name);
  static Phrase joined(Operation operation, const Phrase& x, const Phrase& y);
  static Phrase applied(const Step& step, const Phrase& x);

  std::vector<Step> steps_;  // operands before their operation
};

template <typename T>
T Expression::whole_power(const T& base, double exponent) {
  T result(1.0);
  for (int i = 0; i < std::abs(static_cast<int>(exponent)); ++i) result = result * base;
  return exponent < 0.0 ? T(1.0) / result : result;
}

template <typename T>
T Expression::of_one(Operation operation, const T& x) {
  using std::abs, std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::asin, std::acos,
      std::atan, std::sinh, std::cosh, std::tanh;
  switch (operation) {
    case Operation::kNegate:
      return -x;
    case Operation::kAbs:
      return abs(x);
    case Operation::kSign:
      return T(x > T(0.0) ? 1.0 : (x < T(0.0) ? -1.0 : 0.0));
    case Operation::kSqrt:
      return sqrt(x);
    case Operation::kExp:
      return exp(x);
    case Operation::kLog:
      return log(x);
    case Operation::kSin:
      return sin(x);
    case Operation::kCos:
      return cos(x);
    case Operation::kTan:
      return tan(x);
    case Operation::kAsin:
      return asin(x);
    case Operation::kAcos:
      return acos(x);
    case Operation::kAtan:
      return atan(x);
    case Operation::kSinh:
      return sinh(x);
    case Operation::kCosh:
      return cosh(x);
    default:
      return tanh(x);
  }
}

template <typename T>
T Expression::of_two(Operation operation, const T& x, const T& y) {
  using std::pow;
  switch (operation) {
    case Operation::kAdd:
      return x + y;
    case Operation::kSubtract:
      return x - y;
    case Operation::kMultiply:
      return x * y;
    case Operation::kDivide:
      return x / y;
    case Operation::kMin:
      return y < x ? y : x;
    case Operation::kMax:
      return x < y ? y : x;
    default:
      return pow(x, y);
  }
}

template <typename T>
T Expression::evaluate(std::span<const T> values) const {
  std::array<T, kMaxDepth> stack;
  std::size_t top = 0;  // one past the last operand
  for (const Step& step : steps_) {
    switch (operands(step.operation)) {
      case 0:
        stack[top++] = step.operation == Operation::kNumber ? T(step.number) : values[step.name];
        break;
      case 1:
        stack[top - 1] = step.operation == Operation::kWholePower
                             ? whole_power(stack[top - 1], step.number)
                             : of_one(step.operation, stack[top - 1]);
        break;
      default:
        stack[top - 2] = of_two(step.operation, stack[top - 2], stack[top - 1]);
        --top;
    }
  }
  return stack[0];
}

}  // namespace graybox
