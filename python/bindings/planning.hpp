// plan() for Python: how many experiments reach stated precisions.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_planning(pybind11::module_& module);

}  // namespace graybox::python
