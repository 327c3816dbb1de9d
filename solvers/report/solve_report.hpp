// SolveReport: what came of a run, judged by the checker. Every program that runs solvers (the
// command, the study) reports through it, so that "solved" means the same everywhere.
//
//   const graybox::Solution answer = solver.solve(set, options);
//   const graybox::SolveReport report = graybox::judge(set, solver.name(), options, answer);
//   if (report.status != graybox::ReportStatus::kSolved) ...
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

enum class ReportStatus : std::int8_t {
  kSolved,            // proven: checked gap + rounding bound <= asked gap, whatever the solver said
  kIterationLimit,    // short of it, as the solver said
  kTimeLimit,         //   "
  kNumericalFailure,  //   ", or the rounding bound keeps the asked gap from being proven
  kUnsupported,       //   "; there is no design
  kInaccurate,        // the solver claimed it, but the checked gap is up to ten times the asked one
  kClaimedButWrong,   // the solver claimed it, but the gap is larger, or the design is none
  kCrashed,           // the process ended by a signal or an error (only where runs are processes)
  kOutOfMemory,       // the memory limit was reached (only where runs are processes)
};
// "solved", "iteration_limit", "time_limit", "numerical_failure", "unsupported", "inaccurate",
// "claimed_but_wrong", "crashed", "out_of_memory".
[[nodiscard]] std::string_view to_string(ReportStatus status);
// The inverse. Throws InputError for another name.
[[nodiscard]] ReportStatus report_status(std::string_view name);

struct SolveReport {
  std::string solver;
  std::string problem;       // name of the set
  std::string problem_hash;  // filled in by whoever needs it: one pass of SHA-256 over the set
  std::size_t candidates = 0;
  std::size_t dimension = 0;
  SolveOptions options;
  ReportStatus status = ReportStatus::kUnsupported;
  std::string message;      // empty, or one line on why the status is what it is
  Certificate certificate;  // of an unsupported problem: infinite gap
  SolveCounters counters;
  std::uint64_t peak_memory_bytes = 0;  // of this process so far; it never falls
  OwnAccount account = {};              // of an external program
  WeightRepair repair = {};             //   "
};

// The verdict on a claim: the rule behind ReportStatus.
[[nodiscard]] ReportStatus judge(SolveStatus claim, double asked_gap,
                                 const Certificate& certificate);

// Certifies the solution and judges it. One pass over the set beyond those of the solver.
[[nodiscard]] SolveReport judge(const InformationSet& set, std::string_view solver,
                                const SolveOptions& options, const Solution& solution);

// What a report says of the set, the run and its cost, before there is a design: the gap is
// infinite.
[[nodiscard]] SolveReport report_without_design(const InformationSet& set, std::string_view solver,
                                                const SolveOptions& options,
                                                const SolveCounters& counters);

// Keys: solver, status, criterion, criterion_value, duality_gap, rounding_bound, log_det,
// log_det_gap, efficiency, seconds, passes, iterations, support_size, peak_memory_bytes, problem,
// problem_hash, candidates, dimension, asked_gap, threads, seed, message. Infinite numbers (a
// singular design's gap) and those that a criterion does not have are null. Of an external program
// also stated_seconds, and "repair" with "clipped" and "rescaled", where there is such a thing.
[[nodiscard]] nlohmann::ordered_json to_json(const SolveReport& report);

// Peak resident memory of this process so far.
[[nodiscard]] std::uint64_t peak_memory_bytes();

}  // namespace graybox
