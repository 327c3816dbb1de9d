// ChallengeSet: a set of cases that `challenge make` can draw, by name: how it is composed, how a
// case's truth is drawn, and how its folder is written. Sealing, folders, threads and resuming
// (make_challenge.hpp), runs and scores are the same for all sets.
//
//   make_challenge({.origin = ..., .set = &periodic_set(), ...});
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/challenge/case_draw.hpp"

namespace graybox::bench {

struct ChallengeSet {
  std::string name;                            // in challenge.json and the history
  std::size_t all_cases = 0, quick_cases = 0;  // without and with `--quick`
  std::vector<Family> families;
  // As compose_challenge() of case_draw.hpp.
  std::function<std::vector<CaseOutline>(std::size_t cases, std::uint64_t seed,
                                         std::optional<Family> family)>
      compose;
  // As draw_case() of case_draw.hpp.
  std::function<CaseTruth(const CaseOutline& outline, const std::function<bool()>& keep_going)>
      draw;
  // One case's folder, complete. False where asked to stop.
  std::function<bool(const CaseTruth& truth, const std::filesystem::path& folder,
                     const std::function<bool()>& keep_going)>
      write;
};

// Flexible robots and lumped systems under multisines.
[[nodiscard]] const ChallengeSet& periodic_set();

}  // namespace graybox::bench
