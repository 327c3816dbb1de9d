#include "cli/output/command_line.hpp"

#include <filesystem>
#include <string_view>

namespace graybox::cli {
namespace {

// In single quotes where a shell would read it otherwise.
std::string quoted(const std::string& word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string result(1, '\'');
  for (const char letter : word) {
    if (letter == '\'') result += "'\\'";
    result += letter;
  }
  result += '\'';
  return result;
}

}  // namespace

std::string command_line(const char* const* arguments) {
  if (arguments == nullptr || arguments[0] == nullptr) return "";
  std::string line = std::filesystem::path(arguments[0]).filename().string();
  for (std::size_t i = 1; arguments[i] != nullptr; ++i) {
    line += ' ';
    line += quoted(arguments[i]);
  }
  return line;
}

}  // namespace graybox::cli
