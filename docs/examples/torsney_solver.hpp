// A complete back-end, as small as they come: the multiplicative algorithm (Silvey, Titterington
// and Torsney 1978). docs/how_to/add_a_solver.md shows it; tests/cli/readme_test.cpp runs it.
#pragma once

#include "graybox/solvers/core/solver.hpp"

class TorsneySolver : public graybox::Solver {
 public:
  std::string_view name() const override { return "torsney"; }
  std::string_view description() const override { return "weights times w_i/d, again and again"; }
  graybox::Solution solve(const graybox::InformationSet& set, const graybox::SolveOptions& options,
                          graybox::SolveObserver* observer) const override;
};
