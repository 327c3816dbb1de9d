// Information sets and design requests as Python gives them.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "problems/information/semidefinite_projection.hpp"
#include "solvers/constrained/design_request.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/floors/efficiency_floor.hpp"

namespace graybox::python {

// A set that has been checked, with what it borrows memory from.
struct PythonSet {
  ProjectedSet projected;
  SingularSum sum = SingularSum::kRefused;  // what its sum was allowed to be
  pybind11::object owner = {};  // the array whose memory is used; none where it was copied
  [[nodiscard]] const InformationSet& set() const { return projected.set; }
};

// Throws InputError for a singular sum where nothing is known before the first experiment.
void require_regular(const PythonSet& set, const DesignRequest& request);

// An array of numbers of any shape, as float64 in C order. Throws InputError for another type.
[[nodiscard]] pybind11::array_t<double, pybind11::array::c_style> numbers(
    const pybind11::handle& value, const std::string& name);
[[nodiscard]] std::vector<double> number_list(const pybind11::handle& value,
                                              const std::string& name);

// `arguments`: the keywords criterion (a name, or a dict of names and shares), W, interest, region
// and p. Throws InputError.
[[nodiscard]] Criterion criterion_of(const pybind11::dict& arguments, const InformationSet& set);

// The keywords floor (names and shares) and floor_multipliers (names and numbers), each of them
// None or a dict. Throws InputError.
[[nodiscard]] std::vector<EfficiencyFloor> floors_of(const pybind11::dict& arguments,
                                                     const InformationSet& set);

// `arguments`: request (a file), experiments, budget, prior, done, costs, stock, require, forbid,
// block_sizes, constraints, A_ub, b_ub, A_eq, b_eq, each of them None or a value. Throws
// InputError.
[[nodiscard]] DesignRequest request_of(const pybind11::dict& arguments);

void add_information(pybind11::module_& module);

}  // namespace graybox::python
