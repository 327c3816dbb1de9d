#include "problems/files/text_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// Digits, one comma, digits, and perhaps an exponent.
bool has_decimal_comma(std::string_view field) {
  const auto skip_digits = [&] {
    std::size_t count = 0;
    while (count < field.size() && field[count] >= '0' && field[count] <= '9') ++count;
    field.remove_prefix(count);
    return count;
  };
  if (field.starts_with('+') || field.starts_with('-')) field.remove_prefix(1);
  const std::size_t before = skip_digits();
  if (!field.starts_with(',')) return false;
  field.remove_prefix(1);
  if (before + skip_digits() == 0) return false;
  if (field.empty()) return true;
  if (field.front() != 'e' && field.front() != 'E') return false;
  field.remove_prefix(1);
  if (field.starts_with('+') || field.starts_with('-')) field.remove_prefix(1);
  return skip_digits() > 0 && field.empty();
}

// Without the signs at its end that separate fields elsewhere, but for `separator`.
std::string_view without_end(std::string_view line, char separator) {
  while (!line.empty() && line.back() != separator &&
         std::string_view(";,\t ").find(line.back()) != std::string_view::npos) {
    line.remove_suffix(1);
  }
  return line;
}

bool is_number_with_point(std::string_view field) {
  double ignored = 0.0;
  return field.find('.') != std::string_view::npos && parse_number(field, ignored);
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

LineReader::LineReader(const std::string& path)
    : path_(path), stream_(std::make_unique<std::ifstream>(path, std::ios::binary)) {}

LineReader::LineReader(const std::string& path, std::string text)
    : path_(path), stream_(std::make_unique<std::istringstream>(std::move(text))) {}

bool LineReader::next(std::string_view& line) {
  while (std::getline(*stream_, text_)) {
    ++number_;
    line = text_;
    if (number_ == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);  // a BOM
    line = trimmed(line);
    if (line.empty()) continue;
    if (line.front() != '#') return true;
    comment_before_ = std::exchange(comment_, std::string(line));
  }
  if (stream_->bad()) throw InputError(fmt::format("{}: can't be read", path_));
  return false;
}

FieldSplitter::FieldSplitter(std::string_view first_line) {
  first_line = without_end(first_line, '\0');
  for (const char separator : {';', ',', '\t'}) {
    if (first_line.find(separator) == std::string_view::npos) continue;
    separator_ = separator;
    return;
  }
}

const std::vector<std::string_view>& FieldSplitter::split(std::string_view line) & {
  fields_.clear();
  line = without_end(line, separator_);
  const std::string_view whole = line;
  while (true) {
    const std::size_t end = separator_ == ' ' ? line.find_first_of(" \t") : line.find(separator_);
    std::string_view field = trimmed(line.substr(0, end));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
      field = trimmed(field.substr(1, field.size() - 2));
    }
    fields_.push_back(field);
    if (end == std::string_view::npos) break;
    line.remove_prefix(end + 1);
    if (separator_ == ' ') line = trimmed(line);  // a run of blanks separates once
  }
  if (separator_ == ';' || separator_ == '\t') take_decimal_commas(whole);
  return fields_;
}

void FieldSplitter::take_decimal_commas(std::string_view line) {
  if (!has_points_) has_points_ = std::ranges::any_of(fields_, is_number_with_point);
  if (has_points_ || line.find(',') == std::string_view::npos) return;
  with_points_.assign(line.begin(), line.end());
  for (std::string_view& field : fields_) {
    if (!has_decimal_comma(field)) continue;
    char* const begin = with_points_.data() + (field.data() - line.data());
    std::replace(begin, begin + field.size(), ',', '.');
    field = {begin, field.size()};
  }
}

bool is_header(const std::vector<std::string_view>& fields) {
  double ignored = 0.0;
  return std::ranges::none_of(fields,
                              [&](std::string_view field) { return parse_number(field, ignored); });
}

double number_in_table(const std::string& path, std::size_t line, const std::string& column,
                       std::string_view field) {
  double value = 0.0;
  if (parse_number(field, value)) return value;
  constexpr std::size_t kShown = 40;
  const bool decimal_comma = field.find(',') != std::string_view::npos;
  throw InputError(fmt::format("{}: line {}, column {}: '{}{}' is no number{}", path, line, column,
                               field.substr(0, kShown), field.size() > kShown ? "..." : "",
                               decimal_comma ? "; write a decimal point" : ""));
}

bool parse_number(std::string_view field, double& value) {
  if (field.starts_with('+')) field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range) value = HUGE_VAL;
  return (error == std::errc() || error == std::errc::result_out_of_range) &&
         end == field.data() + field.size() && !field.empty();
}

}  // namespace graybox
