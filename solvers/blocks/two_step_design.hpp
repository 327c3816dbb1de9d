// The design in two steps of Section II of the paper, for candidates in blocks (the lines of a
// spectrum in one position). The first step is the D-optimal design within each block alone. The
// second is the D-optimal mixture of the blocks with these inner designs,
//
//   c_b = argmax log det sum_{i in b} c_i H_i,      tau = argmax log det sum_b tau_b H_b(c_b),
//   lambda_i = tau_b(i) c_i.
//
// It is a feasible design of the whole set, so it is never better than the D-optimal one, whose
// certificate bounds what the two steps lose. The inner designs are the best for a block alone, not
// for a mixture: a mixture may do better with other, even with equal, inner weights.
//
// A block whose matrices have a singular sum has no D-optimal design; it keeps equal weights.
//
//   const TwoStepDesign two = two_step_design(set, equal_blocks(set.candidate_count(), 300), {});
//   const Certificate proof = certify(set, two.design);
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/candidate_blocks.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

// One candidate for each block, H_b = sum_{i in b} c_i H_i. `inner` has a weight for every
// candidate of the set; those of one block must sum to one. Cost: one pass. Results do not depend
// on threads.
[[nodiscard]] InformationSet mixed_blocks(const InformationSet& set, const CandidateBlocks& blocks,
                                          std::span<const double> inner, int threads = 1);

// Equal weights within each block.
[[nodiscard]] std::vector<double> equal_inner_weights(const CandidateBlocks& blocks);

// lambda_i = tau_b(i) c_i.
[[nodiscard]] Design expanded_design(const CandidateBlocks& blocks, std::span<const double> shares,
                                     std::span<const double> inner);

struct TwoStepDesign {
  Design design;                    // lambda, empty where status is unsupported
  std::vector<double> inner;        // c, for every candidate
  Solution mixture;                 // the second step's, on mixed_blocks(); status of the whole
  double largest_inner_gap = 0.0;   // the largest gap of the first step's designs
  std::size_t unsolved_blocks = 0;  // whose design did not reach the gap
  std::size_t singular_blocks = 0;  // that kept equal weights
  double seconds = 0.0;             // wall time of both steps
};

// options.duality_gap is asked of every design. The observer is asked between blocks whether to go
// on; a run that it stops, or that passes the time limit, has status time_limit and, for the blocks
// not reached, equal weights.
[[nodiscard]] TwoStepDesign two_step_design(const InformationSet& set,
                                            const CandidateBlocks& blocks,
                                            const SolveOptions& options,
                                            SolveObserver* observer = nullptr);

}  // namespace graybox
