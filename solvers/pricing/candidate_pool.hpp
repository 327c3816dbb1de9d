// CandidatePool: the candidates that one pricing looks at, all of a set or some of them, with their
// sensitivities. Shared by the column generations.
//
//   CandidatePool pool = sample_pool(set.candidate_count(), 4096, random);
//   price_pool(set, inverse, threads, pool);
//   const double gap = pool.largest() / d - 1;
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {

struct CandidatePool {
  std::vector<std::size_t> indices;  // empty for the whole set
  AlignedArray sensitivity;          // at the last pricing
  std::size_t count = 0;
  std::size_t best = 0;  // position of the largest sensitivity

  [[nodiscard]] bool whole() const { return indices.empty(); }
  [[nodiscard]] std::size_t candidate(std::size_t k) const { return whole() ? k : indices[k]; }
  [[nodiscard]] std::span<const double> sensitivities() const {
    return {sensitivity.data(), count};
  }
  [[nodiscard]] double largest() const { return sensitivity[best]; }
};

// `count` candidates, one drawn at random from each of as many equal strata of the order; all of
// them where count is at least `total`.
[[nodiscard]] CandidatePool sample_pool(std::size_t total, std::size_t count, Random& random);

// The candidates of `all` with a value of at least `threshold` in `values` (count numbers), with
// their sensitivities.
[[nodiscard]] CandidatePool pool_above(const CandidatePool& all, std::span<const double> values,
                                       double threshold);

// tr(W H_i) for all candidates of the pool, W in trace-dual packing. One read of their rows. Each
// is computed alone, so that the result does not depend on the number of threads.
void price_pool(const InformationSet& set, std::span<const double> trace_dual, int threads,
                CandidatePool& pool);

// The same for W = M^-1, in the form that the set holds (candidate_pricer.hpp).
void price_pool(const InformationSet& set, const InverseCholesky& inverse, int threads,
                CandidatePool& pool);

// The largest sensitivity above `threshold` of each of `stretches` stretches of their order, the
// best `wanted` of them, as positions, largest first. The stretches, for neighbours on a grid are
// near-duplicates, are shifted at random from call to call.
[[nodiscard]] std::vector<std::size_t> violators(std::span<const double> sensitivities,
                                                 double threshold, std::size_t wanted,
                                                 std::size_t stretches, Random& random);

}  // namespace graybox
