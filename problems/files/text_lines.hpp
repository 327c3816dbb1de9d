// What readers of text tables share: lines that carry something, numbered as an editor numbers
// them, and numbers.
#pragma once

#include <cstddef>
#include <istream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace graybox {

// Without blanks, tabs and carriage returns at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);

// Lines without blanks at their ends; empty lines and lines that begin with # are skipped, and so
// is a byte order mark.
class LineReader {
 public:
  explicit LineReader(const std::string& path);
  // Reads a text that is in memory already; `path` is for messages.
  LineReader(const std::string& path, std::string text);

  // The line is valid until the next call. Throws InputError if the file can't be read.
  bool next(std::string_view& line);
  [[nodiscard]] std::size_t number() const { return number_; }
  // The last line with # that was skipped, with its sign; empty where there was none.
  [[nodiscard]] const std::string& comment() const { return comment_; }
  // The one before it.
  [[nodiscard]] const std::string& comment_before() const { return comment_before_; }

 private:
  std::string path_;
  std::unique_ptr<std::istream> stream_;
  std::string text_, comment_, comment_before_;
  std::size_t number_ = 0;
};

// Cuts the lines of one table into fields. The first of semicolon, comma and tab that occurs in the
// table's first line separates them; where none occurs, runs of blanks and tabs do. Signs that end
// a line and separate nothing ("1,2,3;"), or stand in quotes, don't count. Quotes are taken off.
//
// With semicolons, tabs or quotes, numbers may have decimal commas: "1,25" is 1.25, and "2,5e-3"
// is 0.0025. Not where other numbers of the table have points, for a comma then may stand between
// thousands; such a field is left as it is, and is no number.
class FieldSplitter {
 public:
  explicit FieldSplitter(std::string_view first_line);

  // Valid until the next call, and as long as the line and the splitter are.
  const std::vector<std::string_view>& split(std::string_view line) &;

 private:
  void take_decimal_commas(std::string_view line);

  char separator_ = ' ';
  bool has_points_ = false;  // in numbers, so far
  std::vector<std::string_view> fields_;
  std::vector<char> with_points_;  // the line, where it has decimal commas
};

// Whether a table's first line names its columns: no field is a number. One number among words
// makes the line data, so that a typo there is an error and no header.
[[nodiscard]] bool is_header(const std::vector<std::string_view>& fields);

// The number of a field of a table. Throws InputError "path: line 3, column 2: 'zero' is no
// number", with `column` as it is given.
[[nodiscard]] double number_in_table(const std::string& path, std::size_t line,
                                     const std::string& column, std::string_view field);

// False unless the whole field is a number; nan and inf are numbers, and one beyond the range of
// doubles is infinite.
[[nodiscard]] bool parse_number(std::string_view field, double& value);

}  // namespace graybox
