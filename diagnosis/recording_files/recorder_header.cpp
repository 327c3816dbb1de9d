#include "diagnosis/recording_files/recorder_header.hpp"

#include <algorithm>
#include <cctype>
#include <cstddef>

#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox::formats {
namespace {

bool is_number(std::string_view field) {
  double ignored = 0.0;
  return parse_number(field, ignored);
}

bool is_whole_number(std::string_view field) {
  return !field.empty() &&
         std::ranges::all_of(field, [](unsigned char c) { return std::isdigit(c) != 0; });
}

// "CH1:V" without its channel.
std::string_view without_channel(std::string_view field) {
  const std::size_t colon = field.find(':');
  return colon == std::string_view::npos ? field : trimmed(field.substr(colon + 1));
}

}  // namespace

bool is_unit(std::string_view field) { return field != "1" && !unit_as_written(field).empty(); }

std::vector<std::string> units_in(const std::vector<std::string_view>& fields) {
  std::vector<std::string> units;
  bool any = false;
  for (std::string_view field : fields) {
    field = trimmed(field);
    const bool has_brackets = field.size() > 2 && (field.front() == '[' || field.front() == '(');
    if (has_brackets) field = trimmed(field.substr(1, field.size() - 2));
    if (field != "1" && is_number(field)) return {};
    any = any || is_unit(field);
    const bool is_none = std::ranges::none_of(field, [](unsigned char c) {  // "-", "#", "1"
      return std::isalpha(c) != 0 || c == '%' || c > 127;
    });
    units.emplace_back(is_none ? std::string_view{} : field);
  }
  return any ? units : std::vector<std::string>{};
}

bool are_units_alone(std::string_view line) {
  FieldSplitter splitter(line);
  const std::vector<std::string> units = units_in(splitter.split(line));
  std::size_t filled = 0;
  for (const std::string& unit : units) {
    if (unit.empty()) continue;
    if (!is_unit(unit)) return false;
    ++filled;
  }
  return filled > 1;
}

bool names_numbered_channels(std::string_view line, std::string_view below) {
  FieldSplitter splitter(line), of_units(below);
  const std::vector<std::string_view>& names = splitter.split(line);
  if (names.size() < 2 || is_number(names.front()) || names.front().empty()) return false;
  const bool has_numbers = std::all_of(names.begin() + 1, names.end(), is_whole_number);
  return has_numbers && of_units.split(below).size() == names.size() && are_units_alone(below);
}

std::size_t fields_beside(std::string_view header, std::string_view numbers) {
  FieldSplitter own(numbers), of_header(header);
  const std::size_t alone = own.split(numbers).size();
  return std::max(alone, of_header.split(numbers).size());
}

std::optional<CountedTime> counted_time(const std::vector<std::string_view>& names,
                                        std::string_view below) {
  const auto start = std::ranges::find_if(
      names, [](std::string_view name) { return joined_words(words_of(name)) == "start"; });
  if (names.size() < 4 || start == names.end() || start - names.begin() < 2) return {};
  if (start + 1 == names.end() || joined_words(words_of(*(start + 1))) != "increment") return {};
  FieldSplitter splitter(below);
  const std::vector<std::string_view>& fields = splitter.split(below);
  CountedTime time{0.0, 0.0, static_cast<std::size_t>(start - names.begin())};
  if (fields.size() < time.channels + 2 || is_number(fields.front())) return {};
  const bool are_numbers = parse_number(fields[time.channels], time.start) &&
                           parse_number(fields[time.channels + 1], time.step);
  return are_numbers && time.step > 0.0 ? std::optional(time) : std::nullopt;
}

void take_counted_time(const CountedTime& time, RecordingFile& file) {
  RecordedColumn& rows = file.columns.front();
  for (Eigen::Index k = 0; k < rows.values.size(); ++k) {
    if (rows.values(k) != rows.values(0) + static_cast<double>(k)) return;
  }
  rows.values = (time.start + time.step * rows.values.array()).matrix();
  rows.name = "Time";
  rows.unit = "s";
  rows.origin = "the rows' numbers, with the start and the increment in the header";
}

void take_stated_units(std::string_view line, RecordingFile& file) {
  FieldSplitter splitter(line);
  const std::vector<std::string_view>& fields = splitter.split(line);
  const std::string label = joined_words(words_of(fields.front()));
  const bool is_of_time = label == "horizontal units";
  if ((!is_of_time && label != "vertical units") || fields.size() < 2) return;
  if (is_of_time) {
    if (is_unit(fields[1]) && file.columns.front().unit.empty()) {
      file.columns.front().unit = std::string(fields[1]);
    }
    return;
  }
  for (std::size_t k = 1; k < std::min(fields.size(), file.columns.size()); ++k) {
    const std::string_view unit = without_channel(fields[k]);
    if (is_unit(unit) && file.columns[k].unit.empty()) file.columns[k].unit = std::string(unit);
  }
}

std::vector<std::string_view> sample_beside_setting(const std::vector<std::string_view>& fields) {
  constexpr std::size_t kTime = 3, kValue = 4;
  const bool fits = fields.size() > kValue && fields[2].empty() && is_number(fields[kTime]) &&
                    is_number(fields[kValue]) &&
                    std::all_of(fields.begin() + kValue + 1, fields.end(),
                                [](std::string_view field) { return field.empty(); });
  return fits ? std::vector<std::string_view>{fields[kTime], fields[kValue]}
              : std::vector<std::string_view>{};
}

bool begins_with_setting(std::string_view line) {
  FieldSplitter splitter(line);
  const std::vector<std::string_view>& fields = splitter.split(line);
  return joined_words(words_of(fields.front())) == "record length" &&
         !sample_beside_setting(fields).empty();
}

}  // namespace graybox::formats
