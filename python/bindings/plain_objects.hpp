// What the library writes as JSON, as Python's dicts, lists, numbers and texts.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <nlohmann/json_fwd.hpp>
#include <vector>

namespace graybox::python {

[[nodiscard]] pybind11::object plain_object(const nlohmann::ordered_json& value);

// An array that takes over the numbers, without a copy.
template <typename Number>
[[nodiscard]] pybind11::array_t<Number> array_of(std::vector<Number> values) {
  auto* kept = new std::vector<Number>(std::move(values));
  const pybind11::capsule owner(
      kept, [](void* pointer) { delete static_cast<std::vector<Number>*>(pointer); });
  return pybind11::array_t<Number>(static_cast<pybind11::ssize_t>(kept->size()), kept->data(),
                                   owner);
}

}  // namespace graybox::python
