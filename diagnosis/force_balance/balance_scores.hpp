// What each hypothesis of a balance of forces would explain of what a fit leaves: a score test of
// the law's columns beside all that the fit has, for each of its shapes (score_test.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// MismatchProblem::scores. Draws of noise follow each other in time as what the model alone leaves
// does. Results do not depend on `threads`.
[[nodiscard]] ScoreTable balance_scores(const BalanceFitter& fitter, const ExtendedFit& fit,
                                        std::span<const std::size_t> asked, int null_draws,
                                        std::uint64_t seed, int threads);

}  // namespace graybox
