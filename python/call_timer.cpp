// The C++ side of scripts/python_overhead, in the same process and on the same memory: does in C++
// what a call from Python does, and answers with its wall seconds and the gap it proved.
//
//   whole(packed)    the set from packed memory, validated; solved; certified
//   solve(packed)    solved and certified; the set was validated before
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <chrono>
#include <memory>
#include <utility>

#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/semidefinite_projection.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/solve_report.hpp"

namespace {

using namespace graybox;
using Packed = pybind11::array_t<double, pybind11::array::c_style>;

ProjectedSet validated(const Packed& packed) {
  const std::size_t d = dimension_from_packed_size(static_cast<std::size_t>(packed.shape(1)));
  AlignedArray values =
      AlignedArray::borrowed(packed.data(), static_cast<std::size_t>(packed.size()));
  require_finite("information set", values, d);
  return project_semidefinite(InformationSet(d, std::move(values)));
}

double solved_and_certified(const InformationSet& set) {
  static const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at("column_generation");
  return judge(set, solver.name(), {}, solver.solve(set, {})).certificate.duality_gap;
}

template <typename Work>
std::pair<double, double> timed(Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  const double gap = work();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  return {wall.count(), gap};
}

}  // namespace

PYBIND11_MODULE(_call_timer, module) {
  module.def("whole", [](const Packed& packed) {
    return timed([&] { return solved_and_certified(validated(packed).set); });
  });
  module.def("solve", [](const Packed& packed) {
    const ProjectedSet before = validated(packed);
    return timed([&] { return solved_and_certified(before.set); });
  });
}
