// A smooth manifold of information matrices over four joint angles, as a robot's are: neighbours
// are nearly equal, so first-order methods crawl.
//
//   H(q) = S F(q) F(q)' S,   F(q) = [A_0 + sum_m (A_m cos(n_m . q) + B_m sin(n_m . q))] /
//   sqrt(2m+1)
//
// with q in [-pi/2, pi/2]^4, eight wave vectors n_m with entries in {-1, 0, 1}, and A, B matrices
// of d x rank standard normal numbers, all drawn once from the seed. S = diag(10^(-c j/(d-1))), j =
// 0
// .. d-1, scales the parameters alike for all candidates; it moves log det and conditioning, but
// not the optimal design.
//
// The angles follow the additive recurrence q_k = pi (frac(u_k + i a^-k) - 1/2) with a^5 = a + 1
// and u from the seed. This is a Kronecker sequence on the generalised golden ratio (Roberts 2018).
// It is evenly spread for every Q, and nested in Q.
#pragma once

#include <cstddef>
#include <cstdint>

#include "problems/information/information_set.hpp"

namespace graybox {

// `rank` is cut to d. `decades` is c above. Cost O(Q d (rank + d)), candidates in parallel.
[[nodiscard]] InformationSet smooth_family(std::size_t candidates, std::size_t dimension,
                                           std::size_t rank, double decades, std::uint64_t seed);

}  // namespace graybox
