// The ways to design an experiment whose candidates form blocks (positions of a robot, each with
// the lines of a spectrum), from the least choice to the most. All of them are designs of the whole
// set, so that their information can be compared:
//
//   flat                 equal weights within a block, D-optimal mixture of blocks
//   blocks_first         the blocks of `flat`, then D-optimal over all candidates of these
//   two_step             D-optimal within each block alone, then D-optimal mixture
//                        (two_step_design)
//   joint                D-optimal over all candidates
//   joint, limited       the same with at most a share of the weight in any block (block_limited)
//
// Each states the certified gap to the optimum of its own kind, and nothing relies on the others.
// The value of log det grows from flat to blocks_first to joint, and from two_step to joint. But
// two_step may fall short of flat, since its inner designs are not made for a mixture.
//
//   const BlockDesign joint = joint_design(set, blocks, {.duality_gap = 1e-6});
//   const double covariance = std::exp(-certify(set, joint.design).log_det / d);
#pragma once

#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/core/candidate_blocks.hpp"
#include "solvers/core/design.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

struct BlockDesign {
  std::string name;    // as above; "joint" with a limit too
  double limit = 1.0;  // on the share of a block
  Design design;       // for every candidate of the set; empty if unsupported
  double own_gap =
      0.0;  // certified, in the problem of its kind; of two_step the larger of both steps
  SolveStatus status = SolveStatus::kNumericalFailure;
  SolveCounters counters;  // passes over the set of its own problem
  std::string message;
};

// Each throws InputError where the blocks do not fit the set, for options out of range and where
// the sum of all matrices is singular. The observer may stop any of them, which leaves the best so
// far with status time_limit.
[[nodiscard]] BlockDesign flat_design(const InformationSet& set, const CandidateBlocks& blocks,
                                      const SolveOptions& options,
                                      SolveObserver* observer = nullptr);
[[nodiscard]] BlockDesign blocks_first_design(const InformationSet& set,
                                              const CandidateBlocks& blocks,
                                              const BlockDesign& flat, const SolveOptions& options,
                                              SolveObserver* observer = nullptr);
[[nodiscard]] BlockDesign two_step_block_design(const InformationSet& set,
                                                const CandidateBlocks& blocks,
                                                const SolveOptions& options,
                                                SolveObserver* observer = nullptr);
// With a limit of 1 or more by column_generation, else by solve_block_limited.
[[nodiscard]] BlockDesign joint_design(const InformationSet& set, const CandidateBlocks& blocks,
                                       const SolveOptions& options, double limit = 1.0,
                                       SolveObserver* observer = nullptr);

}  // namespace graybox
