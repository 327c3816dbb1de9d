// A fit of the search as the gate of physical sanity reads it (plausibility.hpp): names, kinds and
// errors from the catalogue of laws, what only the problem knows from its PhysicalEvidence, if it
// has any.
#pragma once

#include <span>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/hypotheses/physical_evidence.hpp"
#include "diagnosis/plausibility/plausibility.hpp"

namespace graybox {

[[nodiscard]] FittedPhysics fit_physics(const MismatchProblem& problem, const ExtendedFit& fit);

// Without a problem: from its hypotheses and what is known of them.
[[nodiscard]] FittedPhysics fit_physics(std::span<const Hypothesis> hypotheses,
                                        const PhysicalContext& context, const ExtendedFit& fit);

// Nothing where the problem does not know it.
[[nodiscard]] CheckedRange checked_range(const MismatchProblem& problem);

// A parameter that sets the size of the law's force: absent where it is zero.
[[nodiscard]] bool sets_size(const LawParameterEstimate& estimate);

// Whether its error is at most the value; of a phase, an angle or a place, which may be zero,
// whether the error is small.
[[nodiscard]] bool is_determined(const LawParameterEstimate& estimate);

// Whether a law's force is there by its own errors: some parameter that sets its size has an error
// that tells it from zero.
[[nodiscard]] bool excludes_its_absence(const FittedLaw& law);

}  // namespace graybox
