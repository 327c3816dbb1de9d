// What a study runs: points (experiment, family, Q, solver, gap) in the order in which they are
// first visited, with the limits each is given.
//
// Five experiments, in the order scaling, normalisation, families, draws, dimensions:
//   scaling        the robot set's nested subsets, every solver, at one gap: time against Q
//   families       every family at full size, every solver, at gap 1e-9: passes and time to gaps
//   normalisation  the dual interior point with and without scaling, on the robot's subsets as they
//                  are and with parameters in units twelve decades apart
//   draws          independent draws of the random families and of the robot's positions, every
//                  solver, at gap 1e-9: instances that are no subsets of one another
//   dimensions     a ladder of d, every solver, at gap 1e-9
//
// or, where the user brings sets, one alone:
//   own            every set as it is, every solver, at one gap
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "solvers/registry.hpp"

namespace graybox::bench {

inline constexpr std::size_t kFullSize = 7920;  // the paper's grid
inline constexpr double kFamilyGap = 1e-9;
inline constexpr std::size_t kDrawSize = 2000;  // Q of draws and of the ladder of d
inline constexpr std::size_t kMostDraws = 10;
inline constexpr std::array<std::size_t, 5> kDimensions{6, 12, 24, 48, 78};

enum class StudyMode { kQuick, kStandard, kFull };

// A solver that the user brings: the program behind it, and its name in rows, tables and figures.
struct NamedProgram {
  std::string name;
  std::string command;  // as after "external:"
};

// A solver that others have and that is not here: said, not passed over.
struct AbsentSolver {
  std::string name;
  std::string needs;
};

struct StudyOptions {
  std::filesystem::path output = "results/latest";
  std::vector<std::string> solvers;    // empty: all in the registry
  std::vector<NamedProgram> programs;  // in the registry, too; they run beside `solvers`
  std::vector<AbsentSolver> absent;    // told beside the results
  std::vector<std::string> sets;       // files of the user's own; not empty: these alone
  std::size_t max_candidates = kFullSize;
  StudyMode mode = StudyMode::kStandard;
  double duality_gap = 1e-6;                // of the scaling experiment and of own sets
  std::optional<double> time_limit;         // seconds a run; otherwise by mode
  std::optional<std::size_t> memory_limit;  // bytes a run; otherwise by mode
  int threads = 1;
  std::uint64_t seed = 1;
  bool resume = false;   // goes on with the rows that are there
  bool fresh = false;    // deletes them
  bool families = true;  // false: the scaling experiment alone
};

// Limits that follow from the mode (or were given).
struct StudyLimits {
  double run_seconds = 0.0;         // the scaling experiment and own sets, a run
  double family_run_seconds = 0.0;  // the other experiments, a run
  std::size_t memory_bytes = 0;     // a run
  int repetitions = 1;              // at most, a point
  double point_seconds = 0.0;       // repetitions stop when a point has used as much
  double budget_seconds = 0.0;      // the whole study; infinite in full
  std::size_t draws = 0;            // of each random family, and of the robot
  std::size_t dimension = 0;        // the largest d of the ladder
};
[[nodiscard]] StudyLimits limits_of(const StudyOptions& options);

// A run is killed this long after its own limit, which it should have kept by itself.
[[nodiscard]] double kill_after(double time_limit);

struct StudyPoint {
  std::string experiment;
  std::string family;
  std::size_t candidates = 0;
  std::string solver;
  double duality_gap = 0.0;
  double time_limit = 0.0;
  bool repeated = true;
  std::string skipped_because;  // not empty: known beforehand not to be run
};

// An own set, as the plan knows it.
struct OwnSetSize {
  std::string path;
  std::size_t candidates = 0;
};

// The families of a study.
struct StudyFamilies {
  std::vector<std::string> whole;       // at full size, besides the robot
  std::vector<std::string> drawn;       // of these there are draws, "wis_draw_3"
  std::vector<std::string> dimensions;  // of these there is a ladder of d, "wis_24"
};

// "wis_draw_3" and "wis_24" are of the family "wis". Any other name is its own family.
struct StudySetName {
  std::string family;
  std::size_t draw = 0;       // 0: no draw
  std::size_t dimension = 0;  // 0: that of the family
};
[[nodiscard]] StudySetName study_set_name(const std::string& name);

// Q of the scaling experiment: 50, 100, 200, 500, 1000, 2000, 4000, 7920, up to the maximum.
[[nodiscard]] std::vector<std::size_t> study_sizes(std::size_t max_candidates);

// Throws InputError for an unknown or unavailable solver, and for limits out of range. Neither the
// robot nor `families` are run where `own` lists any sets.
[[nodiscard]] std::vector<StudyPoint> make_plan(const StudyOptions& options,
                                                const SolverRegistry& registry,
                                                const StudyFamilies& families,
                                                const std::vector<OwnSetSize>& own = {});

// The order in which round `round` visits the points: that of the plan, with the solvers of each
// set shuffled by the seed and the round. In the last three experiments those of all sets together
// are. So no solver always follows the same other one, and sizes of one solver still ascend. It is
// a permutation of 0 .. plan.size() - 1.
[[nodiscard]] std::vector<std::size_t> visiting_order(const std::vector<StudyPoint>& plan,
                                                      std::uint64_t seed, int round);

}  // namespace graybox::bench
