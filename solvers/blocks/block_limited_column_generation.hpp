// D-optimal design with a limit on the share of each block, for many candidates: for instance no
// more than a tenth of the time in any position of a robot.
//
//   maximise  log det M(lambda)   subject to   lambda >= 0, sum_i lambda_i = 1,
//                                              sum_{i in block b} lambda_i <= c for every block b.
//
// The method is that of column_generation.hpp. A working set of some dozens of candidates is solved
// to high precision (block_limited_working_set.hpp). All candidates are priced with its M and with
// the prices kappa_b of the limits that are reached. A candidate can improve the design where
//
//   w_i - kappa_b(i) > nu = max over the working set of the same,
//
// so the largest of these reduced sensitivities join it. Pools grow from a sample to the whole set;
// after a pass over the whole set the next rounds run on a short list of the largest reduced
// sensitivities. It stops on a pass over all candidates whose gap, as block_limited_certificate.hpp
// defines it, is at most the one asked for. The safe screening of column_generation is not used:
// its rules hold for the simplex.
//
// A limit of 1 or more gives the design without limits. Statuses as in solver.hpp; a set without a
// regular design within the limits is `unsupported`.
//
// A pass costs 2 Q p flops and one read of the set; there are a few passes. A Newton step costs n
// d^3 + n^2 p/2 + n^3/3 for a working set of n, which grows like d + 1/c. This is fit for limits
// down to some thousandths. Memory: 8 Q and 8 n^2 bytes beyond the set and the labels. Results do
// not depend on the number of threads.
//
//   const CandidateBlocks blocks = equal_blocks(set.candidate_count(), 300);
//   const Solution s = solve_block_limited(set, blocks, 0.1, {.duality_gap = 1e-6});
//   const Certificate proof = certify_block_limited(set, s.design, blocks, 0.1);
#pragma once

#include "solvers/core/candidate_blocks.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

// Throws InputError where the blocks do not fit the set, and for a limit that is not positive or
// that leaves no freedom (check_block_limit). It also does for options out of range, and where the
// sum of all matrices is singular.
[[nodiscard]] Solution solve_block_limited(const InformationSet& set, const CandidateBlocks& blocks,
                                           double limit, const SolveOptions& options,
                                           SolveObserver* observer = nullptr);

}  // namespace graybox
