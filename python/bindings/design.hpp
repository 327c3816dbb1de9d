// solve() and certify() for Python: the library's back-ends, and its checker.
#pragma once

#include <pybind11/pybind11.h>

#include "solvers/certificates/certificate.hpp"

namespace graybox::python {

// The fields of a certificate, under the names that Python's Certificate has.
[[nodiscard]] pybind11::dict fields_of(const Certificate& certificate);

void add_design(pybind11::module_& module);

}  // namespace graybox::python
