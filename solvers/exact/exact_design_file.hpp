// Exact designs in graybox-design/1 files (design_file.hpp): the same keys, with weights m_i / M, so
// that whoever reads approximate designs reads these too, and beside them
//
//   "experiments": 20, "counts": [{"index": 41, "count": 3}, ...],
//   "method": "branch_and_bound", "proven_efficiency": ..., "exact_log_det": ..., of sum_i m_i H_i
//   "exact_log_det_bound": ..., "nodes": ..., "open_nodes": ..., "survivors": ..., "eliminated": ...,
//   "time_to_efficiency": seconds until 99.5 % was proven, or null
//
// `status` is that of the method: optimal, feasible, time_limit, memory_limit or singular.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "graybox/solvers/exact/exact_certificate.hpp"
#include "graybox/solvers/exact/exact_method.hpp"
#include "graybox/solvers/solve_report.hpp"

namespace graybox {

// What came of a run, judged by the checker.
struct ExactReport {
  ExactSolution solution;
  ExactCertificate certificate;
  SolveReport share;  // of the weights m / M as an approximate design
};

[[nodiscard]] ExactReport report_exact(const InformationSet& set, const Relaxation& relaxation,
                                       std::string_view method, const ExactOptions& options,
                                       ExactSolution solution);

// The keys of to_json(SolveReport), with `solver` the method and `status` the method's, and those
// listed above.
[[nodiscard]] nlohmann::ordered_json to_json(const ExactReport& report);

// Writes the file in full or not at all. report.share.problem_hash must be set.
void write_exact_design(const std::string& path, const InformationSet& set,
                        const ExactReport& report);

// The exact design that a file holds; nothing where it holds an approximate one.
struct ExactClaim {
  ExactDesign design;
  std::int64_t experiments = 0;
  std::string method;
  std::optional<double> log_det_bound;  // what the file says is proven
};

// Throws InputError, naming the field, where counts are no non-negative whole numbers, do not sum to
// `experiments`, or disagree with the weights.
[[nodiscard]] std::optional<ExactClaim> read_exact_claim(const std::string& path,
                                                         const InformationSet& set,
                                                         const Design& weights);

}  // namespace graybox
