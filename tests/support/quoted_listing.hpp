// Listings that pages quote, against what a program prints: words are the same, numbers nearly.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.hpp"

namespace graybox::testing {

inline std::string source_file(const std::string& name) {
  return read_text(std::string(GRAYBOX_SOURCE_DIR) + "/" + name);
}

// A line without its numbers, and these.
struct Line {
  std::string words;
  std::vector<double> numbers;
};

inline Line taken_apart(const std::string& text) {
  Line line;
  for (std::size_t i = 0; i < text.size();) {
    const bool is_number = std::isdigit(static_cast<unsigned char>(text[i])) != 0;
    if (!is_number) {
      line.words += text[i++];
      continue;
    }
    std::size_t length = 0;
    line.numbers.push_back(std::stod(text.substr(i), &length));
    line.words += '#';
    i += length;
  }
  return line;
}

// The last places of what a fit prints may differ from machine to machine.
inline bool is_same(const Line& quoted, const Line& printed, bool is_beginning) {
  constexpr double kRelative = 0.05;
  const bool same_words =
      is_beginning ? printed.words.starts_with(quoted.words) : printed.words == quoted.words;
  if (!same_words) return false;
  for (std::size_t i = 0; i < quoted.numbers.size(); ++i) {
    const double size = std::max(std::abs(quoted.numbers[i]), std::abs(printed.numbers[i]));
    if (std::abs(quoted.numbers[i] - printed.numbers[i]) > kRelative * size) return false;
  }
  return true;
}

// Lines of the page's code block that begins so.
inline std::vector<std::string> quoted_listing(const std::string& page,
                                               const std::string& beginning) {
  const std::string text = source_file(page);
  const std::size_t first = text.find("```\n" + beginning) + 3;
  EXPECT_GT(first, 3U) << page;
  std::istringstream block(text.substr(first + 1, text.find("\n```", first) - first - 1));
  std::vector<std::string> lines;
  for (std::string line; std::getline(block, line);) lines.push_back(line);
  return lines;
}

// Every line of the page's listing is one of those printed, or begins one that is cut short.
inline void expect_quoted(const std::string& page, const std::string& output,
                          const std::string& beginning = "verdict: ") {
  std::vector<Line> printed;
  std::istringstream text(output);
  for (std::string line; std::getline(text, line);) printed.push_back(taken_apart(line));
  const std::string left_out = "[...]";
  for (std::string line : quoted_listing(page, beginning)) {
    if (line == left_out) continue;
    const bool is_beginning = line.ends_with(left_out);
    if (is_beginning) line.resize(line.size() - left_out.size());
    const Line quoted = taken_apart(line);
    EXPECT_TRUE(std::ranges::any_of(
        printed, [&](const Line& each) { return is_same(quoted, each, is_beginning); }))
        << page << " quotes: " << line << "\nprinted:\n"
        << output;
  }
}

}  // namespace graybox::testing
