#include "python/bindings/plain_objects.hpp"

#include <nlohmann/json.hpp>
#include <string>

namespace graybox::python {

namespace py = pybind11;

py::object plain_object(const nlohmann::ordered_json& value) {
  using Type = nlohmann::ordered_json::value_t;
  switch (value.type()) {
    case Type::boolean:
      return py::bool_(value.get<bool>());
    case Type::number_integer:
      return py::int_(value.get<std::int64_t>());
    case Type::number_unsigned:
      return py::int_(value.get<std::uint64_t>());
    case Type::number_float: {
      // As in the files: numbers that are not finite are not known.
      const double number = value.get<double>();
      return std::isfinite(number) ? py::object(py::float_(number)) : py::object(py::none());
    }
    case Type::string:
      return py::str(value.get_ref<const std::string&>());
    case Type::array: {
      py::list list;
      for (const auto& each : value) list.append(plain_object(each));
      return list;
    }
    case Type::object: {
      py::dict dict;
      for (const auto& [key, each] : value.items()) dict[py::str(key)] = plain_object(each);
      return dict;
    }
    default:
      return py::none();
  }
}

}  // namespace graybox::python
