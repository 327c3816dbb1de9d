// The MismatchProblem of a model file and a campaign, by the model's format and what was recorded.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

struct MismatchProblemOptions {
  int threads = 1;                        // results do not depend on it
  std::function<bool()> keep_going = {};  // asked now and then; false: fits end unusable
  std::vector<std::filesystem::path> place_files = {};  // graybox-places/1 (place_file.hpp)
  std::vector<std::size_t> without_rotors = {};         // joints of a rigid robot, from 0
};

// Throws InputError for files that are missing, wrong or do not belong together. It also does for a
// format that can't be diagnosed, and for recordings that are not sound.
[[nodiscard]] std::unique_ptr<MismatchProblem> load_mismatch_problem(
    const std::filesystem::path& model, const Campaign& campaign,
    const MismatchProblemOptions& options = {});

}  // namespace graybox
