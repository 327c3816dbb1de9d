#include "solvers/constrained/candidate_selection.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

class Selector {
 public:
  Selector(const InformationSet& set, std::string_view what) : set_(set), what_(what) {}

  // Calls use(candidate, count) for each candidate of each item.
  template <typename Use>
  void read(std::string_view text, bool with_counts, const Use& use) const {
    for (const std::string_view item : parts(text, ',')) {
      if (item.empty()) fail(text, "is empty between commas");
      auto [name, count] = with_counts ? split_count(item) : std::pair{item, 1.0};
      for (const std::size_t i : candidates(name)) use(i, count);
    }
  }

  [[noreturn]] void fail(std::string_view item, const std::string& problem) const {
    throw InputError(fmt::format("{}: '{}' {}", what_, item, problem));
  }

 private:
  static std::vector<std::string_view> parts(std::string_view text, char separator) {
    std::vector<std::string_view> out;
    for (std::size_t from = 0;;) {
      const std::size_t to = text.find(separator, from);
      out.push_back(trimmed(text.substr(from, to - from)));
      if (to == std::string_view::npos) return out;
      from = to + 1;
    }
  }

  [[nodiscard]] std::pair<std::string_view, double> split_count(std::string_view item) const {
    const std::size_t colon = item.rfind(':');
    if (colon == std::string_view::npos) return {item, 1.0};
    double count = 0.0;
    if (!parse_number(trimmed(item.substr(colon + 1)), count) || !(count > 0.0)) {
      fail(item, "needs a positive count after the colon, as in 12:2");
    }
    return {trimmed(item.substr(0, colon)), count};
  }

  [[nodiscard]] std::vector<std::size_t> candidates(std::string_view item) const {
    if (item.find_first_of("<>=") != std::string_view::npos) return by_conditions(item);
    const std::size_t dash = item.find('-');
    const std::size_t first = index(trimmed(item.substr(0, dash)), item);
    const std::size_t last =
        dash == std::string_view::npos ? first : index(trimmed(item.substr(dash + 1)), item);
    if (last < first) fail(item, "ends before it begins");
    std::vector<std::size_t> out;
    for (std::size_t i = first; i <= last; ++i) out.push_back(i);
    return out;
  }

  [[nodiscard]] std::size_t index(std::string_view word, std::string_view item) const {
    std::size_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      fail(item, "is no candidate; write an index (12), a range (40-45) or a condition (q1 > 90)");
    }
    if (value >= set_.candidate_count()) {
      fail(item, fmt::format("is beyond the last candidate, {}", set_.candidate_count() - 1));
    }
    return value;
  }

  struct Condition {
    std::size_t column = 0;
    std::string_view comparison;
    double value = 0.0;

    [[nodiscard]] bool holds(double x) const {
      if (comparison == "<") return x < value;
      if (comparison == "<=") return x <= value;
      if (comparison == ">") return x > value;
      if (comparison == ">=") return x >= value;
      return (x == value) == (comparison != "!=");
    }
  };

  [[nodiscard]] Condition condition(std::string_view text) const {
    constexpr std::array<std::string_view, 7> kComparisons{"<=", ">=", "!=", "==", "<", ">", "="};
    for (const std::string_view comparison : kComparisons) {
      const std::size_t at = text.find(comparison);
      if (at == std::string_view::npos) continue;
      const std::string_view name = trimmed(text.substr(0, at));
      const auto& names = set_.candidates().names;
      const auto found = std::ranges::find(names, name);
      if (found == names.end()) {
        fail(text, names.empty()
                       ? "needs coordinates, which the candidates of this set do not have"
                       : fmt::format("names no coordinate; there are {}", fmt::join(names, ", ")));
      }
      Condition out{.column = static_cast<std::size_t>(found - names.begin()),
                    .comparison = comparison};
      if (!parse_number(trimmed(text.substr(at + comparison.size())), out.value)) {
        fail(text, "needs a number after the comparison");
      }
      return out;
    }
    fail(text, "is no condition; write one as q1 > 90");
  }

  [[nodiscard]] std::vector<std::size_t> by_conditions(std::string_view item) const {
    std::vector<Condition> conditions;
    for (const std::string_view text : parts(item, '&')) conditions.push_back(condition(text));
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < set_.candidate_count(); ++i) {
      const auto coordinates = set_.coordinates(i);
      if (std::ranges::all_of(conditions,
                              [&](const Condition& c) { return c.holds(coordinates[c.column]); })) {
        out.push_back(i);
      }
    }
    if (out.empty()) fail(item, "holds for no candidate");
    return out;
  }

  const InformationSet& set_;
  std::string_view what_;
};

}  // namespace

std::vector<std::size_t> select_candidates(const InformationSet& set, std::string_view text,
                                           std::string_view what) {
  std::vector<std::size_t> out;
  Selector(set, what).read(text, false, [&](std::size_t i, double) { out.push_back(i); });
  std::ranges::sort(out);
  out.erase(std::ranges::unique(out).begin(), out.end());
  return out;
}

std::vector<double> select_counts(const InformationSet& set, std::string_view text,
                                  std::string_view what) {
  std::vector<double> out(set.candidate_count(), 0.0);
  Selector(set, what).read(text, true, [&](std::size_t i, double count) { out[i] += count; });
  return out;
}

}  // namespace graybox
