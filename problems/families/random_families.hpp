// Random information matrices, one independent draw a candidate. All are nested in Q and depend on
// the seed alone (candidate_stream.hpp). Cost O(Q d^2) random numbers, candidates in parallel.
#pragma once

#include <cstddef>
#include <cstdint>

#include "problems/information/information_set.hpp"

namespace graybox {

// H = S W S with W = G G' / n, G of d x n standard normal numbers (a Wishart matrix, mean I), and
// S = diag(s_1, ..., s_d) drawn afresh for each candidate. W is drawn through its Cholesky factor,
// whose entries are independent: the square roots of chi-squared variates of n, n-1, ..., n-d+1
// degrees on the diagonal, standard normal below it (Bartlett 1933).
enum class ScaleDistribution {
  kNone,       // S = I
  kLogNormal,  // s_j = exp(z_j), z_j standard normal
  kDecades,    // s_j = 10^u_j, u_j uniform in [-3, 3]: diagonals of H spread over 12 decades
};
// Throws InputError if degrees < dimension.
[[nodiscard]] InformationSet wishart_family(std::size_t candidates, std::size_t dimension,
                                            std::size_t degrees, ScaleDistribution scale,
                                            std::uint64_t seed);

// H = x x', x = S z, z standard normal in R^d, S as above.
[[nodiscard]] InformationSet rank_one_family(std::size_t candidates, std::size_t dimension,
                                             ScaleDistribution scale, std::uint64_t seed,
                                             SetForm form = SetForm::kMatrices);

// Candidate i is candidate i mod (Q / copies) of log-normal Wishart matrices: every matrix stands
// there `copies` times, bit for bit. Throws InputError unless copies divides Q.
[[nodiscard]] InformationSet duplicated_family(std::size_t candidates, std::size_t copies,
                                               std::size_t dimension, std::uint64_t seed);

}  // namespace graybox
