// The tables that a design request (design_request.hpp) names.
#pragma once

#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/design_constraints.hpp"

namespace graybox {

// Q numbers: a candidate coordinate of that name, else a CSV file of one column (a head is
// allowed). `what` begins the messages. Throws InputError.
[[nodiscard]] std::vector<double> candidate_numbers(const InformationSet& set,
                                                    const std::string& name,
                                                    const std::string& path,
                                                    const std::string& what);

// How often each candidate was run: a design file with counts (`graybox exact -o`), or a CSV file
// of lines "index,count" (the count may be missing: once). Throws InputError.
[[nodiscard]] std::vector<double> experiments_done(const InformationSet& set,
                                                   const std::string& path);

// One line a candidate, one column a constraint, heads as "left side <= 6". Throws InputError.
[[nodiscard]] std::vector<LinearConstraint> constraint_table(const InformationSet& set,
                                                             const std::string& path);

}  // namespace graybox
