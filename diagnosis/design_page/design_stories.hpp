// What the page of a design tells, for every way in which graybox makes one.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/design_page/design_page.hpp"

namespace graybox {

// A certified design of weights.
[[nodiscard]] DesignStory solve_story(const InformationSet& set, const Design& design,
                                      const SolveReport& report);

// Under constraints. There the sensitivities are tr(G H_i) over the price that the multipliers give
// the candidate; one at its own upper limit may exceed the bound.
[[nodiscard]] DesignStory constrained_story(const InformationSet& set,
                                            const ConstrainedReport& report);

// In whole numbers. The bound is that of fractions, which whole numbers need not keep.
[[nodiscard]] DesignStory exact_story(const InformationSet& set, const ExactReport& report);
[[nodiscard]] DesignStory constrained_exact_story(const InformationSet& set,
                                                  const ConstrainedExactReport& report);

// For several samples of the set at once: prices of the samples, and the D-efficiency under each.
[[nodiscard]] DesignStory robust_story(const std::vector<const InformationSet*>& samples,
                                       const Design& design, const SolveReport& report,
                                       const std::vector<double>& prices,
                                       std::vector<double> efficiencies,
                                       const std::string& objective);

}  // namespace graybox
