// H -> R H R^T as if computed with twice the digits of double precision and then rounded.
//
// Where H is ill-conditioned, the terms of R H R^T cancel: plain products lose as many digits as
// the condition number of H has. Here each product is split into its rounded value and its rounding
// error exactly (Dekker 1971). Each sum carries the errors of its additions along (Knuth; the
// compensated dot product of Ogita, Rump and Oishi 2005). The relative error is then that of one
// rounding plus about d^2 u^2 times the condition number, u = 1.1e-16.
//
//   twofold_congruence(set.data(), set.candidate_count(), d, r, out.data(), threads);
//
// Cost: about 15 d^3 additions and multiplications a matrix, eight matrices at a time. Each matrix
// is transformed alone: the result does not depend on the number of threads.
#pragma once

#include <cstddef>
#include <span>

namespace graybox {

// `r`: d x d row-major, lower triangular. `in` and `out`: `count` packed matrices each. Magnitudes
// must be within 1e-140 and 1e140. False where it was asked to stop (stop.hpp): `out` is then
// incomplete.
[[nodiscard]] bool twofold_congruence(const double* in, std::size_t count, std::size_t d,
                                      std::span<const double> r, double* out, int threads);

// The factors' part: f -> R f for `count` rows f of d numbers each, rounded once likewise.
// Magnitudes and answer as above.
[[nodiscard]] bool twofold_product(const double* in, std::size_t count, std::size_t d,
                                   std::span<const double> r, double* out, int threads);

}  // namespace graybox
