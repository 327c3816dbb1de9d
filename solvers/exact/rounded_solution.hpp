// What rounding and efficient_rounding share: the relaxed weights go in, counts come out, and all
// that is proven is the relaxation's bound.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "graybox/solvers/exact/exact_method.hpp"

namespace graybox {

[[nodiscard]] ExactSolution solve_by_rounding(
    const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
    std::vector<std::int64_t> (*round)(std::span<const double> weights, std::int64_t experiments));

// kOptimal if the proven efficiency is at least 1 / (1 + gap), else kFeasible; kSingular for a
// singular design. Also fills seconds_to_mark where the mark is reached and was not before.
void judge(const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
           ExactSolution& solution);

}  // namespace graybox
