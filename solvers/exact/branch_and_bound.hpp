// branch_and_bound: exact D-optimal designs with proof.
//
//   root       the relaxation over the whole set (column_generation), and a design by exchange;
//   screening  candidates and repetitions that no better design can have go away for good
//              (exact_screening.hpp); the rest, whitened, is the pool: for the robot some tens of
//              7920;
//   tree       best first over boxes of counts. Each node is bounded, shrunk, probed and branched
//              by NodeRelaxation; its rounded point, and the exchange started from it now and then,
//              may be a better design, after which every open node is held to the new threshold.
//
// Threshold. The incumbent is v = log det M(m) and tolerance = d log(1 + gap) (a hundredth less,
// for rounding). Parts of the tree that can't exceed v + tolerance are given up. At any time
//
//   log det M(m*) <= max(v, largest bound of an open node, largest bound of what was given up),
//
// where the last is at most v + tolerance. This maximum is `log_det_bound`, never larger than the
// relaxation's. The run ends as kOptimal when it is within the tolerance of v. Hence V(M lambda*)
// <= V(m*) <= V(m) holds for what is returned, with V(m*) known to a factor 1 + gap.
//
// Threads. The best kBatch open nodes are processed together, against one threshold, and their
// results are merged in order: the tree does not depend on the number of threads. Runs that end by
// proof give the same design, bound and node count for any number of threads, interrupted and
// resumed or not.
//
// Checkpoint. options.checkpoint is written once a minute and at the end (atomically), and read
// back with options.resume: pool, incumbent, bounds and all open nodes (tree_checkpoint.hpp). A
// resumed run starts where the other stopped; it throws InputError if the file belongs to another
// set, M or gap, or is damaged.
//
// Memory: about 16 bytes for each candidate left in each open pair of nodes; above
// options.memory_limit the run ends as kMemoryLimit. Cost: nodes times that of NodeRelaxation.
#pragma once

#include "solvers/exact/exact_method.hpp"

namespace graybox {

class BranchAndBound : public ExactMethod {
 public:
  [[nodiscard]] std::string_view name() const override { return "branch_and_bound"; }
  [[nodiscard]] std::string_view description() const override {
    return "best-first tree with Newton relaxations, safe elimination and strong branching";
  }
  [[nodiscard]] ExactSolution solve(const InformationSet& set, const Relaxation& relaxation,
                                    const ExactOptions& options,
                                    ExactObserver* observer = nullptr) const override;
};

}  // namespace graybox
