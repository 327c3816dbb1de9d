// What rounding and efficient_rounding share. The relaxed weights go in, counts come out. All that
// is proven is the relaxation's bound.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "solvers/exact/exact_method.hpp"

namespace graybox {

[[nodiscard]] ExactSolution solve_by_rounding(
    const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
    std::vector<std::int64_t> (*round)(std::span<const double> weights, std::int64_t experiments));

}  // namespace graybox
