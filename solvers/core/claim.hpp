// What a solver that works in double precision may claim of a duality gap.
//
// With the Cholesky factor of M in double precision, u = 2^-53, the computed inverse is exact for
// M + E with |E_ab| <= (d + 1) u sqrt(M_aa M_bb) to first order (Higham 2002, theorem 10.3), so
// that sensitivities are relatively wrong by about
//
//   gap_rounding = 2 d u s,   s = sum_a M_aa (M^-1)_aa
//   (the trace of the inverse of M scaled to unit
//                                                         diagonal, d for a diagonal M),
//
// an estimate, not a bound: the checker alone proves. A solver stops a little below the gap asked,
// by its rounding in the coordinates it works in, so that what it claims is not undone by it. It
// never aims below half of what was asked, which costs little and lets the checker decide. A gap
// smaller than twice the rounding is one that double precision can't know: such a run ends as
// numerical_failure.
//
// s is at least d in any coordinates, so that no solver knows a gap below 2 d^2 u: the registry
// holds every back-end to that.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "solvers/core/solver.hpp"

namespace graybox {

// From M and M^-1, packed; the latter may be in trace-dual packing. O(d).
[[nodiscard]] double gap_rounding(std::span<const double> information,
                                  std::span<const double> inverse, std::size_t dimension);

// The gap at which to stop for the gap asked.
[[nodiscard]] double gap_to_stop_at(double asked, double rounding);

// How a run ends that has stopped there: solved with an empty message, or numerical_failure.
struct Claim {
  SolveStatus status = SolveStatus::kSolved;
  std::string message = {};
};
[[nodiscard]] Claim claim_at(double asked, double rounding);

// Turns a claim that no solver in double precision can know into numerical_failure.
void withdraw_unknowable_claim(std::size_t dimension, double asked_gap, Solution& solution);

}  // namespace graybox
