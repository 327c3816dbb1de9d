// What back-ends share that begin from a given design, SolveOptions::start.
//
//   require_start(options.start, set, solver);              // in the registry, for all of them
//   std::vector<double> weights = simplex_start(options.start);
//   ... one pass: the gap of the start itself; it may be small enough ...
//   const double share = uniform_share(gap);                // then weights go to
//   weights_i <- (1 - share) weights_i + share / Q
//
// The share of equal weights is for methods that multiply weights: those of most designs are zero,
// and stay so. How much of it? Let M be the start's information matrix, U that of equal weights,
// and M* the optimum. Since U is positive semidefinite and log det grows with its argument,
//
//   log det((1 - s) M + s U) >= log det M + d log(1 - s).
//
// By weak duality log det M* <= log det M + d log(1 + gap) (certificate.hpp). With
//
//   s = gap / (1 + gap),   d log(1 - s) = -d log(1 + gap),
//
// the mixture gives away no more than the gap leaves open, and nothing where the start is optimal.
// s is at most one half, since a bad start is worth no more than equal weights.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

// Throws InputError where the back-end takes no start, and for weights that are no start: not one
// for each candidate, negative (beyond -1e-6, the rounding of weight_repair.hpp) or no number, or
// all zero.
void require_start(std::span<const double> start, const InformationSet& set, const Solver& solver);

// Negative weights set to zero, and all divided by their sum.
[[nodiscard]] std::vector<double> simplex_start(std::span<const double> start);

[[nodiscard]] double uniform_share(double gap);

// Puts in front of a message that the start was not used, for its information matrix is singular.
[[nodiscard]] std::string without_start(const std::string& message);

}  // namespace graybox
