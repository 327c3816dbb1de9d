// exact() for Python: whole numbers of experiments, and their checker.
#pragma once

#include <pybind11/pybind11.h>

#include "solvers/exact/exact_certificate.hpp"

namespace graybox::python {

[[nodiscard]] pybind11::dict fields_of(const ExactCertificate& certificate);

void add_exact(pybind11::module_& module);

}  // namespace graybox::python
