// robot_set(), spectrum() and sequential() for Python: designs for a flexible robot.
#pragma once

#include <pybind11/pybind11.h>

namespace graybox::python {

void add_robot_designs(pybind11::module_& module);

}  // namespace graybox::python
