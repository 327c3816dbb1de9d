// Options within their ranges, as the command has them.
#pragma once

#include <pybind11/pybind11.h>

#include <initializer_list>
#include <string>
#include <string_view>

namespace graybox::python {

// All throw InputError, naming the option and what it takes.
[[nodiscard]] double number(const pybind11::handle& value, std::string_view name, double lowest,
                            double highest);
[[nodiscard]] int whole_number(const pybind11::handle& value, std::string_view name, int lowest,
                               int highest);
[[nodiscard]] std::string one_of(const pybind11::handle& value, std::string_view name,
                                 std::initializer_list<std::string_view> known);

}  // namespace graybox::python
