// What `graybox exact` and `graybox check` print of an exact design.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/exact/exact_design_file.hpp"

namespace graybox::cli {

// The verdict, a few lines.
[[nodiscard]] std::string describe_exact(const ExactReport& report);

// How often each candidate is run, with its coordinates.
[[nodiscard]] std::string describe_counts(const InformationSet& set, const ExactDesign& design);

}  // namespace graybox::cli
