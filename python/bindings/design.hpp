// solve() and certify() for Python: the library's back-ends, and its checker.
#pragma once

#include <pybind11/pybind11.h>

#include <span>
#include <string>

#include "solvers/certificates/certificate.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/floors/efficiency_floor.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::python {

// The fields of a certificate, under the names that Python's Certificate has.
[[nodiscard]] pybind11::dict fields_of(const Certificate& certificate);

// Those of a report, its certificate among them.
[[nodiscard]] pybind11::dict fields_of(const SolveReport& report);

// A list of dicts with criterion, share and multiplier, and with efficiency where these are known.
[[nodiscard]] pybind11::list floor_list(std::span<const EfficiencyFloor> floors,
                                        std::span<const double> efficiencies);

// The claim that a status in words makes; a failure for other words.
[[nodiscard]] SolveStatus solve_status(const std::string& name);

void add_design(pybind11::module_& module);

}  // namespace graybox::python
