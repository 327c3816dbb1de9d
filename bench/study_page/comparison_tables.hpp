// The tables of a study's page that compare solvers: times to equal accuracy, ratios in pairs, and
// where solvers fail or are slow.
#pragma once

#include <vector>

#include "bench/study_page/page_facts.hpp"

namespace graybox::bench {

[[nodiscard]] PageTable means_table(const std::vector<MeanTime>& means);
[[nodiscard]] PageTable ratios_table(const std::vector<SolverRatio>& ratios);

// Every point that was not solved, the normalisation experiment left out.
[[nodiscard]] PageTable failures_table(const PageFacts& facts);

// Where the solver was not the fastest, and who was; likewise.
[[nodiscard]] PageTable slow_table(const std::string& solver, const PageFacts& facts);

// Both, with what a reader should know about them.
[[nodiscard]] PageSection comparison_section(const std::vector<PointSummary>& points);
[[nodiscard]] PageSection failures_section(const PageFacts& facts);

}  // namespace graybox::bench
