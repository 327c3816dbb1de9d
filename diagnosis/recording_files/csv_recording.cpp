#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/recorder_header.hpp"
#include "diagnosis/recording_files/recording_formats.hpp"
#include "diagnosis/recording_files/time_stamp.hpp"
#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "problems/base/error.hpp"
#include "problems/base/shortened.hpp"
#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox::formats {
namespace {

constexpr std::size_t kShownOfField = 40;
constexpr std::string_view kComment = "Comment";  // LabVIEW's last column, mostly empty
constexpr std::size_t kLongestTitle = 400;  // what is longer is text, and would fill every message

// "speed [rpm]" or "speed (rpm)" is the column speed in rpm.
RecordedColumn titled(std::string_view title) {
  for (const auto& [open, close] : {std::pair{'[', ']'}, std::pair{'(', ')'}}) {
    const std::size_t begin = title.rfind(open);
    if (begin == std::string_view::npos || begin == 0 || !title.ends_with(close)) continue;
    const std::string_view unit = trimmed(title.substr(begin + 1, title.size() - begin - 2));
    if (find_unit(unit) != nullptr) {
      return {std::string(trimmed(title.substr(0, begin))), std::string(unit), {}};
    }
  }
  return {std::string(title), {}, {}};
}

// Names of columns; those that are empty are left so. `above` says what stands around the header.
std::vector<RecordedColumn> header_columns(const std::string& path,
                                           const std::vector<std::string_view>& fields,
                                           const std::string& above) {
  std::vector<RecordedColumn> columns;
  for (const std::string_view field : fields) {
    columns.push_back(titled(field));
    for (std::size_t k = 0; k + 1 < columns.size(); ++k) {
      if (!columns[k].name.empty() && columns[k].name == columns.back().name) {
        throw InputError(fmt::format("{}: header: two columns are called '{}'{}", path,
                                     shortened(columns.back().name), above));
      }
    }
  }
  return columns;
}

// The fields of a comment, without its sign; empty where they are not `count` different words.
std::vector<std::string_view> titles_in_comment(std::string_view comment, std::string_view first,
                                                std::size_t count) {
  comment = trimmed(comment.substr(std::min(comment.find_first_not_of("#% \t"), comment.size())));
  for (const std::string_view separated : {first, comment}) {
    FieldSplitter splitter(separated);  // may hold what the titles are parts of
    const std::vector<std::string_view> titles = splitter.split(comment);
    if (titles.size() == count && is_header(titles)) return titles;
  }
  return {};
}

constexpr std::string_view kPairTime = "Time";

// A header of National Instruments names a channel in two columns, its time and its values:
// "Channel name,Force,Channel name,Torque". Names of the columns then, "Time,Force,Time 2,Torque";
// none for another header.
std::vector<std::string_view> channel_names(const std::vector<std::string_view>& fields) {
  static constexpr std::array<std::string_view, 8> kTimes{"Time",   "Time 2", "Time 3", "Time 4",
                                                          "Time 5", "Time 6", "Time 7", "Time 8"};
  const std::size_t pairs = fields.size() / 2;
  if (fields.size() % 2 != 0 || pairs == 0 || pairs > kTimes.size()) return {};
  std::vector<std::string_view> names = fields;
  for (std::size_t k = 0; k < pairs; ++k) {
    const std::string_view label = fields[2 * k];
    if (label != "Channel name" && label != "Channel Name" && label != "Channel") return {};
    names[2 * k] = kTimes[k];
  }
  return names;
}

// Each channel's own time, where it is that of the first.
void leave_out_equal_times(RecordingFile& file) {
  if (file.columns.front().name != kPairTime) return;
  const Eigen::VectorXd first = file.columns.front().values;
  std::erase_if(file.columns, [&](const RecordedColumn& column) {
    return column.name.starts_with("Time ") && column.name.size() == kPairTime.size() + 2 &&
           column.values == first;
  });
}

// Whether a line below the titles holds more titles than units: names of signals below those of a
// recorder's channels. One of them is of several words.
bool are_more_titles(const std::vector<std::string>& fields) {
  std::ptrdiff_t filled = 0, known = 0;
  bool has_words = false;
  for (const std::string& field : fields) {
    if (field.empty()) continue;
    ++filled;
    if (is_unit(field)) {
      ++known;
    } else {
      has_words = has_words || field.find(' ') != std::string::npos;
    }
  }
  return has_words && 2 * known < filled;
}

// Two lines of titles as one: a field that is a unit is that; words follow the title above.
void add_titles(const std::vector<std::string>& fields, RecordingFile& file) {
  for (std::size_t k = 0; k < fields.size(); ++k) {
    RecordedColumn& column = file.columns[k];
    if (is_unit(fields[k])) {
      if (column.unit.empty()) column.unit = fields[k];
    } else if (!fields[k].empty() && fields[k] != column.name) {
      column.name += " " + fields[k];
    }
  }
}

// Names in the comments above the numbers, "# t u v" or "% t, u", with the units that stand in a
// comment above or below them; none where they don't fit.
std::vector<RecordedColumn> columns_in_comments(std::string_view last, std::string_view before,
                                                std::string_view first, std::size_t count) {
  std::vector<std::string_view> titles = titles_in_comment(last, first, count);
  const std::vector<std::string_view> others = titles_in_comment(before, first, count);
  std::vector<std::string> units;
  if (!titles.empty() && !others.empty()) {
    units = units_in(titles);
    if (!units.empty() && !are_more_titles(units)) {
      titles = others;
    } else if (units = units_in(others); are_more_titles(units)) {
      units.clear();
    }
  }
  std::vector<RecordedColumn> columns;
  std::set<std::string> names;
  for (std::size_t k = 0; k < titles.size(); ++k) {
    columns.push_back(titled(titles[k]));
    columns.back().number = std::to_string(columns.size());
    if (k < units.size() && columns.back().unit.empty()) columns.back().unit = units[k];
    if (!columns.back().name.empty()) names.insert(columns.back().name);
  }
  return names.size() == count ? columns : std::vector<RecordedColumn>{};
}

// The lines that hold a word.
struct WordLines {
  std::string word;
  std::size_t first = 0, last = 0;
};

constexpr std::size_t kMostNames = 8;  // of machines in one column

// What a column has held so far: numbers or time stamps.
struct ColumnContent {
  StampColumn stamps;
  bool has_numbers = false;
  std::size_t numbers = 0, words = 0;  // fields
  std::size_t line = 0;                // of the first word
  std::string word;
  std::vector<WordLines> different;  // words, one more than kMostNames at most
  // Numbers that are each followed by a blank and a unit: of the first, and how many have it.
  std::string unit;
  std::size_t with_unit = 0;
};

// What programs write in place of a number: R, Python, Excel, and C on Windows.
bool says_missing(std::string_view field) {
  for (const std::string_view word :
       {"NA", "N/A", "n/a", "null", "NULL", "None", "none", "-", "--", "---", "#VALUE!", "#DIV/0!",
        "#N/A", "#NUM!", "#REF!", "#NAME?", "#NULL!"}) {
    if (field == word) return true;
  }
  if (field.starts_with('-')) field.remove_prefix(1);
  return field.starts_with("1.#");  // "1.#QNAN"
}

void note_word(std::string_view word, std::size_t line, ColumnContent& content) {
  if (content.words++ == 0) {
    content.line = line;
    content.word = word;
  }
  const auto known = std::ranges::find(content.different, word, &WordLines::word);
  if (known != content.different.end()) {
    known->last = line;
  } else if (content.different.size() <= kMostNames) {
    content.different.push_back({std::string(word), line, line});
  }
}

// "54.73 Hz", where the fields before it have the same unit, or none is before it.
bool take_number_with_unit(std::string_view field, std::size_t line, double& number,
                           ColumnContent& content) {
  const std::size_t blank = field.find(' ');
  if (blank == std::string_view::npos || !parse_number(field.substr(0, blank), number)) {
    return false;
  }
  const std::string_view unit = trimmed(field.substr(blank));
  const bool is_first = content.with_unit == 0 && content.numbers + content.words == 0;
  if (is_first && (unit == "Hz" || !unit_as_written(unit).empty())) {
    content.unit = unit;
    content.line = line;
    content.word = field;
  }
  if (content.unit.empty() || unit != content.unit) return false;
  ++content.with_unit;
  return true;
}

// A field that is empty or says so is a sample that is not there.
double sample_in(const std::string& path, std::size_t line, const std::string& column,
                 std::string_view field, ColumnContent& content) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (field.empty() || says_missing(field)) return kNone;
  double number = kNone;
  StampColumn& stamps = content.stamps;
  if (parse_number(field, number) && (!stamps.has_any() || std::isnan(number))) {
    content.has_numbers = content.has_numbers || !std::isnan(number);
    ++content.numbers;
    return number;
  }
  if (!content.has_numbers && stamps.take(field, number)) return number;
  // What stands in a column without a name is a note.
  if (column.empty()) return kNone;
  if (stamps.has_any()) {
    throw InputError(
        fmt::format("{}: line {}, column '{}': '{}' is no time stamp like the first, {}", path,
                    line, column, shortened(std::string(field), kShownOfField), stamps.first()));
  }
  if (take_number_with_unit(field, line, number, content)) return number;
  note_word(field, line, content);
  return kNone;
}

// "M1", "M2", or left and right: no states, as ON and OFF are.
bool are_numbered_names(const std::vector<WordLines>& words) {
  static constexpr std::string_view kDigits = "0123456789";
  const auto stem = [](const WordLines& each) {
    return each.word.substr(0, each.word.find_last_not_of(kDigits) + 1);
  };
  const bool are_numbered = std::ranges::all_of(words, [&](const WordLines& each) {
    return stem(each) == stem(words.front()) && stem(each) != each.word;
  });
  return are_numbered || std::ranges::all_of(words, [](const WordLines& each) {
           const std::vector<std::string> side = words_of(each.word);
           return side.size() == 1 && (side[0] == "left" || side[0] == "right");
         });
}

// Of a column that is left out and that names machines: rows of several are one recording then, and
// the user must know. Empty for any other column.
std::string words_of_machines(const std::string& column, const ColumnContent& content) {
  static constexpr auto kMachines = std::to_array<std::string_view>(
      {"motor", "axis", "joint", "wheel", "drive", "actuator", "servo", "machine", "device", "side",
       "achse", "antrieb", "gelenk"});
  const auto is_machine = [](const std::string& word) {
    return std::ranges::find(kMachines, word) != kMachines.end();
  };
  const std::vector<std::string> title = words_of(column);
  const bool names_machines = std::ranges::any_of(title, is_machine) &&
                              std::ranges::all_of(title, [&](const std::string& word) {
                                return is_machine(word) || word == "id" || word == "name";
                              });
  const std::size_t count = content.different.size();
  if (!names_machines || count < 2 || count > kMostNames) return "";
  if (!are_numbered_names(content.different)) return "";
  std::string lines;
  for (const WordLines& each : content.different) {
    lines += fmt::format("{}'{}' in lines {} to {}", lines.empty() ? "" : ", ",
                         shortened(each.word, kShownOfField), each.first, each.last);
  }
  return fmt::format(
      "; it names {} machines, {}: all rows are taken as one machine's. Put the lines of one of "
      "them into a file by itself, below the titles, and give that",
      count, lines);
}

// Columns with one unit in all of their fields have that. Where others stand between them, or the
// title has another unit, such fields are words.
void take_units_of_fields(std::vector<ColumnContent>& contents, RecordingFile& file) {
  for (std::size_t k = 0; k < file.columns.size(); ++k) {
    ColumnContent& content = contents[k];
    std::string& stated = file.columns[k].unit;
    if (content.with_unit == 0) continue;
    const bool is_one = content.numbers + content.words == 0 &&
                        (stated.empty() || is_same_unit(stated, content.unit));
    if (is_one) {
      if (stated.empty()) stated = content.unit;
      content.numbers = content.with_unit;
      content.has_numbers = true;
    } else {
      content.words += content.with_unit;
    }
  }
}

// Columns of words, as the states of a drive, or of numbers to another base: left out. A word among
// numbers is a damaged sample.
void leave_out_words(std::vector<ColumnContent>& contents, RecordingFile& file) {
  // A file of words alone is none of samples.
  const bool has_samples = std::ranges::any_of(contents, [](const ColumnContent& content) {
    return content.words <= content.numbers && (content.has_numbers || content.stamps.has_any());
  });
  for (std::size_t k = 0; k < file.columns.size();) {
    const ColumnContent& content = contents[k];
    const std::string column = fmt::format("'{}'", file.columns[k].name);
    if (content.words == 0) {
      ++k;
      continue;
    }
    const bool has_comma = content.word.find(',') != std::string::npos;  // a decimal one
    if (content.words <= content.numbers || has_comma || !has_samples) {
      (void)number_in_table(file.path, content.line, column, content.word);  // throws
    }
    file.remarks.push_back(fmt::format(
        "{}: column {} holds words as '{}', no numbers, so it is left out{}", file.path, column,
        shortened(content.word, kShownOfField), words_of_machines(file.columns[k].name, content)));
    file.left_out.push_back(file.columns[k].name);
    contents.erase(contents.begin() + static_cast<std::ptrdiff_t>(k));
    file.columns.erase(file.columns.begin() + static_cast<std::ptrdiff_t>(k));
  }
}

// Numbers and time stamps, with one number at least: a day alone may be a title's.
bool is_line_of_numbers(const std::vector<std::string_view>& fields) {
  double number = 0.0;
  bool any = false;
  for (const std::string_view field : fields) {
    const bool is_number = parse_number(field, number);
    any = any || is_number;
    if (!is_number && !field.empty() && !parse_time_stamp(field)) return false;
  }
  return any;
}

bool is_without_fields(const std::vector<std::string_view>& fields) {
  return std::ranges::all_of(fields, [](std::string_view field) { return field.empty(); });
}

// Whether a line has so many titles.
bool are_titles(std::string_view line, std::size_t count) {
  FieldSplitter splitter(line);
  const std::vector<std::string_view>& fields = splitter.split(line);
  return fields.size() == count && is_header(fields) && !are_units_alone(line);
}

struct NumberedLine {
  std::string text;
  std::size_t number = 0;
};

// The lines of a table from its first on: those that were looked at in search of the header, then
// the rest of the file.
class TableLines {
 public:
  explicit TableLines(LineReader lines) : lines_(std::move(lines)) { look_ahead(); }

  [[nodiscard]] const std::vector<NumberedLine>& head() const { return head_; }
  [[nodiscard]] bool ends_in_numbers() const { return ends_in_numbers_; }
  [[nodiscard]] const std::string& comment() const { return comment_; }
  [[nodiscard]] const std::string& comment_before() const { return comment_before_; }
  [[nodiscard]] std::size_t number() const { return number_; }
  void begin_at(std::size_t place) { next_ = place; }
  // The next line above the numbers; empty behind them.
  [[nodiscard]] std::string_view peek() const {
    return next_ < head_.size() ? std::string_view(head_[next_].text) : std::string_view();
  }

  // The line is valid until the next call.
  bool next(std::string_view& line) {
    if (next_ < head_.size()) {
      number_ = head_[next_].number;
      line = head_[next_++].text;
      return true;
    }
    const bool more = lines_.next(line);
    number_ = lines_.number();
    return more;
  }

 private:
  // Up to the first line of numbers alone.
  void look_ahead() {
    constexpr std::size_t kMostLines = 200;
    std::string_view line;
    while (head_.size() < kMostLines && !ends_in_numbers_ && lines_.next(line)) {
      if (line.front() == '%') {
        comment_before_ = std::exchange(comment_, in_utf8(line));
        continue;
      }
      FieldSplitter splitter(line);
      ends_in_numbers_ = is_line_of_numbers(splitter.split(line));
      head_.push_back({in_utf8(line), lines_.number()});
    }
    if (!comment_.empty()) return;
    comment_ = in_utf8(lines_.comment());
    comment_before_ = in_utf8(lines_.comment_before());
  }

  LineReader lines_;
  std::vector<NumberedLine> head_;  // the last is of numbers where there is one
  bool ends_in_numbers_ = false;
  std::string comment_, comment_before_;
  std::size_t next_ = 0, number_ = 0;
};

// Where the header is among the lines above the numbers. It is the first line, unless that is a
// title or a remark: then it is the last line that has as many fields as the numbers and no number,
// or the one above where that is a line of units, or of names above their units.
std::size_t place_of_header(const TableLines& lines) {
  const std::vector<NumberedLine>& head = lines.head();
  if (!lines.ends_in_numbers() || head.size() < 3) return 0;
  std::size_t last = head.size() - 2;
  for (; last > 0; --last) {
    FieldSplitter splitter(head.back().text);
    if (!is_without_fields(splitter.split(head[last].text))) break;
  }
  if (last == 0) return 0;
  const std::size_t count = fields_beside(head[last].text, head.back().text);
  const auto fits = [&](std::size_t place) {
    FieldSplitter splitter(head[place].text);
    const std::vector<std::string_view>& fields = splitter.split(head[place].text);
    const bool has_comment = fields.size() == count + 1 && fields.back() == kComment;
    return (fields.size() == count || has_comment) && is_header(fields);
  };
  // Names above their units may be more than the rows have fields.
  const auto is_longer = [&](std::size_t place) {
    FieldSplitter splitter(head[place].text);
    const std::vector<std::string_view>& fields = splitter.split(head[place].text);
    return fields.size() > count && is_header(fields);
  };
  if (!fits(last) || count < 2) return 0;
  FieldSplitter splitter(head[last].text);
  if (names_numbered_channels(head[last - 1].text, head[last].text)) return last - 1;
  if (!units_in(splitter.split(head[last].text)).empty()) {
    const bool is_first = last == 1 && are_units_alone(head[last].text) && is_longer(0);
    return fits(last - 1) || is_first ? last - 1 : last;
  }
  return fits(last - 1) && are_units_alone(head[last - 1].text) ? last - 1 : last;
}

// Where the numbers begin below lines of words that name no column, as a console begins its log
// with its own name; 0 where there are none. Such lines hold no separator, while the rows have
// commas or semicolons, so they can't be read as titles. One word alone is a title, of numbers with
// decimal commas. Throws InputError where the lines may be titles all the same: words in the number
// of the fields, or rows that may be single numbers with decimal commas.
std::size_t place_below_banner(const std::string& path, const TableLines& lines) {
  const std::vector<NumberedLine>& head = lines.head();
  if (!lines.ends_in_numbers() || head.size() < 2) return 0;
  const std::string& row = head.back().text;
  FieldSplitter of_rows(row), of_words("");
  const std::size_t count = of_rows.split(row).size();
  const std::size_t end = row.find_last_not_of(";,\t ");  // a sign there separates nothing
  const bool has_signs = row.find_first_of(";,") < end;
  if (count < 2 || !has_signs) return 0;
  bool has_words = false;
  for (std::size_t k = 0; k + 1 < head.size(); ++k) {
    if (head[k].text.find_first_of(";,\t") != std::string::npos) return 0;
    has_words = has_words || of_words.split(head[k].text).size() > 1;
  }
  if (!has_words) return 0;
  const NumberedLine& last = head[head.size() - 2];
  const bool may_be_titles = of_words.split(last.text).size() == count;
  const bool may_be_one_number = count < 3 && row.find_first_of("; \t") == std::string::npos;
  if (may_be_titles || may_be_one_number) {
    throw InputError(fmt::format(
        "{}: line {}: '{}' has no separator, and the row below it has {} fields: separate the "
        "titles as the numbers are, or delete line {}",
        path, last.number, shortened(last.text, kShownOfField), count, last.number));
  }
  return head.size() - 1;
}

// A first line of words with a number among them is no row where the next has another number of
// fields, and no header either.
void refuse_banner(const std::string& path, const TableLines& lines) {
  const std::vector<NumberedLine>& head = lines.head();
  if (head.size() != 2 || !lines.ends_in_numbers()) return;
  const std::string& banner = head.front().text;
  const bool has_words = std::isalpha(static_cast<unsigned char>(banner.front())) != 0;
  FieldSplitter splitter(banner);
  const std::vector<std::string_view>& fields = splitter.split(banner);
  const bool is_header_or_row = is_header(fields) || is_line_of_numbers(fields);
  const std::size_t count = fields.size();
  FieldSplitter of_rows(head.back().text);
  if (!has_words || is_header_or_row || of_rows.split(head.back().text).size() == count) return;
  throw InputError(fmt::format(
      "{}: line {}: '{}' is neither a name of each column nor a row: delete line {}", path,
      head.front().number, shortened(banner, kShownOfField), head.front().number));
}

// The lines above the header or the numbers, for a remark.
std::string remark_of_title(const std::string& path, const TableLines& lines, std::size_t header) {
  constexpr std::size_t kShown = 40;
  const std::string& first = lines.head().front().text;
  const bool has_header = header + 1 < lines.head().size();
  return fmt::format("{}: what stands above the {} in line {} is left out: '{}{}'", path,
                     has_header ? "header" : "numbers", lines.head()[header].number,
                     first.substr(0, kShown), first.size() > kShown || header > 1 ? "..." : "");
}

// For a message about the header: lines of words above the numbers that it can't be alone.
std::string words_of_metadata(const TableLines& lines) {
  if (!lines.ends_in_numbers() || lines.head().size() < 3) return "";
  return fmt::format(
      "; lines {} to {} look like metadata, and the numbers begin in line {}: give each column a "
      "name in one line, and begin the others with #",
      lines.head().front().number, lines.head()[lines.head().size() - 2].number,
      lines.head().back().number);
}

// A header with the start and the step of the time, and the line of units below it.
bool read_counted_header(const CountedTime& time, TableLines& lines, std::string_view& line,
                         FieldSplitter& splitter, RecordingFile& file) {
  std::vector<std::string_view> names = splitter.split(line);
  names.resize(time.channels);
  file.columns = header_columns(file.path, names, "");
  lines.next(line);
  const std::vector<std::string_view>& units = splitter.split(line);
  for (std::size_t k = 1; k < time.channels; ++k) {
    if (file.columns[k].unit.empty() && is_unit(units[k])) file.columns[k].unit = units[k];
  }
  return lines.next(line);
}

// The header, or numbers as names; the first line of numbers is in `line` then.
bool read_header(TableLines& lines, std::string_view& line, FieldSplitter& splitter,
                 RecordingFile& file) {
  std::vector<std::string_view> fields = splitter.split(line);
  if (!is_header(fields) && !names_numbered_channels(line, lines.peek())) {
    file.columns =
        columns_in_comments(lines.comment(), lines.comment_before(), line, fields.size());
    if (!file.columns.empty()) return true;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      file.columns.push_back({std::to_string(k + 1), {}, {}});
    }
    return true;
  }
  std::vector<std::string> above;  // units that stand above the titles
  if (are_units_alone(line) && are_titles(lines.peek(), fields.size())) {
    above = units_in(fields);
    lines.next(line);
    fields = splitter.split(line);
  }
  const std::vector<std::string_view> names = channel_names(fields);
  file.columns =
      header_columns(file.path, names.empty() ? fields : names, words_of_metadata(lines));
  for (std::size_t k = 0; k < std::min(above.size(), file.columns.size()); ++k) {
    if (file.columns[k].unit.empty()) file.columns[k].unit = above[k];
  }
  if (!lines.next(line)) return false;
  std::vector<std::string> units = units_in(splitter.split(line));
  if (!units.empty() && units.size() < file.columns.size() && are_units_alone(line)) {
    units.resize(file.columns.size());
  }
  if (units.size() != file.columns.size()) return true;
  if (names.empty() && are_more_titles(units)) {
    add_titles(units, file);
    return lines.next(line);
  }
  for (std::size_t k = 0; k < units.size(); ++k) {
    if (!names.empty() && k % 2 == 0) continue;  // the word "Unit"
    if (file.columns[k].unit.empty()) file.columns[k].unit = units[k];
  }
  return lines.next(line);
}

// A header may name the first of several columns only, as exported time series have it.
void name_the_rest(std::size_t fields, RecordingFile& file) {
  for (std::size_t k = file.columns.size(); k < fields; ++k) {
    file.columns.push_back({std::to_string(k + 1), {}, {}});
  }
}

// A table of R: its header does not name the first column, in which the rows have their numbers.
void name_rows_of_r(std::string_view line, const std::vector<std::string_view>& fields,
                    RecordingFile& file) {
  double number = 0.0;
  const bool is_quoted = line.starts_with('"') && parse_number(fields.front(), number);
  if (fields.size() != file.columns.size() + 1 || !is_quoted) return;
  file.columns.insert(file.columns.begin(), RecordedColumn{"row", {}, {}});
}

// Columns behind those that the header names: without any number they are a comma at the end of
// each line, and leave.
void tell_the_rest(std::size_t named, RecordingFile& file) {
  const std::size_t fields = file.columns.size();
  while (file.columns.size() > named && !file.columns.back().values.array().isFinite().any()) {
    file.columns.pop_back();
  }
  const std::size_t last = file.columns.size();
  if (last == named && last > 1 && file.columns.back().name == kComment &&
      !file.columns.back().values.array().isFinite().any()) {
    file.columns.pop_back();
  }
  if (last <= named) return;
  file.remarks.push_back(
      last == named + 1
          ? fmt::format("{}: the header names {} of {} columns: the other is called by its number, "
                        "{}",
                        file.path, named, fields, last)
          : fmt::format("{}: the header names {} of {} columns: the others are called by their "
                        "numbers, {} to {}",
                        file.path, named, fields, named + 1, last));
}

// Columns without a name: called by their number, or left out where hardly any number stands.
void name_or_drop_unnamed(RecordingFile& file) {
  constexpr double kEnough = 0.5;  // of the rows
  std::string dropped;
  std::vector<RecordedColumn> kept;
  for (std::size_t k = 0; k < file.columns.size(); ++k) {
    RecordedColumn& column = file.columns[k];
    const auto numbers = static_cast<double>(column.values.array().isFinite().count());
    const bool is_unnamed = column.name.empty();
    if (is_unnamed && numbers < kEnough * static_cast<double>(column.values.size())) {
      if (numbers > 0.0) dropped += fmt::format("{}{}", dropped.empty() ? "" : ", ", k + 1);
      continue;
    }
    if (is_unnamed) column.name = std::to_string(k + 1);
    kept.push_back(std::move(column));
  }
  file.columns = std::move(kept);
  if (dropped.empty()) return;
  file.remarks.push_back(fmt::format(
      "{}: without a name and with hardly any number, so left out: column {}", file.path, dropped));
}

// "speed, rpm" in a header of commas: two fields that are one title and its unit. Whether that
// makes as many columns as the rows have fields. The last field is a unit then: "u,rpm,extra" has
// a title that is one by itself.
bool joins_units(std::size_t fields, RecordingFile& file) {
  if (!is_unit(file.columns.back().name)) return false;
  std::vector<RecordedColumn> joined;
  std::string units;
  for (const RecordedColumn& column : file.columns) {
    const bool is_of_last = !joined.empty() && joined.back().unit.empty() && is_unit(column.name) &&
                            !is_unit(joined.back().name);
    if (!is_of_last) {
      joined.push_back(column);
      continue;
    }
    joined.back().unit = column.name;
    units += fmt::format("{}'{}' of '{}'", units.empty() ? "" : ", ", column.name,
                         shortened(joined.back().name, kShownOfField));
  }
  if (joined.size() != fields) return false;
  file.remarks.push_back(
      fmt::format("{}: the header names {} columns, and the rows have {} fields: "
                  "some are taken for units, {}",
                  file.path, file.columns.size(), fields, units));
  file.columns = std::move(joined);
  return true;
}

// A header may name more columns than the rows have fields: the last names have no numbers. The
// rows are held against each other as they are read.
void leave_out_names_without_fields(std::size_t fields, RecordingFile& file) {
  const std::size_t named = file.columns.size();
  if (fields < 2 || fields >= named || file.columns.back().name == kComment) return;
  if (joins_units(fields, file)) return;
  std::string names;
  for (std::size_t k = fields; k < named; ++k) {
    const std::string& name = file.columns[k].name;
    if (name.empty()) continue;  // a separator behind the last name
    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", shortened(name, kShownOfField));
    file.left_out.push_back(name);
  }
  file.columns.resize(fields);
  if (names.empty()) return;
  file.remarks.push_back(fmt::format(
      "{}: the header names {} columns, and the rows have {} fields: without numbers, and left "
      "out: {}",
      file.path, named, fields, names));
}

// Where blanks separate, a day and the time of day behind it are two fields; whether they are to be
// one, since the header names one column less.
bool has_day_apart(const std::vector<std::string_view>& fields, std::size_t named,
                   std::string_view line) {
  if (fields.size() != named + 1 || line.find_first_of(";,\t") != std::string_view::npos) {
    return false;
  }
  const auto day = parse_time_stamp(fields[0]), time = parse_time_stamp(fields[1]);
  return day && time && day->kind == TimeStamp::Kind::kDay &&
         time->kind == TimeStamp::Kind::kTimeOfDay;
}

// The first two fields as one.
std::vector<std::string_view> with_day_joined(const std::vector<std::string_view>& fields) {
  std::vector<std::string_view> joined(fields.begin() + 1, fields.end());
  const char* end = fields[1].data() + fields[1].size();
  joined[0] = {fields[0].data(), static_cast<std::size_t>(end - fields[0].data())};
  return joined;
}

// Stamps are times in s. A column of days and one with the time of day are one time.
void take_stamps(const std::vector<ColumnContent>& contents, RecordingFile& file) {
  std::vector<std::size_t> days, times;
  for (std::size_t k = 0; k < contents.size(); ++k) {
    const StampColumn& stamps = contents[k].stamps;
    if (!stamps.has_any()) continue;
    file.columns[k].unit = "s";
    file.columns[k].origin = stamps.description();
    if (stamps.kind() == TimeStamp::Kind::kDay) days.push_back(k);
    if (stamps.kind() == TimeStamp::Kind::kTimeOfDay) times.push_back(k);
  }
  if (days.size() != 1 || times.size() != 1) return;
  constexpr double kDay = 86400.0;
  const auto within_day = [](double time) { return std::fmod(time, kDay); };
  RecordedColumn& time = file.columns[times.front()];
  time.values = time.values.unaryExpr(within_day) + file.columns[days.front()].values;
  file.columns.erase(file.columns.begin() + static_cast<std::ptrdiff_t>(days.front()));
}

// Whether a row has a field for each column. A separator behind the last field, in some rows or in
// all, makes a field without name and number that counts for nothing.
bool are_all_fields(const std::vector<std::string_view>& fields, const RecordingFile& file,
                    const std::vector<ColumnContent>& contents) {
  const std::size_t columns = file.columns.size();
  if (fields.size() < columns) {
    const std::string& name = file.columns.back().name;
    const bool is_nothing = !contents.back().has_numbers && !contents.back().stamps.has_any() &&
                            (name == std::to_string(columns) || name == kComment);
    return fields.size() + 1 == columns && is_nothing;
  }
  return std::all_of(fields.begin() + static_cast<std::ptrdiff_t>(columns), fields.end(),
                     [](std::string_view field) { return field.empty(); });
}

// Samples beside the settings of an oscilloscope, whose channel and unit two of those are.
void read_samples_beside_settings(TableLines& lines, RecordingFile& file) {
  std::vector<double> times, values;
  std::string name = "CH1", unit;
  std::string_view line;
  FieldSplitter splitter(lines.head().front().text);
  while (lines.next(line)) {
    const std::vector<std::string_view>& fields = splitter.split(line);
    const std::vector<std::string_view> sample = sample_beside_setting(fields);
    if (sample.empty()) {
      throw InputError(fmt::format(
          "{}: line {}: no time and value in columns 4 and 5, beside the recorder's settings",
          file.path, lines.number()));
    }
    if (fields[0] == "Source" && !fields[1].empty()) name = fields[1];
    if (fields[0] == "Vertical Units" && is_unit(fields[1])) unit = fields[1];
    times.push_back(number_in_table(file.path, lines.number(), "4", sample[0]));
    values.push_back(number_in_table(file.path, lines.number(), "5", sample[1]));
  }
  const auto count = static_cast<Eigen::Index>(times.size());
  file.columns.push_back({"Time", "s", Eigen::Map<const Eigen::VectorXd>(times.data(), count)});
  file.columns.push_back({name, unit, Eigen::Map<const Eigen::VectorXd>(values.data(), count)});
  file.remarks.push_back(fmt::format(
      "{}: the first columns hold the recorder's settings: time and {} are columns 4 and 5",
      file.path, name));
}

void refuse_long_titles(const RecordingFile& file) {
  for (const RecordedColumn& column : file.columns) {
    if (column.name.size() <= kLongestTitle) continue;
    throw InputError(fmt::format(
        "{}: header: '{}' has {} characters, {} at most: give the column a shorter name", file.path,
        shortened(column.name, kShownOfField), column.name.size(), kLongestTitle));
  }
}

// Words where numbers should begin: what was taken for the header may be a title.
void refuse_words(const std::string& path, std::size_t line,
                  const std::vector<std::string_view>& fields) {
  const auto is_word = [](std::string_view field) {  // no decimal comma, no error of Excel
    return !field.empty() && std::isalpha(static_cast<unsigned char>(field.front())) != 0;
  };
  if (!is_header(fields) || !std::ranges::all_of(fields, is_word)) return;
  throw InputError(fmt::format(
      "{}: line {}: '{}' is no number, nor a name of each column: delete what stands above the "
      "header, or begin it with #",
      path, line, shortened(fields.front())));
}

// The rows behind the header, of which `line` is the first. The header may be among them again,
// where a logger began anew in the same file.
void read_rows(TableLines& lines, std::string_view line, FieldSplitter& splitter,
               const std::string& header, bool joins_day, std::vector<ColumnContent>& contents,
               RecordingFile& file) {
  std::vector<std::string_view> joined;
  std::vector<std::vector<double>> values(file.columns.size());
  std::size_t headers = 0;
  bool more = true;
  for (; more; more = lines.next(line)) {
    if (line == header) {
      ++headers;
      continue;
    }
    const std::vector<std::string_view>& split = splitter.split(line);
    const std::vector<std::string_view>& fields =
        joins_day && split.size() > 1 ? joined = with_day_joined(split) : split;
    if (!are_all_fields(fields, file, contents)) {
      throw InputError(fmt::format("{}: line {}: {} fields, but there are {} columns", file.path,
                                   lines.number(), fields.size(), values.size()));
    }
    for (std::size_t k = 0; k < values.size(); ++k) {
      const std::string_view field = k < fields.size() ? fields[k] : std::string_view();
      values[k].push_back(
          sample_in(file.path, lines.number(), file.columns[k].name, field, contents[k]));
    }
  }
  for (std::size_t k = 0; k < values.size(); ++k) {
    file.columns[k].values = Eigen::Map<const Eigen::VectorXd>(
        values[k].data(), static_cast<Eigen::Index>(values[k].size()));
  }
  if (headers == 0) return;
  file.remarks.push_back(fmt::format("{}: the header stands among the rows again, {} time{}",
                                     file.path, headers, headers == 1 ? "" : "s"));
}

}  // namespace

RecordingFile read_csv_recording(const std::string& path, PackedText text) {
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  TableLines lines(text ? LineReader(path, *std::move(text)) : LineReader(path));
  if (!lines.head().empty() && begins_with_setting(lines.head().front().text)) {
    read_samples_beside_settings(lines, file);
    return file;
  }
  const std::size_t banner = place_below_banner(path, lines);
  const std::size_t header = banner > 0 ? banner : place_of_header(lines);
  if (header == 0) refuse_banner(path, lines);
  lines.begin_at(header);
  std::string_view line;
  bool more = lines.next(line);
  if (!more) throw InputError(path + ": there are no numbers");
  if (header > 0) file.remarks.push_back(remark_of_title(path, lines, header));
  FieldSplitter splitter(line);
  const std::optional<CountedTime> counted = counted_time(splitter.split(line), lines.peek());
  more = counted ? read_counted_header(*counted, lines, line, splitter, file)
                 : read_header(lines, line, splitter, file);
  for (std::size_t k = 0; k < header; ++k) take_stated_units(lines.head()[k].text, file);
  refuse_long_titles(file);
  if (more && header == 0) refuse_words(path, lines.number(), splitter.split(line));
  if (more) leave_out_names_without_fields(splitter.split(line).size(), file);
  if (more) name_rows_of_r(line, splitter.split(line), file);
  const std::size_t named = file.columns.size();
  const bool joins_day = more && has_day_apart(splitter.split(line), named, line);
  if (more && !joins_day) name_the_rest(splitter.split(line).size(), file);
  std::vector<ColumnContent> contents(file.columns.size());
  if (!more) throw InputError(path + ": there is a header and no numbers");
  const NumberedLine& above = lines.head()[header];  // the first row, where there is no header
  read_rows(lines, line, splitter, above.number < lines.number() ? above.text : "", joins_day,
            contents, file);
  if (counted) take_counted_time(*counted, file);
  tell_the_rest(named, file);
  take_units_of_fields(contents, file);
  leave_out_words(contents, file);
  take_stamps(contents, file);
  leave_out_equal_times(file);
  name_or_drop_unnamed(file);
  if (file.columns.empty()) throw InputError(path + ": no column has a name or numbers");
  return file;
}

}  // namespace graybox::formats
