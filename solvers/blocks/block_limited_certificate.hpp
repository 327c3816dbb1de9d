// The certificate of a D-optimal design whose blocks are limited: with the candidates partitioned
// into B blocks, no block gets more than the share c of the weight,
//
//   maximise  log det M(lambda)   subject to   lambda in L = { lambda >= 0,  sum_i lambda_i = 1,
//                                             sum_{i in block b} lambda_i <= c for every b }.   (1)
//
// Bound. For any lambda' in L, by the concavity of log det and of the logarithm,
//
//   log det M' - log det M = log det(M^-1/2 M' M^-1/2) <= d log( tr(M^-1 M') / d ),
//   tr(M^-1 M') = sum_i lambda'_i w_i,      w_i = tr(M^-1 H_i),
//
// so that with  duality_gap = max over lambda' in L of sum_i lambda'_i w_i / d - 1:
//
//   0 <= log det M* - log det M <= d log(1 + duality_gap),
//
// the figures of certificate.hpp with the simplex exchanged for L. lambda itself gives sum_i
// lambda_i w_i = d, so the gap is never negative for a design in L, and lambda is optimal exactly
// where it is zero. The maximum over L is found greedily: blocks in the order of their largest w_i
// get c each, at that candidate, until the weight is spent. With c >= 1 it is the ordinary
// certificate.
//
// Cost O(Q d^2 + B log B), one pass over the set, in extended precision with a bound on its
// rounding.
#pragma once

#include <algorithm>
#include <functional>
#include <span>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/candidate_blocks.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

// A share may exceed the limit by this, as the sum of the weights may differ from one.
inline constexpr double kShareTolerance = 1e-9;

// max over L of sum_i lambda_i w_i from the largest w_i of each block, which are reordered.
template <class Real>
[[nodiscard]] Real largest_limited_mean(std::span<Real> block_maxima, double limit) {
  const auto filled = static_cast<std::size_t>(1.0 / limit) + 1;
  const std::size_t sorted = std::min(block_maxima.size(), filled);
  std::ranges::partial_sort(
      block_maxima, block_maxima.begin() + static_cast<std::ptrdiff_t>(sorted), std::greater<>());
  Real mean = 0, left = 1;
  for (std::size_t k = 0; k < sorted && left > 0; ++k) {
    const Real share = std::min<Real>(limit, left);
    mean += share * block_maxima[k];
    left -= share;
  }
  return mean;
}

// As certify(), for (1); a design that breaks the limit by more than kShareTolerance is
// kNotADesign. worst_candidate is the one with the largest w_i. Throws InputError where the blocks
// do not fit the set, or the limit the blocks.
[[nodiscard]] Certificate certify_block_limited(const InformationSet& set, const Design& design,
                                                const CandidateBlocks& blocks, double limit);

}  // namespace graybox
