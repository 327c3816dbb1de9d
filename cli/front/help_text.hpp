// Text that is folded to the width of a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace graybox::cli {

// Columns of the terminal, between 60 and 100: those that COLUMNS states, else those of standard
// output, else 80.
[[nodiscard]] std::size_t terminal_columns();

// The words of a text in lines of at most `columns`; a longer word has a line of its own.
[[nodiscard]] std::vector<std::string> folded_lines(const std::string& text, std::size_t columns);

// Each line ends with a newline. All but the first are indented.
[[nodiscard]] std::string folded(const std::string& text, std::size_t columns,
                                 std::size_t indent = 0);

// As folded(), for text with tables and commands. Lines that begin with a space, hold two in a row
// or end with a colon stay as they are.
[[nodiscard]] std::string folded_paragraphs(const std::string& text, std::size_t columns);

// A name, and what it means in a column of its own that begins at `second`.
[[nodiscard]] std::string in_two_columns(const std::string& name, const std::string& meaning,
                                         std::size_t second, std::size_t columns);

}  // namespace graybox::cli
