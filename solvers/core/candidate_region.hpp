// G over the candidates as a criterion over a region.
//
// Alone, and without constraints, G over the candidates has the designs of D (criterion.hpp).
// Beside other criteria, in a compound or as a floor, it has not: there the candidates are the
// points of a region like any other (prediction_region.hpp).
#pragma once

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox {

// The criterion with the candidates as points wherever it has a G without a region. For all others
// the criterion itself.
[[nodiscard]] Criterion over_candidates(const Criterion& criterion, const InformationSet& set);

}  // namespace graybox
