// One run of one solver on one set, as the study records it: a line of rows.jsonl.
//
// What happened is a ReportStatus (solvers/report/solve_report.hpp), decided from the process's
// ending, the solver's claim and the checker's certificate of the design it handed back. The claim
// alone never counts. To the verdicts of the checker come those of the fence. It is `time_limit`
// also where the clock of the study had to kill. It is `out_of_memory` above the memory limit or
// where an allocation failed. It is `crashed` where the process ended by a signal or without an
// answer. Every status but `solved` is charged the time limit wherever times are compared.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench/study/process.hpp"
#include "bench/study/stored_design.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::bench {

// What makes two runs the same run: a resumed study skips the runs it finds done.
struct RunKey {
  std::string experiment;  // "scaling", "families", "normalisation", "own"
  std::string problem;     // content hash of the set
  std::string solver;
  double duality_gap = 0.0;
  int repetition = 0;
  int threads = 1;
  std::uint64_t seed = 1;
  double time_limit = 0.0;
  std::size_t memory_limit = 0;
  std::string binary;        // hash of the program that ran
  std::string command;       // of an external program with a name of the user's; else empty
  std::string program = {};  // files_hash() of the command of an external program

  auto operator<=>(const RunKey&) const = default;
};

// When a gap was first reached on the run's own clock.
struct GapReached {
  double seconds = 0.0;
  double passes = 0.0;
};

// Where the set of a row comes from, so that it can be made again. Rows of earlier releases do not
// say it: all is empty.
struct SetOrigin {
  std::string generator;   // of study_sets.hpp; empty for a set of the user's own
  std::uint64_t seed = 0;  // of the generator
  std::string path;        // of an own set, absolute
};

struct RunRow {
  RunKey key;
  std::string family;  // the generator's, or the path of an own set as it was given
  SetOrigin origin;
  std::size_t candidates = 0;
  std::size_t dimension = 0;

  ReportStatus status = ReportStatus::kCrashed;
  std::string claimed;           // the solver's own status; empty if it never answered
  double seconds = 0.0;          // the solver's clock, which stands while a trace is recorded
  double wall_seconds = 0.0;     // around solve(), traces included
  double process_seconds = 0.0;  // start of the program to its end, reading the set included
  double cpu_seconds = 0.0;      // of that process
  double solve_cpu_seconds =
      0.0;                   // of solve() alone, all its threads and programs, traces included
  double duality_gap = 0.0;  // by the checker; infinity without a design
  double rounding_bound = 0.0;
  double log_det = 0.0;
  double passes = 0.0;
  std::int64_t iterations = 0;
  std::size_t support_size = 0;
  std::size_t peak_memory_bytes = 0;      // of the process, program and set included
  std::size_t baseline_memory_bytes = 0;  // the same just before solve()
  double load = 0.0;                      // one-minute load average when it started
  std::string date;                       // UTC, ISO 8601
  std::string message;
  std::map<std::string, GapReached> reached;  // "1e-1" ... "1e-9"; absent where never reached
  std::vector<TracePoint> trace;              // thinned; of the first repetition only
  OwnAccount account;                         // of an external program; its trace thinned likewise
  WeightRepair repair;                        //   "
  StoredDesign design;  // what was certified; rows of earlier releases have none
};

void to_json(nlohmann::json& json, const RunRow& row);
void from_json(const nlohmann::json& json, RunRow& row);

// A point that was not run, and why.
struct SkipRow {
  std::string experiment;
  std::string family;
  std::size_t candidates = 0;
  std::string solver;
  double duality_gap = 0.0;
  std::string reason;
};

void to_json(nlohmann::json& json, const SkipRow& row);
void from_json(const nlohmann::json& json, SkipRow& row);

// What a worker wrote on its standard output (worker.hpp): trace lines, then one answer.
struct WorkerAnswer {
  SolveStatus claimed = SolveStatus::kNumericalFailure;
  bool out_of_memory = false;
  Design design;
  SolveCounters counters;
  double wall_seconds = 0.0;
  double cpu_seconds = 0.0;
  std::size_t peak_memory_bytes = 0;
  std::size_t baseline_memory_bytes = 0;
  std::string message;
  OwnAccount account;
  WeightRepair repair;
};

struct WorkerOutput {
  std::vector<TracePoint> trace;
  std::optional<WorkerAnswer> answer;  // absent if it ended, or was ended, before answering
};

// Lines that are no part of the protocol are passed over. candidate_count sizes the design.
[[nodiscard]] WorkerOutput parse_worker_output(std::string_view output,
                                               std::size_t candidate_count);

// Fills everything the process and its output tell about a run; `row` comes with its key set.
void judge(const InformationSet& set, const ProcessOutcome& outcome, const WorkerOutput& output,
           RunRow& row);

// The status of that name; numerical_failure for one that there is not.
[[nodiscard]] SolveStatus solve_status(std::string_view name);

// The fence first, then the checker.
[[nodiscard]] ReportStatus classify(const ProcessOutcome& outcome,
                                    const std::optional<WorkerAnswer>& answer,
                                    const Certificate& certificate, double asked_gap);

// First times the trace is at or below 1e-1, 1e-2, ..., 1e-9. Levels below the checked gap of the
// final design are left out: a trace is the solver's word.
[[nodiscard]] std::map<std::string, GapReached> gaps_reached(const std::vector<TracePoint>& trace,
                                                             double checked_gap,
                                                             double rounding_bound);

// At most `limit` points, always with the first and the last, evenly spread over those given.
[[nodiscard]] std::vector<TracePoint> thinned(const std::vector<TracePoint>& trace,
                                              std::size_t limit);

}  // namespace graybox::bench
