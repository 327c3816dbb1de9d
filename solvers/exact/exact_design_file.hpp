// Exact designs in graybox-design/1 files (design_file.hpp): the same keys, with weights m_i / M,
// so that whoever reads approximate designs reads these too, and beside them
//
//   "experiments": 20, "counts": [{"index": 41, "count": 3}, ...],
//   "method": "branch_and_bound", "proven_efficiency": ...,
//   "log_det": ..., of sum_i m_i H_i, "log_det_bound": ... of all designs of M experiments,
//   "covariance": ..., "covariance_bound": ..., "nodes": ..., "open_nodes": ...,
//   "survivors": ..., "eliminated": ...,
//   "time_to_efficiency": seconds until 99.5 % was proven, or null
//
// `certificate` is that of the weights. `status` is that of the method: optimal, feasible,
// time_limit, memory_limit or singular.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "solvers/exact/exact_certificate.hpp"
#include "solvers/exact/exact_method.hpp"
#include "solvers/report/solve_report.hpp"

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

// The keys of to_json(SolveReport), of the exact design: `log_det` that of sum_i m_i H_i,
// `duality_gap` its proven loss 1 / efficiency - 1 against the best exact design, `log_det_gap` the
// same in log det, `efficiency` the proven one, `solver` and `status` the method's. Then those
// listed above, and `relaxed_log_det`, `relaxed_duality_gap`, `relaxed_log_det_gap`,
// `relaxed_efficiency`, `relaxed_rounding_bound`: of the weights m / M in the relaxed problem.
[[nodiscard]] nlohmann::ordered_json to_json(const ExactReport& report);

// The list "counts" of a design file: those that are not zero.
[[nodiscard]] nlohmann::ordered_json counts_json(std::span<const std::int64_t> counts);

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

// Throws InputError, naming the field, where counts are no non-negative whole numbers, do not sum
// to `experiments`, or disagree with the weights.
[[nodiscard]] std::optional<ExactClaim> read_exact_claim(const std::string& path,
                                                         const InformationSet& set,
                                                         const Design& weights);

}  // namespace graybox
