// What readers of text tables share: lines that carry something, numbered as an editor numbers
// them, and numbers.
#pragma once

#include <cstddef>
#include <fstream>
#include <string>
#include <string_view>

namespace graybox {

// Without blanks, tabs and carriage returns at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);

// Lines without blanks at their ends; empty lines and lines that begin with # are skipped, and so is
// a byte order mark.
class LineReader {
 public:
  explicit LineReader(const std::string& path);

  // The line is valid until the next call. Throws InputError if the file can't be read.
  bool next(std::string_view& line);
  [[nodiscard]] std::size_t number() const { return number_; }

 private:
  std::string path_;
  std::ifstream stream_;
  std::string text_;
  std::size_t number_ = 0;
};

// False unless the whole field is a number; nan and inf are numbers, and one beyond the range of
// doubles is infinite.
[[nodiscard]] bool parse_number(std::string_view field, double& value);

}  // namespace graybox
