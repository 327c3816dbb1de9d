// What `graybox solve`, `graybox check` and `graybox exact` print of a design under constraints.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"

namespace graybox::cli {

// The verdict, what was asked, and the constraints that bind with what one more unit is worth.
[[nodiscard]] std::string describe_constrained(const ConstrainedReport& report);

// How much effort each candidate gets, with its coordinates.
[[nodiscard]] std::string describe_efforts(const InformationSet& set,
                                           const ConstrainedReport& report);

// An exact design: the verdict, counts with coordinates, and how the next best compare.
[[nodiscard]] std::string describe_constrained_exact(const InformationSet& set,
                                                     const ConstrainedExactReport& report);

}  // namespace graybox::cli
