// A design as a table to paste and to work through, in the order of run_order.hpp.
//
//   const DesignSchedule schedule = design_schedule(set, design.weights);
//   fmt::print("{}", design_table(set, schedule, TableFormat::kMarkdown));
//
// Columns: `run`, the place in the order; `candidate`, counted from zero; the candidate's
// coordinates, named with their units; `weight` or `count`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/report/run_order.hpp"

namespace graybox {

struct ScheduledRun {
  std::size_t candidate = 0;
  double amount = 0.0;  // weight, or count
};

struct DesignSchedule {
  std::vector<ScheduledRun> runs;  // first to last
  bool has_counts = false;
  RunOrder order = {};  // its length says how far apart they are
};

// Weights that are zero are left out; so are those below `least`.
[[nodiscard]] DesignSchedule design_schedule(const InformationSet& set,
                                             std::span<const double> weights, double least = 0.0);
[[nodiscard]] DesignSchedule design_schedule(const InformationSet& set,
                                             std::span<const std::int64_t> counts);

enum class TableFormat : std::int8_t { kCsv, kMarkdown, kLatex };
// "csv", "markdown", "latex".
[[nodiscard]] std::span<const std::string_view> table_formats();
// Throws InputError for another name.
[[nodiscard]] TableFormat table_format(std::string_view name);

[[nodiscard]] std::string design_table(const InformationSet& set, const DesignSchedule& schedule,
                                       TableFormat format);

// "q2 [deg]".
[[nodiscard]] std::string coordinate_head(const CandidateTable& table, std::size_t k);

}  // namespace graybox
