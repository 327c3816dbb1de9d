// Designs as JSON, format graybox-design/1:
//
//   {
//     "format": "graybox-design/1",
//     "problem": "set.h5", "problem_hash": "ab34...", "candidates": 7920, "dimension": 12,
//     "solver": "column_generation",
//     "criterion": {"name": "Ds", "interest": [0, 1], "parameters": ["joint_1.gearbox", ...]},
//     "options": {"duality_gap": 1e-09, "time_limit": null, "iteration_limit": 0, "seed": 1,
//                 "threads": 1},
//     "status": "solved", "message": "",
//     "support": [{"index": 41, "weight": 0.25, "candidate": {"q2": -45.0, ...}}, ...],
//     "certificate": {"status": "certified", "duality_gap": ..., "rounding_bound": ...,
//                     "log_det": ..., "log_det_gap": ..., "efficiency": ..., "worst_candidate":
//                     ..., "clipped": ..., "renormalised": ...},
//     "log_det": ..., "counters": {"iterations": ..., "passes": ..., "seconds": ...},
//     "dual_point": [...]
//   }
//
// "criterion" has "interest" for Ds (indices; their names beside them), and "weights" for L, I and
// c (W, packed lower triangle). For phi_p it has "p". For G there is "region": the rows of all J_j
// and how many each point has; none stands for the candidates. A compound criterion has "parts",
// each with its "share" and its own "criterion". Without "criterion" the design is meant for D.
// Criterion E may add "dual_matrix" (E, packed lower triangle), and G "dual_weights" (one a point),
// which certify() makes use of. A design made for more than one information set, or under a limit,
// says so in "objective". This is an object with a "name" ("average", "worst_case",
// "concentration_limit") and what else its maker reports. The entry "limits" states those that the
// checker holds it to (design_limits.hpp). "floors" has, for each floor, its "share" (the least
// efficiency), "criterion" and "multiplier" (efficiency_floor.hpp). Only candidates of non-zero
// weight are listed; indices count from zero; "candidate" holds the coordinates where the set has
// some.
// The "dual_point" of a D-optimal design is W = M^-1 d / max_i tr(M^-1 H_i), a packed lower
// triangle. It obeys the constraints tr(W H_i) <= d of the paper's dual (10). So anybody can check
// with a few lines that no design has a log det M above -log det W, up to the rounding of W in
// double precision. Numbers are written with as many digits as read back exactly (up to 17);
// infinite ones are null.
// A program that writes designs for graybox needs "format" and "support" with "index" and "weight";
// all else is optional on reading. It may add its own account of the run, by its own clock:
//
//   "seconds": 0.31, "trace": [[0.01, 0.5], [0.31, 1e-7]]
//
// that is, [seconds, gap] in order of time; null stands for a gap that is infinite. Where it has no
// "seconds", those of "counters" stand for it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/floors/efficiency_floor.hpp"
#include "solvers/report/design_limits.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox {

inline constexpr std::string_view kDesignFormat = "graybox-design/1";

// What a file says. Its certificate is not read: certify() is the one to ask.
struct DesignFile {
  Design design;             // one weight for each candidate of the set
  std::string solver;        // empty if not stated; likewise:
  std::string problem_hash;  //
  std::string status;        //
  std::string message;       //
  std::optional<double> asked_gap;
  std::optional<Criterion> criterion;
  DesignLimits limits;
  std::vector<EfficiencyFloor> floors;  // with their multipliers
  std::string objective;                // name of the "objective", empty for a plain optimal design
  SolveCounters counters;
  OwnAccount account;
  WeightRepair repair;
};

enum class WeightCheck {
  kStrict,      // weights must form a design: each at least -1e-12, their sum within 1e-9 of 1
  kRepaired,    // the same, but weights that miss it by up to 1e-6 are repaired (weight_repair.hpp)
  kForChecker,  // any finite weights: the caller hands them to certify()
};

// What write_design() writes, for files that say more (exact/exact_design_file.hpp).
[[nodiscard]] nlohmann::ordered_json design_json(const InformationSet& set, const Design& design,
                                                 const SolveReport& report,
                                                 const DesignLimits& limits = {});

// The value of the key "floors": for each floor its "share", "criterion" and "multiplier".
[[nodiscard]] nlohmann::ordered_json floors_json(const InformationSet& set,
                                                 std::span<const EfficiencyFloor> floors);

// Writes the file in full or not at all. report.problem_hash must be set. Throws InputError if the
// file can't be written.
void write_design(const std::string& path, const InformationSet& set, const Design& design,
                  const SolveReport& report, const DesignLimits& limits = {});

// A design under floors, whose certificate is certify_floored()'s.
void write_floored_design(const std::string& path, const InformationSet& set, const Design& design,
                          const SolveReport& report, std::span<const EfficiencyFloor> floors);

// Throws InputError, naming file, field and fix, for anything that is no design of this set. Such
// are: not JSON, another format, a criterion or limits that do not fit the set, the hash of another
// problem. Others are an index out of range or twice, weights that are no numbers or (strict) no
// design. Cost: one SHA-256 pass over the set if the file has a hash.
[[nodiscard]] DesignFile read_design(const std::string& path, const InformationSet& set,
                                     WeightCheck check = WeightCheck::kStrict);

}  // namespace graybox
