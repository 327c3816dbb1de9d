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

// The first column is experiments. The next are values of the covariance V = (det sum m_i
// H_i)^(-1/d): of the relaxed optimum (no design is below it), rounding, efficient_rounding,
// exchange and branch_and_bound. The column `bound` is the largest value proven to lie below all
// designs. The proven_efficiency of each method's design is bound / V. The relaxed_efficiency is
// relaxed / branch_and_bound. Then comes whether branch_and_bound is proven optimal (to
// options.gap). The last are survivors of screening, nodes, seconds, seconds until 99.5 % was
// proven, and support. Cells are empty where a method found no regular design. Stops early where
// the user asks to; the lines so far are written. True if every M was done.
[[nodiscard]] bool write_exact_table(const std::string& path, const InformationSet& set,
                                     const std::vector<std::int64_t>& experiments,
                                     ExactOptions options, ExactObserver& observer);

}  // namespace graybox::cli
