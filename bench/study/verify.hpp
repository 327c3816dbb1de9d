// Whether the rows of a study are true, from what they hold: every set is made again, by its
// generator or from its file, and every design is certified again. No solver runs.
//
//   const RowVerification found = verify_rows("results/rows.jsonl", make_study_set);
//   for (const std::string& line : found.lines) print(line);
//   assert(found.holds());
//
// A row is true if its set has the hash that it states and the checker, given its design, finds
//   the gap that it states      within the rounding bounds of both
//   the log det that it states  to 1e-12
//   the support's size
//   the status that follows from the solver's claim and that gap (solve_report.hpp). Runs that were
//   killed, crashed or ran out of time or memory are charged whatever they left, and pass.
// Times, passes, traces and memory are measurements that nobody can repeat exactly: they are not
// looked at.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox::bench {

struct RowVerification {
  std::size_t verified = 0;        // rows found true
  std::size_t false_rows = 0;      // found false
  std::size_t without_set = 0;     // rows whose set can't be made again: unknown
  std::size_t without_design = 0;  // rows of earlier releases, which state a gap alone: unknown
  std::size_t without_answer = 0;  // runs that left no design, and state no gap
  std::size_t unreadable = 0;      // lines that are no rows
  std::vector<std::string> lines;  // one for each false row and for each set that can't be made

  // Every row that holds a design is true, and there is one.
  [[nodiscard]] bool holds() const { return verified > 0 && false_rows == 0 && without_set == 0; }
};

// `make_set` makes the set of a generator with so many candidates (study_sets.hpp). `interrupted`
// is polled between rows; what was found so far is then returned. Throws InputError for a file that
// can't be read. Cost: for each set that of making it, for each row a pass over its set.
[[nodiscard]] RowVerification verify_rows(
    const std::filesystem::path& file,
    const std::function<InformationSet(const std::string& family, std::size_t candidates)>&
        make_set,
    const std::function<bool()>& interrupted = {});

// One line without full stop: "12 rows are true; 1 is false".
[[nodiscard]] std::string describe(const RowVerification& found);

}  // namespace graybox::bench
