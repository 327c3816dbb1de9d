#include "cli/front/help_text.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace graybox::cli {
namespace {

constexpr std::size_t kNarrowest = 60, kUsual = 80, kWidest = 100;

// A line that must not be joined with its neighbours.
bool is_set(const std::string& line) {
  return line.empty() || line.front() == ' ' || line.back() == ':' ||
         line.find("  ") != std::string::npos;
}

}  // namespace

std::size_t terminal_columns() {
  std::size_t columns = 0;
  if (const char* stated = std::getenv("COLUMNS"); stated != nullptr) {
    columns = std::strtoul(stated, nullptr, 10);
  }
  if (winsize size{}; columns == 0 && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0) {
    columns = size.ws_col;
  }
  return columns == 0 ? kUsual : std::clamp(columns, kNarrowest, kWidest);
}

std::vector<std::string> folded_lines(const std::string& text, std::size_t columns) {
  std::vector<std::string> lines;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (lines.empty() || lines.back().size() + 1 + word.size() > columns) {
      lines.push_back(word);
    } else {
      lines.back() += ' ' + word;
    }
  }
  return lines;
}

std::string folded(const std::string& text, std::size_t columns, std::size_t indent) {
  std::string out;
  for (const std::string& line : folded_lines(text, columns - indent)) {
    out += (out.empty() ? std::string() : std::string(indent, ' ')) + line + '\n';
  }
  return out;
}

std::string folded_paragraphs(const std::string& text, std::size_t columns) {
  std::string out, paragraph;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!is_set(line)) {
      paragraph += line + ' ';
      continue;
    }
    out += folded(paragraph, columns) + line + '\n';
    paragraph.clear();
  }
  return out + folded(paragraph, columns);
}

std::string in_two_columns(const std::string& name, const std::string& meaning, std::size_t second,
                           std::size_t columns) {
  std::string out = "  " + name;
  const std::string beginning(second, ' ');
  const bool fits = out.size() < second;
  if (fits) out.resize(second, ' ');
  bool is_first = true;
  for (const std::string& line : folded_lines(meaning, columns - second)) {
    out += is_first && fits ? line : '\n' + beginning + line;
    is_first = false;
  }
  out.erase(out.find_last_not_of(' ') + 1);
  return out + '\n';
}

}  // namespace graybox::cli
