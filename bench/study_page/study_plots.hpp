// The pictures of a study: time against Q (the paper's Figure 3), and profiles of three kinds.
//
// Performance profile (Dolan and More 2002): the share of instances on which a solver is at most a
// factor tau slower than the fastest. Data profiles (More and Wild 2009): the share that it has
// solved within a budget, in seconds, and in passes over the set, which depend on no machine. All
// to a checked gap of kProfileGap, over the instances of profile_data().
#pragma once

#include <vector>

#include "bench/study_page/page_facts.hpp"
#include "diagnosis/report/comparison_plot.hpp"

namespace graybox::bench {

// Those that have data; exponents from `laws` stand beside the names.
[[nodiscard]] std::vector<ComparisonPlot> study_plots(const PageFacts& facts,
                                                      const std::vector<SolverLaw>& laws,
                                                      const ProfileData& profile);

}  // namespace graybox::bench
