// Linear functions over the designs of design_constraints.hpp, through Clp (COIN-OR):
//
//   maximise  sum_i g_i x_i   subject to   the constraints.
//
// It tells whether any design obeys the constraints, which of them contradict each other, and the
// multipliers y with which multiplier_bound.hpp bounds the maximum. Nothing else is believed of it.
//
// Cost: that of a simplex method with m rows, a few passes over Q m numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "solvers/constrained/design_constraints.hpp"

namespace graybox {

enum class LinearStatus : std::int8_t { kOptimal, kInfeasible, kStopped };

struct LinearOptimum {
  LinearStatus status = LinearStatus::kStopped;
  std::vector<double> efforts;      // of the candidates listed: a vertex
  std::vector<double> multipliers;  // y, one a row
};

// `candidates`: which of them may be run at all, with their gains in `gains`; empty: all. Those
// that are not listed have x_i = 0, so list all whose lower limit is above zero.
[[nodiscard]] LinearOptimum maximise_linear(const DesignConstraints& constraints,
                                            std::span<const std::size_t> candidates,
                                            std::span<const double> gains);

// For constraints that no design obeys: a set of rows none of which can be left out if they are to
// contradict each other ("at most 3 of group a", "at least 4 of group b"). Empty where the limits
// of single candidates contradict row 0 alone.
[[nodiscard]] std::vector<std::string> contradicting_rows(const DesignConstraints& constraints);

}  // namespace graybox
