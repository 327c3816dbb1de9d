// The C++ side of scripts/python_overhead: does in C++ what a call from Python does, each time a
// line comes on standard input, and answers with its wall seconds.
//
//   python_call_timer SET.npy whole    the set from packed memory, validated; solved; certified
//   python_call_timer SET.npy solve    solved and certified; the set was validated before
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>

#include "problems/formats/npy_file.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/semidefinite_projection.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/solve_report.hpp"

namespace {

using namespace graybox;

ProjectedSet validated(const InformationSet& source) {
  AlignedArray packed =
      AlignedArray::borrowed(source.data(), source.candidate_count() * source.packed_size());
  require_finite("information set", packed, source.dimension());
  return project_semidefinite(InformationSet(source.dimension(), std::move(packed)));
}

double solved_and_certified(const Solver& solver, const InformationSet& set) {
  const SolveReport report = judge(set, solver.name(), {}, solver.solve(set, {}));
  return report.certificate.duality_gap;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("python_call_timer: give SET.npy and whole or solve\n", stderr);
    return 2;
  }
  const InformationSet source = read_npy(argv[1]);
  const ProjectedSet before = validated(source);
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at("column_generation");
  const bool whole = std::string(argv[2]) == "whole";
  for (std::string line; std::getline(std::cin, line);) {
    const auto start = std::chrono::steady_clock::now();
    const double gap = whole ? solved_and_certified(solver, validated(source).set)
                             : solved_and_certified(solver, before.set);
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
    fmt::print("{} {}\n", wall.count(), gap);
    std::fflush(stdout);
  }
  return 0;
}
