#include "python/bindings/option_ranges.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "problems/base/error.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

[[noreturn]] void refuse(const py::handle& value, std::string_view name, double lowest,
                         double highest) {
  throw InputError(fmt::format("{}: Value {} not in range [{:g} - {:g}]", name,
                               std::string(py::str(value)), lowest, highest));
}

}  // namespace

double number(const py::handle& value, std::string_view name, double lowest, double highest) {
  const auto found = py::cast<double>(value);
  if (!(found >= lowest && found <= highest)) refuse(value, name, lowest, highest);
  return found;
}

int whole_number(const py::handle& value, std::string_view name, int lowest, int highest) {
  const auto found = py::cast<long long>(value);
  if (found < lowest || found > highest) refuse(value, name, lowest, highest);
  return static_cast<int>(found);
}

std::string one_of(const py::handle& value, std::string_view name,
                   std::initializer_list<std::string_view> known) {
  const std::string found = py::str(value);
  if (std::ranges::find(known, found) == known.end()) {
    throw InputError(fmt::format("{}: {} not in {{{}}}", name, found, fmt::join(known, ",")));
  }
  return found;
}

}  // namespace graybox::python
