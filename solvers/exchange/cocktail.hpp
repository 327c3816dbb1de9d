// cocktail: the algorithm of Yu 2011 (Statistics and Computing 21), carried over from regression
// vectors to information matrices of any rank.
//
// One iteration mixes three methods, each of which raises log det M:
//
//   1. vertex direction: a step towards the candidate of largest sensitivity, so that the support
//      finds the points it lacks;
//   2. nearest-neighbour exchanges: support point after support point exchanges weight with the
//      nearest of those that follow it. Neighbours compete for the same weight, which is where
//      multiplicative steps crawl; an exchange empties the weaker in one step;
//   3. a multiplicative step on the support, which adjusts all weights together.
//
// Yu measures nearness between regression vectors; here it is the distance of the information
// matrices, ||S (H_i - H_j) S||_F with S the scaling to unit diagonal of the uniform design's
// information. Line searches are those of log_det_line.hpp.
//
// Cost of an iteration: one pass over the set, n exchanges of O(d^3) and n^2 distances of O(d^2)
// for n support points.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class Cocktail final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "cocktail"; }
  [[nodiscard]] std::string_view description() const override {
    return "vertex direction, nearest-neighbour exchanges and a multiplicative step in turn";
  }
  [[nodiscard]] SolverTraits traits() const override { return {.takes_start = true}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
