// The back-ends of this build, as the tests that run over all of them see them.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "solvers/registry.hpp"

namespace graybox::testing_solvers {

inline constexpr double kGap = 1e-6;

inline const SolverRegistry& registry() {
  static const SolverRegistry all = make_registry();
  return all;
}

inline std::vector<std::string> available_names() {
  std::vector<std::string> names;
  for (const auto& entry : registry().entries()) {
    if (entry.solver != nullptr) names.push_back(entry.name);
  }
  return names;
}

// The gap to ask for: what the solver says it reaches, but not below 1e-6.
inline double target_gap(const Solver& solver) {
  const double reachable = solver.traits().reachable_gap;
  return std::isfinite(reachable) ? std::max(kGap, reachable) : kGap;
}

// Back-ends made for this problem must reach 1e-6 on every set here. NLopt's algorithms are general
// ones and may stop early on hard sets, as may any that does not say it reaches 1e-6; they must be
// honest about it.
inline bool promises_the_gap(const Solver& solver) {
  return solver.traits().reachable_gap <= kGap && !solver.name().starts_with("nlopt_");
}

// Seconds. Those that promise have none: a busy machine fails no test, and a stall ends at the
// back-end's own limit of iterations or at ctest's time, both of which are failures.
inline double time_limit(const Solver& solver) {
  return promises_the_gap(solver) ? std::numeric_limits<double>::infinity() : 0.5;
}

}  // namespace graybox::testing_solvers
