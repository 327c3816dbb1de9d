// The name of a file before what is wrong in it, once: what lies deeper may have named it already.
//
//   throw InputError(in_file(path, error.what()));
#pragma once

#include <string>

namespace graybox {

[[nodiscard]] inline std::string in_file(const std::string& path, const std::string& message) {
  return message.starts_with(path + ":") ? message : path + ": " + message;
}

}  // namespace graybox
