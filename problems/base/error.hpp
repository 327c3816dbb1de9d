// The one exception graybox throws for bad input: a missing file, a wrong shape, a NaN, an unknown
// name. Its text is a single line that names the file or argument, the field and the fix; commands
// print it and exit with code 2. Numerical outcomes are statuses, never exceptions.
#pragma once

#include <stdexcept>
#include <string>

namespace graybox {

class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& line) : std::runtime_error(line) {}
};

}  // namespace graybox
