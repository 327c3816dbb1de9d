// The study: runs a plan, one process a run, and leaves raw rows, tables and a summary.
//
//   const SolverRegistry registry = make_registry();
//   StudyOptions options{.output = "results/latest", .mode = StudyMode::kQuick};
//   const StudyOutcome outcome = run_study(options, registry, setup);
//
// Written below options.output:
//   rows.jsonl            raw rows: environment, run and skip rows (row_file.hpp)
//   tables/*.csv          derived tables (tables.hpp)
//   summary.md            the same in short, with the environment
//   designs/*.npy         designs with many weights, which rows name (stored_design.hpp)
//   work/*.h5             the sets the runs read; can be deleted
//   rows_of_other_builds.jsonl   what a resumed study found of another build of graybox, of an own
//                         set or a program that has changed since, or of another command by the
//                         same name; not used
//
// Order: every point once, then a second time, and so on, so that the repetitions of one point are
// spread over the whole study and meet the same disturbances as everybody else's. Within a round
// the solvers come in random order (visiting_order). How often a point is repeated follows from its
// first run: as often as fits into limits.point_seconds, at most limits.repetitions times, once if
// it was not solved. In the scaling and normalisation experiments a solver that ran out of time or
// memory at some Q is not tried at a larger one. Nor is it tried on further draws of a family, or
// at a larger d. A skip row says so.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "bench/study/plan.hpp"
#include "bench/study/progress.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/registry.hpp"

namespace graybox::bench {

// What a study needs from outside; the tests put their own here.
struct StudySetup {
  // The set of a family with (at most) that many candidates. "robot" and the families below.
  std::function<InformationSet(const std::string& family, std::size_t candidates)> make_set;
  StudyFamilies families;
  std::vector<std::string> worker;    // command to which worker_arguments() are added
  std::string binary;                 // program_hash() of the worker
  std::function<bool()> interrupted;  // polled; true ends the study cleanly
};

struct StudyOutcome {
  bool interrupted = false;
  std::size_t runs_made = 0;
  std::size_t runs_found = 0;  // done earlier, found on resuming
};

// Earlier rows are refused without options.resume or options.fresh. Throws InputError for bad
// options, before anything runs for an own set that can't be read or is there twice, and where
// nothing can be written.
StudyOutcome run_study(const StudyOptions& options, const SolverRegistry& registry,
                       const StudySetup& setup, Progress& progress);

}  // namespace graybox::bench
