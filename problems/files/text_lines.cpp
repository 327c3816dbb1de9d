#include "problems/files/text_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
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

// The place behind the quotes in which the text begins; 0 where it begins with none, or they are
// not closed.
std::size_t end_of_quotes(std::string_view text) {
  if (!text.starts_with('"')) return 0;
  const std::size_t end = text.find('"', 1);
  return end == std::string_view::npos ? 0 : end + 1;
}

// The line without what stands in quotes.
std::string without_quoted(std::string_view line) {
  std::string rest;
  while (!line.empty()) {
    const std::size_t quoted = end_of_quotes(line);
    if (quoted == 0) rest += line.front();
    line.remove_prefix(std::max<std::size_t>(quoted, 1));
  }
  return rest;
}

// Where the first field ends, at a sign that separates; npos where the line does.
std::size_t end_of_field(std::string_view line, const char& separator) {
  const std::string_view separators = separator == ' ' ? " \t" : std::string_view(&separator, 1);
  const auto separates = [&](char c) { return separators.find(c) != std::string_view::npos; };
  const auto first_filled = [&](std::size_t from) {
    while (from < line.size() && is_blank(line[from]) && !separates(line[from])) ++from;
    return from;
  };
  const std::size_t begin = first_filled(0);
  const std::size_t quoted = end_of_quotes(line.substr(begin));
  // Quotes within a field are none around it.
  const std::size_t behind = quoted == 0 ? 0 : first_filled(begin + quoted);
  if (quoted > 0 && behind == line.size()) return std::string_view::npos;
  if (quoted > 0 && separates(line[behind])) return behind;
  return line.find_first_of(separators);
}

bool is_number_with_point(std::string_view field) {
  double ignored = 0.0;
  return field.find('.') != std::string_view::npos && parse_number(field, ignored);
}

constexpr std::uint32_t kReplacement = 0xFFFD;

void add_letter(std::uint32_t letter, std::string& text) {
  const auto add = [&](std::uint32_t byte) { text += static_cast<char>(byte); };
  if (letter < 0x80) return add(letter);
  if (letter < 0x800) {
    add(0xC0U | letter >> 6U);
  } else if (letter < 0x10000) {
    add(0xE0U | letter >> 12U);
    add(0x80U | (letter >> 6U & 0x3FU));
  } else {
    add(0xF0U | letter >> 18U);
    add(0x80U | (letter >> 12U & 0x3FU));
    add(0x80U | (letter >> 6U & 0x3FU));
  }
  add(0x80U | (letter & 0x3FU));
}

// The text of a file in UTF-16 that begins with its mark, as Excel's "Unicode text" does; none of
// another file.
std::optional<std::string> text_of_utf16(std::istream& file) {
  const int begin = file.peek();  // of what no other text begins with
  if (begin != 0xFF && begin != 0xFE) return {};
  std::string mark(2, '\0');
  file.read(mark.data(), 2);
  const bool is_little = mark == "\xFF\xFE", is_big = mark == "\xFE\xFF";
  if (!is_little && !is_big) return {};
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto unit = [&](std::size_t at) {
    const auto first = static_cast<unsigned char>(bytes[at]),
               second = static_cast<unsigned char>(bytes[at + 1]);
    return static_cast<std::uint32_t>(is_little ? first | second << 8U : first << 8U | second);
  };
  std::string text;
  text.reserve(bytes.size() / 2);
  for (std::size_t at = 0; at + 1 < bytes.size(); at += 2) {
    std::uint32_t letter = unit(at);
    if (letter >> 11U == 0x1BU) {  // a half of a letter in two
      const std::uint32_t low = at + 3 < bytes.size() ? unit(at + 2) : 0;
      const bool is_pair = letter >> 10U == 0x36U && low >> 10U == 0x37U;
      letter = is_pair ? 0x10000U + ((letter & 0x3FFU) << 10U) + (low & 0x3FFU) : kReplacement;
      if (is_pair) at += 2;
    }
    add_letter(letter, text);
  }
  return text;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

LineReader::LineReader(const std::string& path)
    : path_(path), stream_(std::make_unique<std::ifstream>(path, std::ios::binary)) {
  if (std::optional<std::string> text = text_of_utf16(*stream_)) {
    stream_ = std::make_unique<std::istringstream>(*std::move(text));
  }
}

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
  const std::string unquoted = without_quoted(without_end(first_line, '\0'));
  for (const char separator : {';', ',', '\t'}) {
    if (unquoted.find(separator) == std::string::npos) continue;
    separator_ = separator;
    return;
  }
}

const std::vector<std::string_view>& FieldSplitter::split(std::string_view line) & {
  fields_.clear();
  line = without_end(line, separator_);
  const std::string_view whole = line;
  while (true) {
    const std::size_t end = end_of_field(line, separator_);
    std::string_view field = trimmed(line.substr(0, end));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
      field = trimmed(field.substr(1, field.size() - 2));
    }
    fields_.push_back(field);
    if (end == std::string_view::npos) break;
    line.remove_prefix(end + 1);
    if (separator_ == ' ') line = trimmed(line);  // a run of blanks separates once
  }
  const bool has_quotes = separator_ == ',' && whole.starts_with('"');
  if (separator_ == ';' || separator_ == '\t' || has_quotes) take_decimal_commas(whole);
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
  const bool is_list = field.find_first_of("[({") == 0,
             decimal_comma = !is_list && field.find(',') != std::string_view::npos;
  throw InputError(fmt::format("{}: line {}, column {}: '{}{}' is no number{}", path, line, column,
                               field.substr(0, kShown), field.size() > kShown ? "..." : "",
                               is_list ? " but a list in one cell; give each of its values a "
                                         "column of its own, as q_1, q_2"
                               : decimal_comma ? "; write a decimal point"
                                               : ""));
}

bool parse_number(std::string_view field, double& value) {
  if (field.starts_with('+')) field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range) value = HUGE_VAL;
  return (error == std::errc() || error == std::errc::result_out_of_range) &&
         end == field.data() + field.size() && !field.empty();
}

}  // namespace graybox
