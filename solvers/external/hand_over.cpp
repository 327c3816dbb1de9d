#include "solvers/external/hand_over.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/shortened.hpp"

namespace graybox {
namespace {

constexpr std::array kFormats{"h5", "npy", "csv", "mat", "cbf"};
constexpr const char* kPlainCharacters =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-.+/,:@%";

// The place of "{name}", from `start` on, that the shell does not mean by "${name}".
std::size_t find_placeholder(const std::string& text, const std::string& name, std::size_t start) {
  const std::string mark = "{" + name + "}";
  std::size_t at = text.find(mark, start);
  while (at != std::string::npos && at > 0 && text[at - 1] == '$') at = text.find(mark, at + 1);
  return at;
}

bool has_placeholder(const std::string& text, const std::string& name) {
  return find_placeholder(text, name, 0) != std::string::npos;
}

// Whether there was any to replace.
bool replace_all(std::string& text, const std::string& name, const std::string& value) {
  std::size_t at = find_placeholder(text, name, 0);
  if (at == std::string::npos) return false;
  if (value.find_first_not_of(kPlainCharacters) != std::string::npos) {
    throw InputError(
        fmt::format("{}: such a path can't stand for {{{}}} in a command; set TMPDIR "
                    "to a folder of letters and digits",
                    value, name));
  }
  while (at != std::string::npos) {
    text.replace(at, name.size() + 2, value);
    at = find_placeholder(text, name, at + value.size());
  }
  return true;
}

}  // namespace

ExternalCommand::ExternalCommand(std::string text) : text_(std::move(text)) {
  if (text_.find_first_not_of(" \t") == std::string::npos) {
    throw InputError("solver 'external:' names no program; write external:CMD");
  }
  std::string named;
  for (const char* format : kFormats) {
    if (!has_placeholder(text_, format)) continue;
    if (!named.empty()) {
      throw InputError(fmt::format("{}: asks for the set as {{{}}} and as {{{}}}; choose one",
                                   shortened(text_), named, format));
    }
    named = format;
  }
  if (!named.empty()) set_ending_ = "." + named;
}

std::vector<std::string> ExternalCommand::words(const HandedOver& inputs) const {
  std::string line = text_;
  replace_all(line, "seed", std::to_string(inputs.seed));
  replace_all(line, "threads", std::to_string(inputs.threads));
  const std::array<std::pair<std::string, std::string>, 4> handed{{
      {set_ending_.substr(1), inputs.set_file},
      {"design", inputs.design_file},
      {"gap", fmt::format("{}", inputs.duality_gap)},
      {"seconds", fmt::format("{}", inputs.seconds)},
  }};
  std::vector<std::string> appended;
  for (const auto& [name, value] : handed) {
    if (!replace_all(line, name, value)) appended.push_back(value);
  }
  std::vector<std::string> words{"/bin/sh", "-c", line + " \"$@\"", "external"};
  words.insert(words.end(), appended.begin(), appended.end());
  return words;
}

}  // namespace graybox
