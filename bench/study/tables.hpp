// What a study found, derived from its raw rows as plain structs; summary.hpp writes them as files.
// Times are the solver's clock; every status but solved counts as infinity, or is charged the time
// limit where a member says so.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bench/study/environment.hpp"
#include "bench/study/row_file.hpp"
#include "bench/study/statistics.hpp"

namespace graybox::bench {

inline constexpr std::size_t kFitFrom = 500;  // exponents describe large Q, not start-up costs
inline constexpr double kProfileGap = 1e-6;
inline constexpr const char* kVirtualBest = "virtual best";
inline constexpr const char* kDefaultSolver = "column_generation";
inline constexpr std::array kComparedGaps{1e-3, 1e-6, 1e-9};  // at which times are compared

struct PointSummary {
  std::string experiment;
  std::string family;
  std::size_t candidates = 0;
  std::string solver;
  double gap_asked = 0.0;
  std::size_t repetitions = 0;
  ReportStatus status =
      ReportStatus::kCrashed;  // of the first repetition that is not solved, else solved
  Quartiles seconds;
  double charged_seconds = 0.0;  // the median, or the time limit where not solved
  double checked_gap = 0.0;      // the worst of the repetitions
  double passes = 0.0;           // medians
  double iterations = 0.0;
  double cpu_seconds = 0.0;                      // of the solve, median
  std::optional<double> stated_seconds;          // by an external program's own clock, median
  std::map<std::string, double> stated_reached;  // its own seconds to gaps, of the first repetition
  double repaired = 0.0;            // the largest change that its weights needed, in their sum
  std::size_t support_size = 0;     // of the first
  double peak_memory_bytes = 0.0;   // the largest
  double added_memory_bytes = 0.0;  // median of peak less baseline: what the solve itself took
  std::map<std::string, GapReached> reached;  // medians over repetitions, where all reached it
  std::string message;
};

// In the order in which the points first appear.
[[nodiscard]] std::vector<PointSummary> summarise_points(const std::vector<RunRow>& runs);

struct SolverLaw {
  std::string solver;
  PowerLaw time;                          // of seconds against Q
  std::optional<PowerLaw> per_iteration;  // of seconds / iterations against Q
  std::size_t from = 0, to = 0;
};

// Over the solved points of the scaling experiment with Q >= kFitFrom, at least two of them.
[[nodiscard]] std::vector<SolverLaw> fit_laws(const std::vector<PointSummary>& points);

// Do all certified answers to one problem agree? Each says that the optimum lies in [log_det,
// log_det + d log(1 + gap)], give or take the checker's rounding. So two answers differ by at most
// the sum of their bounds. The `worst_excess` is the largest difference beyond that, over all
// pairs; at most zero if they agree.
struct Agreement {
  std::string family;
  std::size_t candidates = 0;
  std::size_t answers = 0;
  double spread = 0.0;  // of log det among the solved answers
  double worst_excess = 0.0;
  std::string worst_pair;
  [[nodiscard]] bool agrees() const { return worst_excess <= 0.0; }
};
[[nodiscard]] std::vector<Agreement> check_agreement(const std::vector<RunRow>& runs);
// "All certified answers to each of the 24 problems agree within their proven bounds." A problem
// with one answer doesn't count. Where answers disagree, it is said of which problem.
[[nodiscard]] std::string agreement_words(const std::vector<Agreement>& agreements);

// "1 run", "2 runs".
[[nodiscard]] std::string counted(std::size_t count, const std::string& noun);

// What the last start said to be absent, without those of which there are runs.
[[nodiscard]] std::vector<AbsentSolver> absent_of(const StudyRows& rows);

struct Headline {
  std::string name;
  std::string value;  // a number, or words where there is none
  std::string note;
};
// None without points of the scaling experiment, nor about a solver that took no part.
[[nodiscard]] std::vector<Headline> headlines(const std::vector<PointSummary>& points);

// One time for each solver and instance: to this checked gap, infinity if not reached. The passes
// over the set that it took are infinite, too, where a program doesn't tell them. The normalisation
// experiment stays out, and so do the robot's nested subsets wherever anything else was run: they
// are no independent instances.
struct ProfileData {
  std::vector<std::string> solvers;
  std::vector<std::string> instances;
  std::vector<std::vector<double>> times;   // [solver][instance]
  std::vector<std::vector<double>> passes;  // likewise
  std::vector<std::size_t> groups;          // [instance]: its family
};

[[nodiscard]] ProfileData profile_data(const std::vector<PointSummary>& points,
                                       double gap = kProfileGap);

// A solver's times to one gap, all instances together. Instances that it has not solved, or was not
// run on, are charged.
struct MeanTime {
  std::string solver;
  double gap = 0.0;
  std::size_t solved = 0, instances = 0;
  double charge = 0.0;   // ten times the longest time that any solver needed
  double seconds = 0.0;  // geometric mean, shifted by kShift
};
inline constexpr double kShift = 1e-3;  // seconds
// For each of kComparedGaps that someone has reached; the virtual best solver comes first.
[[nodiscard]] std::vector<MeanTime> mean_times(const std::vector<PointSummary>& points);

// Times of one solver over those of another, or of the virtual best.
struct SolverRatio {
  double gap = 0.0;
  std::string solver, against;
  PairedRatio ratio;
};
// For each of kComparedGaps, of all pairs that have solved an instance in common.
[[nodiscard]] std::vector<SolverRatio> solver_ratios(const std::vector<PointSummary>& points);

// Those between any solver and this one, turned so that they say how many times longer the other
// takes.
[[nodiscard]] std::vector<SolverRatio> ratios_against(const std::string& solver,
                                                      const std::vector<SolverRatio>& ratios);

}  // namespace graybox::bench
