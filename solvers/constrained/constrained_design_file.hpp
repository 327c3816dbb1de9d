// Designs under constraints in graybox-design/1 files (design_file.hpp): the same keys, with
// weights x_i / sum x, and beside them
//
//   "experiments": sum x,
//   "request": {"experiments": 20, "stock": "1", ..., ...},        as design_request.hpp has it
//   "multipliers": [{"name": ..., "value": a_j . x, "multiplier": y_j}, ...]
//
// `certificate` is the constrained one (constrained_certificate.hpp); log_det is that of the prior
// and all experiments together.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/constrained/design_request.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox {

// What came of a run, judged by the checker.
struct ConstrainedReport {
  SolveReport report;  // its certificate is the constrained one
  ConstrainedCertificate proof;
  std::vector<double> efforts;
  DesignRequest request;
  DesignConstraints constraints;

  [[nodiscard]] double experiments() const;  // sum x
  [[nodiscard]] Design weights() const;      // x / sum x
};

[[nodiscard]] ConstrainedReport judge_constrained(
    const InformationSet& set, std::string_view solver, const SolveOptions& options,
    ConstrainedSolution solution, DesignRequest request, DesignConstraints constraints);

// The keys of to_json(SolveReport), "experiments" and "multipliers".
[[nodiscard]] nlohmann::ordered_json to_json(const ConstrainedReport& report);

// Writes the file in full or not at all. report.report.problem_hash must be set.
void write_constrained_design(const std::string& path, const InformationSet& set,
                              const ConstrainedReport& report);

// What a file asks for; nothing where it was made without constraints.
struct ConstrainedClaim {
  DesignRequest request;
  std::optional<double> experiments;
  std::string constraints_hash;  // empty if not stated
};
[[nodiscard]] std::optional<ConstrainedClaim> read_constrained_claim(const std::string& path);

// The efforts x of a file's weights: those of the experiments that it states, or else of as many as
// the first row allows.
[[nodiscard]] std::vector<double> claimed_efforts(const Design& weights,
                                                  const ConstrainedClaim& claim,
                                                  const DesignConstraints& constraints);

// resolve(), and throws InputError where the files have changed since the design was made.
[[nodiscard]] DesignConstraints resolve(const ConstrainedClaim& claim, const InformationSet& set,
                                        const std::string& path);

}  // namespace graybox
