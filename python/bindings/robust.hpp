// robust() and concentrated() for Python. The one designs for several sets at once, the other under
// a limit on the share of a few candidates.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_robust(pybind11::module_& module);

}  // namespace graybox::python
