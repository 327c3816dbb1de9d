// What a check of a recording found.
#pragma once

#include <string>

namespace graybox {

enum class Severity {
  kWarning,  // the recording can be used; a person should know
  kError     // the recording can't be used as it is
};

struct Finding {
  Severity severity;
  std::string check;    // "time", "not a number", "clipped", ...: one word or two
  std::string message;  // one line: what, where, and what to do
};

}  // namespace graybox
