// exact() for Python: whole numbers of experiments, and their checker.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_exact(pybind11::module_& module);

}  // namespace graybox::python
