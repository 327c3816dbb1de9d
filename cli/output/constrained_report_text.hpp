// What `graybox solve` and `graybox check` print of a design under constraints.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/constrained_design_file.hpp"

namespace graybox::cli {

// The verdict, what was asked, and the constraints that bind with what one more unit is worth.
[[nodiscard]] std::string describe_constrained(const ConstrainedReport& report);

// How much effort each candidate gets, with its coordinates.
[[nodiscard]] std::string describe_efforts(const InformationSet& set,
                                           const ConstrainedReport& report);

}  // namespace graybox::cli
