#include "solvers/planning/precision_target.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {
namespace {

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::optional<double> number_of(std::string_view text) {
  const std::string_view inner = trimmed(text);
  double value = 0.0;
  const auto [end, error] = std::from_chars(inner.data(), inner.data() + inner.size(), value);
  if (error != std::errc() || end != inner.data() + inner.size()) return std::nullopt;
  return value;
}

// A positive amount, "0.02" or "2 %".
double amount_of(std::string_view text, std::string_view what) {
  std::string_view inner = trimmed(text);
  const bool is_percent = inner.ends_with('%');
  if (is_percent) inner.remove_suffix(1);
  const std::optional<double> value = number_of(inner);
  if (!value.has_value() || !(*value > 0.0) || !std::isfinite(*value)) {
    throw InputError(fmt::format("{}: '{}' is no positive number", what, trimmed(text)));
  }
  return is_percent ? *value / 100.0 : *value;
}

std::string parameter_name(const InformationSet& set, std::size_t k) {
  return set.parameters().empty() ? fmt::format("{}", k) : set.parameters()[k];
}

std::vector<double> unit_vector(std::size_t dimension, std::size_t k) {
  std::vector<double> c(dimension, 0.0);
  c[k] = 1.0;
  return c;
}

// "sd(inner) <= limit" in two parts.
struct TargetText {
  std::string_view inner, limit;
};

TargetText split_target(std::string_view text) {
  const std::string_view whole = trimmed(text);
  const std::size_t sign = whole.rfind("<=");
  const std::string_view left = trimmed(whole.substr(0, sign));
  if (sign == std::string_view::npos || !left.starts_with("sd(") || !left.ends_with(')')) {
    throw InputError(fmt::format("target '{}': write it as 'sd(parameter) <= 0.02'", whole));
  }
  return {.inner = trimmed(left.substr(3, left.size() - 4)), .limit = whole.substr(sign + 2)};
}

// "2*k1" or "k1": adds to c.
void add_term(const InformationSet& set, std::string_view term, double sign, std::string_view what,
              std::vector<double>& c) {
  const std::size_t star = term.find('*');
  std::string_view name = term;
  double factor = sign;
  if (star != std::string_view::npos) {
    const std::optional<double> value = number_of(term.substr(0, star));
    if (!value.has_value() || !std::isfinite(*value)) {
      throw InputError(
          fmt::format("{}: '{}' is no number before *", what, trimmed(term.substr(0, star))));
    }
    factor *= *value;
    name = term.substr(star + 1);
  }
  const std::vector<std::string> names{std::string(trimmed(name))};
  if (names.front().empty()) throw InputError(fmt::format("{}: a parameter is missing", what));
  c[parameter_indices(set, names).front()] += factor;
}

// Where the next '+' or '-' between terms stands. Names may hold a '-' that no space surrounds.
std::size_t next_sign(std::string_view text, std::size_t from) {
  for (std::size_t k = from; k < text.size(); ++k) {
    const bool is_sign = text[k] == '+' || text[k] == '-';
    if (is_sign && k > 0 && text[k - 1] == ' ' && k + 1 < text.size() && text[k + 1] == ' ') {
      return k;
    }
  }
  return std::string_view::npos;
}

}  // namespace

std::vector<double> parse_combination(const InformationSet& set, std::string_view text,
                                      std::string_view what) {
  std::vector<double> c(set.dimension(), 0.0);
  std::string_view rest = trimmed(text);
  double sign = 1.0;
  if (rest.starts_with('-') &&
      set.parameters().end() == std::ranges::find(set.parameters(), std::string(rest))) {
    sign = -1.0;
    rest.remove_prefix(1);
  }
  while (true) {
    const std::size_t end = next_sign(rest, 0);
    add_term(set, rest.substr(0, end), sign, what, c);
    if (end == std::string_view::npos) break;
    sign = rest[end] == '-' ? -1.0 : 1.0;
    rest.remove_prefix(end + 1);
  }
  if (std::ranges::all_of(c, [](double x) { return x == 0.0; })) {
    throw InputError(fmt::format("{}: nothing is left of the combination", what));
  }
  return c;
}

std::vector<PrecisionTarget> parse_precision_targets(const InformationSet& set,
                                                     std::string_view text) {
  const std::string what = fmt::format("target '{}'", trimmed(text));
  const auto [inner, limit_text] = split_target(text);
  const double limit = amount_of(limit_text, what);
  if (inner != "all") {
    return {{.text = std::string(inner),
             .combination = parse_combination(set, inner, what),
             .standard_error = limit,
             .effect = 0.0}};
  }
  std::vector<PrecisionTarget> targets;
  for (std::size_t k = 0; k < set.dimension(); ++k) {
    targets.push_back({.text = parameter_name(set, k),
                       .combination = unit_vector(set.dimension(), k),
                       .standard_error = limit,
                       .effect = 0.0});
  }
  return targets;
}

std::vector<PrecisionTarget> parse_detections(const InformationSet& set, std::string_view text,
                                              double power, double level) {
  const std::string_view whole = trimmed(text);
  const std::string what = fmt::format("detect '{}'", whole);
  const std::size_t by = whole.rfind(" by ");
  if (by == std::string_view::npos) {
    throw InputError(fmt::format("{}: write it as 'parameter by 0.05'", what));
  }
  const double effect = amount_of(whole.substr(by + 4), what);
  const std::string_view inner = trimmed(whole.substr(0, by));
  const double limit = effect / effect_for_power(power, level);
  std::vector<PrecisionTarget> targets;
  if (inner == "all") {
    targets = parse_precision_targets(set, "sd(all) <= 1");
    for (PrecisionTarget& target : targets) target.standard_error = limit;
  } else {
    targets.push_back({.text = std::string(inner),
                       .combination = parse_combination(set, inner, what),
                       .standard_error = limit,
                       .effect = 0.0});
  }
  for (PrecisionTarget& target : targets) target.effect = effect;
  return targets;
}

double detection_power(double effect_over_error, double level) {
  const double z = normal_quantile(1.0 - 0.5 * level);
  return normal_tail(z - effect_over_error) + normal_tail(z + effect_over_error);
}

double effect_for_power(double power, double level) {
  if (!(level > 0.0 && level < 1.0)) {
    throw InputError("level: the test's level lies between 0 and 1, as 0.05");
  }
  if (!(power > level && power < 1.0)) {
    throw InputError(fmt::format("power: it lies between the level, {}, and 1", level));
  }
  double low = 0.0, high = 1.0;
  while (detection_power(high, level) < power) high *= 2.0;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    (detection_power(middle, level) < power ? low : high) = middle;
  }
  return high;
}

std::vector<double> variances(std::span<const PrecisionTarget> targets,
                              std::span<const double> packed, std::size_t dimension) {
  std::vector<double> result(targets.size(), std::numeric_limits<double>::infinity());
  InverseCholesky inverse(dimension);
  if (!inverse.factor(packed)) return result;
  const std::span<const double> x = inverse.inverse_factor();
  for (std::size_t j = 0; j < targets.size(); ++j) {
    result[j] = 0.0;
    for (std::size_t row = 0; row < dimension; ++row) {  // X c
      double entry = 0.0;
      for (std::size_t k = 0; k <= row; ++k) {
        entry += x[packed_index(row, k)] * targets[j].combination[k];
      }
      result[j] += entry * entry;
    }
  }
  return result;
}

}  // namespace graybox
