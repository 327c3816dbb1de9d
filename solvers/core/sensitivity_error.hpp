// How far rounding can have moved sensitivities that were computed in double precision: what a
// solver may know of its own gap before the checker looks at it.
//
// M = sum_i lambda_i H_i is summed, factorised, inverted to W and multiplied with each H_i. Let u =
// 2^-53, chains have n operations, and H_i be positive semidefinite. Every rounding error in M, in
// the factors and in the trace is then an error E of M with |E_jk| <= g(n) u sqrt(M_jj M_kk)
// (Higham 2002, chapters 8 and 10). It moves tr(M^-1 H_i), relatively, by at most the size of X E
// X^T, X^T X = W. The errors of different entries are independent of each other: then
//
//   || X E X^T ||  <~  g(n) u sum_j M_jj W_jj,      g(n) = c sqrt(n),  c = 4
//
// (Higham and Mary 2019: a bound of n u in the worst case is one of c sqrt(n) u with all but
// certainty). The sum_j M_jj W_jj of the variance inflation factors is the trace of the inverse of
// the unit-diagonal M. It is d where parameters are uncorrelated, and at most d times the condition
// number. The units of the parameters do not matter.
//
//   if (gap + sensitivity_error(m, inverse.trace_dual(), d, n) <= asked) ...   // claim it
//
// The bound is relative, the same for all candidates; with it max_i w_i / d - 1 is known to within
// sensitivity_error() (1 + gap). Cost O(d).
#pragma once

#include <cstddef>
#include <span>

namespace graybox {

// `information`: M, packed. `trace_dual`: W in trace-dual packing. `support`: terms of M.
[[nodiscard]] double sensitivity_error(std::span<const double> information,
                                       std::span<const double> trace_dual, std::size_t dimension,
                                       std::size_t support);

}  // namespace graybox
