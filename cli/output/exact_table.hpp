// `graybox exact --table`: every method for a list of M, one line of CSV each.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/exact/exact_method.hpp"

namespace graybox::cli {

// "20", "1:100", "1:20,25,30": whole numbers and ranges, separated by commas. Throws InputError.
[[nodiscard]] std::vector<std::int64_t> parse_experiments(std::string_view text);

// Columns: experiments; covariance V = (det sum m_i H_i)^(-1/d) of the relaxed optimum (no design
// is below it), rounding, efficient_rounding, exchange, branch_and_bound, and `bound`, the largest
// value proven to lie below all designs; proven_efficiency of each method's design, bound / V;
// relaxed_efficiency, relaxed / branch_and_bound; whether branch_and_bound is proven optimal (to
// options.gap); survivors of screening, nodes, seconds, seconds until 99.5 % was proven; support.
// Cells are empty where a method found no regular design. Stops early where the user asks to; the
// lines so far are written. True if every M was done.
[[nodiscard]] bool write_exact_table(const std::string& path, const InformationSet& set,
                                     const std::vector<std::int64_t>& experiments,
                                     ExactOptions options, ExactObserver& observer);

}  // namespace graybox::cli
