#include "problems/laws/expression.hpp"
#include "problems/base/shortened.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

namespace graybox {

// Recursive descent: sum <- product <- sign <- power <- value.
class ExpressionReader {
 public:
  using Operation = Expression::Operation;
  using Step = Expression::Step;

  struct Function {
    std::string_view name;
    Operation operation;
  };
  static constexpr std::array<Function, 16> kFunctions{{
      {"abs", Operation::kAbs},
      {"sign", Operation::kSign},
      {"sqrt", Operation::kSqrt},
      {"exp", Operation::kExp},
      {"log", Operation::kLog},
      {"sin", Operation::kSin},
      {"cos", Operation::kCos},
      {"tan", Operation::kTan},
      {"asin", Operation::kAsin},
      {"acos", Operation::kAcos},
      {"atan", Operation::kAtan},
      {"sinh", Operation::kSinh},
      {"cosh", Operation::kCosh},
      {"tanh", Operation::kTanh},
      {"min", Operation::kMin},
      {"max", Operation::kMax},
  }};

  ExpressionReader(const std::string& text, std::span<const std::string> names)
      : text_(text), names_(names) {}

  std::vector<Step> read() {
    read_sum();
    skip_blanks();
    if (at_ < text_.size()) fail(fmt::format("'{}' is not expected here", text_[at_]));
    return std::move(steps_);
  }

 private:
  static constexpr int kMaxNesting = 100;  // of parentheses and signs: protects this reader's stack

  [[noreturn]] void fail(const std::string& message) const {
    throw ExpressionError(
        fmt::format("'{}', character {}: {}", shortened(text_), at_ + 1, message));
  }

  void skip_blanks() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
  }

  bool take(char expected) {
    skip_blanks();
    if (at_ >= text_.size() || text_[at_] != expected) return false;
    ++at_;
    return true;
  }

  void require(char expected) {
    if (!take(expected)) fail(fmt::format("'{}' is missing", expected));
  }

  void push(Step step) {
    const int taken = Expression::operands(step.operation);
    depth_ += static_cast<std::size_t>(1 - taken);
    if (depth_ > Expression::kMaxDepth) fail("the formula is nested too deeply");
    steps_.push_back(step);
  }

  void read_sum() {
    read_product();
    for (;;) {
      if (take('+')) {
        read_product();
        push({Operation::kAdd});
      } else if (take('-')) {
        read_product();
        push({Operation::kSubtract});
      } else {
        return;
      }
    }
  }

  void read_product() {
    read_sign();
    for (;;) {
      if (take('*')) {
        read_sign();
        push({Operation::kMultiply});
      } else if (take('/')) {
        read_sign();
        push({Operation::kDivide});
      } else {
        return;
      }
    }
  }

  void read_sign() {
    if (++nesting_ > kMaxNesting) fail("the formula is nested too deeply");
    if (take('-')) {
      read_sign();
      push({Operation::kNegate});
    } else if (take('+')) {
      read_sign();
    } else {
      read_power();
    }
    --nesting_;
  }

  void read_power() {
    read_value();
    if (!take('^')) return;
    const std::size_t first = steps_.size();
    read_sign();
    if (const auto whole = whole_number_since(first)) {
      steps_.resize(first);
      --depth_;
      push({Operation::kWholePower, *whole});
    } else {
      push({Operation::kPower});
    }
  }

  // The exponent, where it is a small whole number.
  [[nodiscard]] std::optional<double> whole_number_since(std::size_t first) const {
    constexpr double kLargest = 64.0;
    if (steps_[first].operation != Operation::kNumber) return {};
    double value = steps_[first].number;
    for (std::size_t i = first + 1; i < steps_.size(); ++i) {
      if (steps_[i].operation != Operation::kNegate) return {};
      value = -value;
    }
    if (value != std::round(value) || std::abs(value) > kLargest) return {};
    return value;
  }

  void read_value() {
    skip_blanks();
    if (at_ >= text_.size()) fail("the formula ends too early");
    const auto next = static_cast<unsigned char>(text_[at_]);
    if (take('(')) {
      read_sum();
      require(')');
    } else if (std::isdigit(next) != 0 || next == '.') {
      read_number();
    } else if (std::isalpha(next) != 0 || next == '_') {
      read_name();
    } else {
      fail(fmt::format("'{}' is not expected here", text_[at_]));
    }
  }

  void read_number() {
    double number = 0.0;
    const char* first = text_.data() + at_;
    const auto [end, error] = std::from_chars(first, text_.data() + text_.size(), number);
    if (error != std::errc()) fail("is no number");
    at_ += static_cast<std::size_t>(end - first);
    push({Operation::kNumber, number});
  }

  void read_name() {
    const std::size_t first = at_;
    while (at_ < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_')) {
      ++at_;
    }
    const std::string_view name = std::string_view(text_).substr(first, at_ - first);
    if (take('(')) {
      read_arguments(name);
      return;
    }
    const auto known = std::ranges::find(names_, name);
    if (known != names_.end()) {
      push({Operation::kName, 0.0, static_cast<std::size_t>(known - names_.begin())});
    } else if (name == "pi") {
      push({Operation::kNumber, std::numbers::pi});
    } else {
      at_ = first;
      fail(fmt::format("'{}' is neither z, v, a state nor a parameter", name));
    }
  }

  void read_arguments(std::string_view name) {
    const auto* function = std::ranges::find(kFunctions, name, &Function::name);
    if (function == kFunctions.end()) fail(fmt::format("there is no function '{}'", name));
    read_sum();
    for (int i = 1; i < Expression::operands(function->operation); ++i) {
      require(',');
      read_sum();
    }
    require(')');
    push({function->operation});
  }

  const std::string& text_;
  std::span<const std::string> names_;
  std::size_t at_ = 0;
  std::size_t depth_ = 0;
  int nesting_ = 0;
  std::vector<Step> steps_;
};

Expression::Expression(const std::string& text, std::span<const std::string> names)
    : steps_(ExpressionReader(text, names).read()) {}

bool Expression::uses(std::size_t name) const {
  return std::ranges::any_of(steps_, [name](const Step& step) {
    return step.operation == Operation::kName && step.name == name;
  });
}

int Expression::operands(Operation operation) {
  switch (operation) {
    case Operation::kNumber:
    case Operation::kName:
      return 0;
    case Operation::kAdd:
    case Operation::kSubtract:
    case Operation::kMultiply:
    case Operation::kDivide:
    case Operation::kPower:
    case Operation::kMin:
    case Operation::kMax:
      return 2;
    default:
      return 1;
  }
}

// ---- in C ---------------------------------------------------------------------------------------

// How tightly its outermost operation binds decides where parentheses go.
struct Expression::Phrase {
  enum class Binding : std::uint8_t { kSum, kProduct, kSign, kValue };
  std::string text;
  Binding binding = Binding::kValue;

  [[nodiscard]] std::string within(Binding around) const {
    return binding < around ? "(" + text + ")" : text;
  }
};

Expression::Phrase Expression::phrase_of(const Step& step, const std::string& name) {
  if (step.operation == Operation::kName) return {.text = name, .binding = Phrase::Binding::kValue};
  std::string text = fmt::format("{}", step.number);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";  // no division of integers
  return {.text = text, .binding = Phrase::Binding::kValue};
}

Expression::Phrase Expression::joined(Operation operation, const Phrase& x, const Phrase& y) {
  using enum Phrase::Binding;
  switch (operation) {
    case Operation::kAdd:
      return {.text = x.within(kSum) + " + " + y.within(kProduct), .binding = kSum};
    case Operation::kSubtract:
      return {.text = x.within(kSum) + " - " + y.within(kProduct), .binding = kSum};
    case Operation::kMultiply:
      return {.text = x.within(kProduct) + " * " + y.within(kSign), .binding = kProduct};
    case Operation::kDivide:
      return {.text = x.within(kProduct) + " / " + y.within(kValue), .binding = kProduct};
    default:
      break;
  }
  const char* function = operation == Operation::kMin   ? "fmin"
                         : operation == Operation::kMax ? "fmax"
                                                        : "pow";
  return {.text = fmt::format("{}({}, {})", function, x.text, y.text), .binding = kValue};
}

Expression::Phrase Expression::applied(const Step& step, const Phrase& x) {
  using enum Phrase::Binding;
  if (step.operation == Operation::kNegate) {
    return {.text = fmt::format("-{}", x.within(kValue)), .binding = kSign};
  }
  if (step.operation == Operation::kWholePower) {
    return {.text = fmt::format("pow({}, {:.1f})", x.text, step.number), .binding = kValue};
  }
  const auto* function = std::ranges::find(ExpressionReader::kFunctions, step.operation,
                                           &ExpressionReader::Function::operation);
  const std::string name = step.operation == Operation::kAbs    ? "fabs"
                           : step.operation == Operation::kSign ? "sign_of"
                                                                : std::string(function->name);
  return {.text = fmt::format("{}({})", name, x.text), .binding = kValue};
}

std::string Expression::c_text(std::span<const std::string> names) const {
  std::vector<Phrase> stack;
  for (const Step& step : steps_) {
    const int count = operands(step.operation);
    if (count == 0) {
      const bool is_name = step.operation == Operation::kName;
      stack.push_back(phrase_of(step, is_name ? names[step.name] : std::string()));
    } else if (count == 1) {
      stack.back() = applied(step, stack.back());
    } else {
      const Phrase last = std::move(stack.back());
      stack.pop_back();
      stack.back() = joined(step.operation, stack.back(), last);
    }
  }
  return stack.front().text;
}

}  // namespace graybox
