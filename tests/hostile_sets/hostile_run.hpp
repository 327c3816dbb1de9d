// Runs every back-end on hostile sets (hostile_sets.hpp) and compares each verdict with 60 digits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "solvers/registry.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::testing_sets {

// Of one back-end at one gap.
struct HostileTally {
  std::size_t verdicts = 0;
  std::size_t solved = 0;
  std::size_t falsely_solved = 0;    // the true gap is above the gap asked
  std::size_t outside_bound = 0;     // the true gap is further from the checked one than its bound
  std::size_t withdrawn_claims = 0;  // claimed by the back-end, refused by the checker
  double seconds = 0.0;
};

struct HostileVerdict {
  std::size_t set = 0;  // in the order of the draw
  std::string kind;
  std::string solver;
  double asked = 0.0;
  ReportStatus status = ReportStatus::kUnsupported;
  double checked_gap = 0.0;
  double rounding_bound = 0.0;
  double true_gap = 0.0;
};

struct HostileDraw {
  std::size_t sets = 0;
  std::size_t refused = 0;  // by validation
  std::size_t verdicts = 0;
  std::map<std::pair<std::string, double>, HostileTally> tally;  // by back-end and gap
  // Sets and gaps that some back-end solved, and those of them that the default did.
  std::size_t solvable = 0;
  std::size_t solved_by_default = 0;
};

// Sets of all kinds in turn until there are `verdicts` verdicts, each back-end at 1e-6 and 1e-9.
// `each` sees every verdict.
[[nodiscard]] HostileDraw run_hostile_sets(
    std::uint64_t seed, std::size_t verdicts,
    const std::function<void(const HostileVerdict&)>& each = {});

// A table, one line a back-end.
[[nodiscard]] std::string describe(const HostileDraw& draw);

}  // namespace graybox::testing_sets
