// Design files (graybox-design/1) for Python: what `graybox check` reads, written and read again.
#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <string>

#include "python/bindings/information.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/constrained/constrained_design_file.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox::python {

// What was found, with all that its file says: made by solve() and exact(), called by save().
struct DesignWriter {
  std::function<void(const std::string&)> write;
};

// The set as Python has it, which lives as long as this object.
[[nodiscard]] pybind11::object held(const PythonSet& set);

// What the checker proves of whole numbers of experiments under a request or another criterion than
// D: the fields of Python's ExactCertificate.
[[nodiscard]] pybind11::dict fields_of_exact_check(const InformationSet& set,
                                                   const ConstrainedReport& report,
                                                   double efficiency);

void add_design_files(pybind11::module_& module);

}  // namespace graybox::python
