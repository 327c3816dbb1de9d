// The files a study leaves besides its raw rows:
//
//   tables/points.csv               one line a point: status, median and quartiles of the time,
//                                   checked gap, passes, iterations, memory
//   tables/fitted_exponents.csv     time = factor Q^exponent over Q >= 500, with 95 % confidence
//   tables/time_to_gap.csv          median time and passes to gaps 1e-1 ... 1e-9
//   tables/own_clock.csv            the same by external programs' own clocks, where they keep one
//   tables/performance_profile.csv  Dolan and More profiles over instances, at kProfileGap
//   tables/profile_instances.csv    the times they are made of (for pairwise comparison)
//   tables/mean_times.csv           shifted geometric means at gaps 1e-3, 1e-6, 1e-9, with what a
//                                   failure is charged, and the virtual best
//   tables/paired_ratios.csv        ratios of times over common instances, with bootstrap intervals
//   tables/agreement.csv            do the certified answers agree within their bounds?
//   tables/headlines.csv            sparse over dense dual, primal and dual crossover
//   tables/skipped.csv              what was not run, and why
//   summary.md                      the same in short, with the environment
#pragma once

#include <filesystem>
#include <string>

#include "bench/study/row_file.hpp"

namespace graybox::bench {

// Writes them below `folder`, each complete or not at all. Returns the text of the summary. Throws
// InputError if the folder can't be written.
std::string write_tables(const StudyRows& rows, const std::filesystem::path& folder);

}  // namespace graybox::bench
