// PricedSet: what is known of the sensitivities of a whole set, from passes that are over.
//
//   PricedSet priced(set, threads, random);
//   priced.price(design);                                  // one pass, in the order of the set
//   CandidatePool open = priced.open(later_design, d * (1 + gap));   // few need a second look
//
// The sensitivities are those of the last pass. Each stage of staged_order.hpp has its own bound
// (lazy_bound.hpp), since a pass in stages may improve the design between them.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/column_generation/lazy_bound.hpp"
#include "solvers/column_generation/staged_order.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {

class PricedSet {
 public:
  // Keeps a reference to the set. 8 Q bytes.
  PricedSet(const InformationSet& set, int threads, Random& random);

  // One pass over the whole set.
  void price(const WorkingSet& design);
  // A share of it; to be called for stages 0, 1, ... in turn. Returns how many candidates it read.
  std::size_t price_stage(std::size_t stage, const WorkingSet& design);
  [[nodiscard]] std::size_t stages() const { return order_.stages(); }

  // All candidates with their sensitivities at the last pass.
  [[nodiscard]] const CandidatePool& all() const { return all_; }
  // Those of a stage whose sensitivity is at least `threshold`.
  [[nodiscard]] CandidatePool high(std::size_t stage, double threshold) const;

  // The candidates whose sensitivity at `design` may exceed `level`; all others are certainly at
  // most `level`. Nothing where they are none, or so many that a pass is as fast, or where a pass
  // in stages has not come to its end.
  [[nodiscard]] std::optional<CandidatePool> open(const WorkingSet& design, double level) const;

 private:
  [[nodiscard]] std::size_t count_above(CandidateRun run, double threshold) const;
  void collect(CandidateRun run, double threshold, std::vector<std::size_t>& indices) const;
  [[nodiscard]] CandidatePool pool_of(std::vector<std::size_t> indices) const;

  const InformationSet& set_;
  int threads_;
  StagedOrder order_;
  CandidatePool all_;
  std::vector<LazyBound> bounds_;  // of each stage
};

}  // namespace graybox
