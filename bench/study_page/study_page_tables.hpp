// The tables of a study's page.
#pragma once

#include <string>
#include <vector>

#include "bench/study_page/page_facts.hpp"

namespace graybox::bench {

[[nodiscard]] PageTable points_table(const std::string& caption,
                                     const std::vector<const ComparedPoint*>& points,
                                     bool names_solver);
[[nodiscard]] PageTable solvers_table(const PageFacts& facts, const std::vector<SolverLaw>& laws);
[[nodiscard]] PageTable headlines_table(const std::vector<Headline>& lines);
[[nodiscard]] PageTable agreement_table(const std::vector<Agreement>& agreements);
[[nodiscard]] PageTable absent_table(const std::vector<AbsentSolver>& absent);
[[nodiscard]] PageTable skips_table(const std::vector<SkipRow>& skips);
[[nodiscard]] PageTable environment_table(const StudyRows& rows);

}  // namespace graybox::bench
