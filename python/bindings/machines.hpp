// fit(), predict(), simulate() and model() for Python, on files.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_machines(pybind11::module_& module);

}  // namespace graybox::python
