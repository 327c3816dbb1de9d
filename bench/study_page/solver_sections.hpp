// One section of a study's page for each solver: its statuses, its worst instance, its points.
#pragma once

#include <string>
#include <vector>

#include "bench/study_page/page_facts.hpp"

namespace graybox::bench {

// One with what they are about; then, folded, those in the order of facts.solvers.
[[nodiscard]] std::vector<PageSection> solver_sections(const PageFacts& facts);

// "solved 22, numerical_failure 2".
[[nodiscard]] std::string status_words(const std::vector<const ComparedPoint*>& points);

// Which instance went worst, and how badly.
[[nodiscard]] std::string worst_words(const std::vector<const ComparedPoint*>& points);

}  // namespace graybox::bench
