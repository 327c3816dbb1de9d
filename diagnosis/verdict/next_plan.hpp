// The next experiment as plans that `graybox simulate` carries out (graybox-plan/1): one plan for
// each level and band of the design, with the positions that share them.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/hypotheses/next_experiment.hpp"
#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

// Texts of the files. Period, periods and number of excited lines are those of the campaign. The
// flag `has_plant` says that the model is a robot, whose plan names its plant (the non-linear one).
[[nodiscard]] std::vector<std::string> next_plans(const NextExperiment& next,
                                                  const Campaign& campaign, bool has_plant);

// Motions of the design as CSV files, one a share: the time in s and where each channel should be,
// after a comment that says whose motion it is and what share of the time it gets. Empty for
// periodic experiments.
[[nodiscard]] std::vector<std::string> next_motions(const NextExperiment& next);

}  // namespace graybox
