// column_generation: D-optimal design with a handful of passes over the set.
//
// The optimum has few support points (at most p, often 1 to 3 d), so nearly all of the work is to
// find them. The method alternates
//
//   price   w_i = tr(M^-1 H_i) for a pool of candidates, one read of its rows;
//   add     the most violating candidates (w_i > d) to a working set of a few dozen;
//   solve   the design problem on the working set by Newton's method (working_set.hpp);
//
// over growing pools: a stratified sample (solved roughly, from a few multiplicative steps), for
// large sets a larger sample, and then the whole set. Each pass over the whole set yields the gap
// max_i w_i / d - 1 of a design and upper bounds that remove candidates for good (screening.hpp).
// It also yields a short list of those with the largest sensitivities. On these the next rounds run
// to full precision before the set is read again. Of the set, only those candidates are then read
// that the last pass over all of them does not bound (lazy_bound.hpp). It stops when ALL candidates
// are priced or bounded, and claims only what it can know: the gap and the bound on its rounding
// error (sensitivity_error.hpp) together are at most the gap asked for.
//
// Ties and duplicates need care. The first working set is well conditioned
// (well_conditioned_start.hpp), and never made of the largest sensitivities, which may all point
// the same way. A row that is in the working set to the last bit is not added twice. Additions are
// spread over the candidate order, since neighbours on a grid are near-duplicates.
//
// Ill-conditioned sets: where rounding may hide more than a tenth of the gap asked for, the set is
// whitened (conditioned_set.hpp) and solved in those coordinates; well-conditioned ones never pay
// for that. Where the bound is too large there, too, the status is numerical_failure, with the gap
// reached. Where the steps themselves end short of the gap, another method finishes (fallback.hpp),
// and the message says so.
//
// Criteria other than D start from a rough D-optimal design and go on with
// criterion_column_generation.hpp.
//
// The support of a design that is given (SolveOptions::start) is the first working set, with the
// best weights on it (well_conditioned_start.hpp). The first pass over the whole set comes at once.
// A design that is optimal already costs that pass and no more.
//
// A set in factor form (information_set.hpp) is priced, screened, whitened and certified by its
// factors, where the criterion is D. The few matrices of the working set are made one by one. A
// pass costs Q k d^2 flops and reads Q k d numbers. Only the other methods of fallback.hpp need all
// matrices, where there is memory for them.
//
// Cost: 2 Q p flops and one read of the set a pass, of which a few are needed; per Newton step
// n d^3 + n^2 p / 2 + O(n^3) for a working set of n. Memory: 8 Q bytes beyond the set.
// Threads share the passes; each w_i is computed alone, so results do not depend on their number.
#pragma once

#include "solvers/core/solver.hpp"

namespace graybox {

class ColumnGeneration : public Solver {
 public:
  [[nodiscard]] std::string_view name() const override { return "column_generation"; }
  [[nodiscard]] std::string_view description() const override {
    return "Newton on a small working set, few full passes to price all candidates, safe screening";
  }
  [[nodiscard]] SolverTraits traits() const override {
    return {.reachable_gap = 1e-9,
            .memory_exponent = 1,
            .randomised = true,
            .takes_start = true,
            .takes_factors = true,
            .criteria = {CriterionKind::kD, CriterionKind::kA, CriterionKind::kE, CriterionKind::kL,
                         CriterionKind::kDs, CriterionKind::kC, CriterionKind::kI,
                         CriterionKind::kPhiP, CriterionKind::kG, CriterionKind::kCompound}};
  }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer = nullptr) const override;
};

}  // namespace graybox
