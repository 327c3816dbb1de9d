// diagnose() for Python, from files to a verdict.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_diagnosis(pybind11::module_& module);

}  // namespace graybox::python
