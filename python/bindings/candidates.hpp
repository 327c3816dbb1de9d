// Python callables as candidate generators: sets from Jacobians, and designs between the points of
// a grid.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_candidates(pybind11::module_& module);

}  // namespace graybox::python
