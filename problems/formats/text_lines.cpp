#include "graybox/problems/formats/text_lines.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "graybox/problems/error.hpp"

namespace graybox {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

LineReader::LineReader(const std::string& path) : path_(path), stream_(path, std::ios::binary) {}

bool LineReader::next(std::string_view& line) {
  while (std::getline(stream_, text_)) {
    ++number_;
    line = text_;
    if (number_ == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);  // a BOM
    line = trimmed(line);
    if (!line.empty() && line.front() != '#') return true;
  }
  if (stream_.bad()) throw InputError(fmt::format("{}: can't be read", path_));
  return false;
}

bool parse_number(std::string_view field, double& value) {
  if (field.starts_with('+')) field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range) value = HUGE_VAL;
  return (error == std::errc() || error == std::errc::result_out_of_range) &&
         end == field.data() + field.size() && !field.empty();
}

}  // namespace graybox
