// randomized_exchange: REX of Harman, Filova and Richtarik 2020 (J. Amer. Statist. Assoc. 115),
// carried over from regression vectors to information matrices of any rank.
//
// One iteration prices all candidates once, then works on a subspace without further passes:
//
//   1. leading exchange: Boehning's, between the worst support point and the best candidate;
//   2. active sets: K the support, L the min(4 d, Q) candidates of largest sensitivity;
//   3. for all pairs (l, k) in L x K, in random order: the best exchange between l and k. If the
//      leading exchange was nullifying (emptied one of its two points), only nullifying exchanges
//      are made: weight is first cleared from where it does not belong.
//
// The paper's closed-form step for vectors is replaced by the exact line search of
// log_det_line.hpp; the convergence proof (each iteration gains at least what Boehning's leading
// exchange gains) carries over. Pairs of equal sensitivity, to rounding, are passed over. Random
// numbers come from options.seed alone.
//
// Cost of an iteration: one pass over the set and |L| |K| exchanges of O(d^3) each.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class RandomizedExchange final : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "randomized_exchange"; }
  [[nodiscard]] std::string_view description() const override {
    return "REX: random-order exchanges between the support and the best candidates";
  }
  [[nodiscard]] SolverTraits traits() const override {
    return {.randomised = true, .takes_start = true};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
