// The folder of one case in any motion: model.yaml, and campaign/ with campaign.yaml and run_1.csv
// to run_5.csv, of which the last two are kept out. All cases of a family have files of the same
// names and sizes: numbers are of one width, and lines that only some cases have leave blanks in
// the others.
#pragma once

#include <filesystem>
#include <functional>

#include "bench/any_motion_challenge/any_motion_system.hpp"
#include "bench/challenge/case_truth.hpp"

namespace graybox::bench {

[[nodiscard]] std::string any_motion_campaign_text(const AnyMotionSystem& system);

// Complete, or not there. False where asked to stop. Throws InputError, and UnstableMotion where
// the machine does not move with the effects.
bool write_any_motion_case(const CaseTruth& truth, const std::filesystem::path& folder,
                           const std::function<bool()>& keep_going = {});

}  // namespace graybox::bench
