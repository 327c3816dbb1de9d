#include "problems/formats/mat_variable.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "problems/base/error.hpp"

namespace graybox {

std::string choose_variable(const std::string& path, const std::vector<std::string>& fitting,
                            const std::string& wanted) {
  const std::string choices = fmt::format("{}", fmt::join(fitting, ", "));
  if (fitting.empty()) {
    throw InputError(fmt::format(
        "{}: no variable is a cell array of square matrices or a d x d x Q array; save one, for "
        "example Hi",
        path));
  }
  if (wanted.empty()) {
    if (fitting.size() == 1) return fitting.front();
    throw InputError(
        fmt::format("{}: several variables may be information sets: {}; name one with "
                    "--variable",
                    path, choices));
  }
  if (std::ranges::find(fitting, wanted) != fitting.end()) return wanted;
  throw InputError(
      fmt::format("{}: variable {} is no cell array of matrices and no d x d x Q "
                  "array; choose {}",
                  path, wanted, choices));
}

}  // namespace graybox
