// Exact designs under constraints in graybox-design/1 files: the keys of
// constrained_design_file.hpp and of exact_design_file.hpp together,
//
//   "experiments", "counts", "method", "proven_efficiency", "nodes", "open_nodes", "survivors",
//   "request",
//   "designs": [{"counts": [...], "efficiency": ...}, ...]   with --top: best first;
//                                                            efficiency relative to it
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "solvers/constrained/constrained_design_file.hpp"
#include "solvers/constrained_exact/constrained_exact.hpp"

namespace graybox {

// What came of a run, judged by the checker.
struct ConstrainedExactReport {
  ConstrainedExactSolution solution;
  ConstrainedReport share;         // of the best design, as a relaxed one
  double value = 0.0;              // log Phi from extended precision
  double proven_efficiency = 0.0;  // Phi(design) / Phi(best exact design) is at least this
};

[[nodiscard]] ConstrainedExactReport report_constrained_exact(
    const InformationSet& set, const ConstrainedExactOptions& options,
    ConstrainedExactSolution solution, DesignRequest request, DesignConstraints constraints);

// log Phi of a certified design.
[[nodiscard]] double log_phi(const Certificate& certificate, const Criterion& criterion,
                             std::size_t dimension);

// What no design can exceed where one of this value has this efficiency at least, in the units of
// Certificate::criterion_value.
[[nodiscard]] double value_bound(double criterion_value, double efficiency,
                                 const Criterion& criterion, std::size_t dimension);

// Phi of an exact design against the relaxed optimum's, from above: at least this share of the best
// exact design's. Zero where the design is not certified.
[[nodiscard]] double relaxed_efficiency(const InformationSet& set, const ConstrainedReport& report);

[[nodiscard]] nlohmann::ordered_json to_json(const ConstrainedExactReport& report);

// Writes the file in full or not at all. report.share.report.problem_hash must be set.
void write_constrained_exact(const std::string& path, const InformationSet& set,
                             const ConstrainedExactReport& report);

}  // namespace graybox
