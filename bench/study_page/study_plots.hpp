// The pictures of a study: time against Q (the paper's Figure 3), and two kinds of profiles.
//
// Performance profile (Dolan and More 2002): the share of instances on which a solver is at most a
// factor tau slower than the fastest. Data profile (More and Wild 2009, with seconds as the
// budget): the share that it has solved within a time. Both to a checked gap of kProfileGap, over
// all instances but those of the normalisation experiment.
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
