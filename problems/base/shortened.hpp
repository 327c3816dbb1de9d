// Text in messages, so that a message stays one that a person can read.
#pragma once

#include <string>
#include <string_view>

namespace graybox {

// The text itself, or its two ends with the count of what is left out between them:
// "f(x) = 1+1+1 ... (399940 characters) ... +1".
[[nodiscard]] inline std::string shortened(std::string_view text, std::size_t longest = 120) {
  if (text.size() <= longest) return std::string(text);
  const std::size_t end = longest / 4, start = longest - end;
  return std::string(text.substr(0, start)) + " ... (" + std::to_string(text.size() - start - end) +
         " characters) ... " + std::string(text.substr(text.size() - end));
}

}  // namespace graybox
