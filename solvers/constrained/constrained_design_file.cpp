#include "solvers/constrained/constrained_design_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/file_message.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json multipliers_json(const ConstrainedReport& report) {
  Json out = Json::array();
  for (std::size_t j = 0; j < report.proof.multipliers.size(); ++j) {
    const LinearConstraint& row = report.constraints.rows[j];
    out.push_back({{"name", row.name},
                   {"value", row_value(row, report.efforts)},
                   {"multiplier", report.proof.multipliers[j]}});
  }
  return out;
}

}  // namespace

double ConstrainedReport::experiments() const {
  return std::accumulate(efforts.begin(), efforts.end(), 0.0);
}

Design ConstrainedReport::weights() const {
  Design design{efforts};
  const double total = experiments();
  for (double& weight : design.weights) weight /= total;
  return design;
}

ConstrainedReport judge_constrained(const InformationSet& set, std::string_view solver,
                                    const SolveOptions& options, ConstrainedSolution solution,
                                    DesignRequest request, DesignConstraints constraints) {
  ConstrainedReport out{.report = report_without_design(set, solver, options, solution.counters),
                        .proof = {},
                        .efforts = std::move(solution.efforts),
                        .request = std::move(request),
                        .constraints = std::move(constraints)};
  SolveReport& report = out.report;
  report.message = solution.message;
  if (solution.status != SolveStatus::kUnsupported && !out.efforts.empty()) {
    out.proof = certify_constrained(set, out.efforts, out.constraints, options.criterion,
                                    options.duality_gap);
    report.certificate = out.proof.certificate;
  }
  report.status = judge(solution.status, options.duality_gap, report.certificate);
  if (report.certificate.status != CertificateStatus::kCertified && report.message.empty()) {
    report.message = report.certificate.message;
  }
  return out;
}

Json to_json(const ConstrainedReport& report) {
  Json out = to_json(report.report);
  if (report.efforts.empty()) return out;
  out["experiments"] = report.experiments();
  out["multipliers"] = multipliers_json(report);
  return out;
}

void write_constrained_design(const std::string& path, const InformationSet& set,
                              const ConstrainedReport& report) {
  Json root = design_json(set, report.weights(), report.report);
  root["experiments"] = report.experiments();
  root["request"] = to_json(report.request, report.constraints, fs::path(path).parent_path());
  root["multipliers"] = multipliers_json(report);
  write_text_file(path, root.dump(1) + "\n");
}

std::optional<ConstrainedClaim> read_constrained_claim(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const Json root = Json::parse(stream, nullptr, false);
  if (!root.is_object() || !root.contains("request")) return std::nullopt;
  try {
    ConstrainedClaim claim;
    claim.request = design_request(root["request"], fs::path(path).parent_path());
    if (root.contains("experiments")) {
      if (!root["experiments"].is_number() || !(root["experiments"].get<double>() > 0.0)) {
        throw InputError("experiments must be a positive number");
      }
      claim.experiments = root["experiments"].get<double>();
    }
    const auto hash = root["request"].find("constraints_hash");
    if (hash != root["request"].end() && hash->is_string()) {
      claim.constraints_hash = hash->get<std::string>();
    }
    return claim;
  } catch (const InputError& error) {
    throw InputError(in_file(path, error.what()));
  }
}

std::vector<double> claimed_efforts(const Design& weights, const ConstrainedClaim& claim,
                                    const DesignConstraints& constraints) {
  std::vector<double> efforts = weights.weights;
  const LinearConstraint& total = constraints.rows.front();
  const double experiments = claim.experiments.value_or(total.upper / row_value(total, efforts));
  for (double& effort : efforts) effort *= experiments;
  return efforts;
}

DesignConstraints resolve(const ConstrainedClaim& claim, const InformationSet& set,
                          const std::string& path) {
  DesignConstraints constraints = resolve(claim.request, set);
  if (!claim.constraints_hash.empty() && claim.constraints_hash != content_hash(constraints)) {
    throw InputError(fmt::format(
        "{}: the files that its request names have changed since it was made; give the request "
        "that it is to be checked against (--request)",
        path));
  }
  return constraints;
}

}  // namespace graybox
