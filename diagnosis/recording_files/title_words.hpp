// Titles of columns and units as words, whatever signs and letters they are written with.
//
// Signs of units become letters ("°" is deg, "µ" is u), and letters with accents lose these. A
// title is cut into words at signs, at capitals within it and between letters and digits.
//
//   words_of("arm1Pos [°]")    // arm, 1, pos, deg
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace graybox {

// The text, or what it is as Latin 1 where it is no UTF-8: "Winkel [\xB0]" of German Windows.
[[nodiscard]] std::string in_utf8(std::string_view text);

void replace_all(std::string& text, std::string_view from, std::string_view to);

// Signs of units as letters, and letters without accents.
[[nodiscard]] std::string spelled_out(std::string_view text);

// Words with the capitals as they were, and in lower case.
[[nodiscard]] std::vector<std::string> words_as_written(std::string_view title);
[[nodiscard]] std::vector<std::string> in_lower_case(std::vector<std::string> words);

// Words of a title in lower case, spelled out.
[[nodiscard]] std::vector<std::string> words_of(std::string_view title);

// Words with a blank between them.
[[nodiscard]] std::string joined_words(std::span<const std::string> words);

}  // namespace graybox
