// Which variable of a MATLAB file is the information set.
#pragma once

#include <string>
#include <vector>

namespace graybox {

// `fitting` are the variables that can be one, by their kind. Returns `wanted` if it is among them;
// with `wanted` empty, the only one. Throws InputError naming the choices otherwise.
[[nodiscard]] std::string choose_variable(const std::string& path,
                                          const std::vector<std::string>& fitting,
                                          const std::string& wanted);

}  // namespace graybox
