#include "solvers/constrained_exact/constrained_exact_file.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "problems/files/atomic_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

void add_exact_keys(const ConstrainedExactReport& report, Json& root) {
  const ConstrainedExactSolution& solution = report.solution;
  root["status"] = to_string(solution.status);
  root["message"] = solution.message;
  root["method"] = "branch_and_bound";
  root["counts"] =
      solution.designs.empty() ? Json::array() : counts_json(solution.designs.front().counts);
  root["proven_efficiency"] = report.proven_efficiency;
  root["efficiency"] = report.proven_efficiency;
  root["nodes"] = solution.nodes;
  root["open_nodes"] = solution.open_nodes;
  root["survivors"] = solution.survivors;
  root["eliminated"] = report.share.report.candidates - solution.survivors;
  if (solution.designs.size() < 2) return;
  for (const RankedDesign& design : solution.designs) {
    root["designs"].push_back(
        {{"counts", counts_json(design.counts)},
         {"efficiency", std::exp(design.value - solution.designs.front().value)}});
  }
}

}  // namespace

double log_phi(const Certificate& certificate, const Criterion& criterion, std::size_t dimension) {
  switch (criterion.kind()) {
    case CriterionKind::kA:
    case CriterionKind::kL:
    case CriterionKind::kC:
    case CriterionKind::kI:
    case CriterionKind::kPhiP:
    case CriterionKind::kG:
      return -std::log(certificate.criterion_value);
    case CriterionKind::kE:
      return std::log(certificate.criterion_value);
    case CriterionKind::kCompound:
      return certificate.criterion_value;
    case CriterionKind::kDs:
      return certificate.criterion_value / static_cast<double>(criterion.interest().size());
    default:
      return certificate.log_det / static_cast<double>(dimension);
  }
}

double value_bound(double criterion_value, double efficiency, const Criterion& criterion,
                   std::size_t dimension) {
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return criterion_value - static_cast<double>(dimension) * std::log(efficiency);
    case CriterionKind::kDs:
      return criterion_value -
             static_cast<double>(criterion.interest().size()) * std::log(efficiency);
    case CriterionKind::kCompound:
      return criterion_value - std::log(efficiency);
    case CriterionKind::kE:
      return criterion_value / efficiency;
    default:
      return criterion_value * efficiency;
  }
}

double relaxed_efficiency(const InformationSet& set, const ConstrainedReport& report) {
  const Criterion& criterion = report.report.options.criterion;
  if (report.report.certificate.status != CertificateStatus::kCertified) return 0.0;
  SolveOptions options;
  options.criterion = criterion;
  const ConstrainedSolution relaxed = solve_constrained(set, report.constraints, options);
  if (relaxed.efforts.empty()) return 0.0;
  const Certificate best =
      certify_constrained(set, relaxed.efforts, report.constraints, criterion).certificate;
  if (best.status != CertificateStatus::kCertified) return 0.0;
  const std::size_t d = set.dimension();
  const double loss = log_phi(best, criterion, d) + std::log1p(largest_gap(best)) -
                      log_phi(report.report.certificate, criterion, d);
  return std::exp(-std::max(loss, 0.0));
}

ConstrainedExactReport report_constrained_exact(const InformationSet& set,
                                                const ConstrainedExactOptions& options,
                                                ConstrainedExactSolution solution,
                                                DesignRequest request,
                                                DesignConstraints constraints) {
  ConstrainedSolution as_relaxed;
  as_relaxed.status =
      solution.designs.empty() ? SolveStatus::kUnsupported : SolveStatus::kTimeLimit;
  as_relaxed.counters = {.iterations = solution.nodes, .passes = 0.0, .seconds = solution.seconds};
  if (!solution.designs.empty()) {
    const auto& counts = solution.designs.front().counts;
    as_relaxed.efforts.assign(counts.begin(), counts.end());
  }
  SolveOptions asked;
  asked.duality_gap = options.gap;
  asked.criterion = options.criterion;
  asked.seed = options.seed;
  asked.threads = options.threads;
  asked.time_limit = options.time_limit;
  ConstrainedExactReport out{
      .solution = std::move(solution),
      .share = judge_constrained(set, "branch_and_bound", asked, std::move(as_relaxed),
                                 std::move(request), std::move(constraints))};
  if (out.solution.designs.empty()) return out;
  const Certificate& certificate = out.share.report.certificate;
  if (certificate.status != CertificateStatus::kCertified) {
    out.solution.status = ExactStatus::kSingular;
    out.solution.message = certificate.message;
    out.solution.designs.clear();
    return out;
  }
  out.value = log_phi(certificate, options.criterion, set.dimension());
  const double bound = std::max(out.solution.value_bound, out.value);
  out.proven_efficiency = std::exp(out.value - bound);
  const bool proven = out.proven_efficiency * (1.0 + options.gap) >= 1.0 - 1e-9;
  if (out.solution.status == ExactStatus::kOptimal && !proven) {
    out.solution.status = ExactStatus::kFeasible;
    out.solution.message = "the search is complete, but rounding hides the last of the gap";
  }
  return out;
}

Json to_json(const ConstrainedExactReport& report) {
  Json out = to_json(report.share);
  add_exact_keys(report, out);
  return out;
}

void write_constrained_exact(const std::string& path, const InformationSet& set,
                             const ConstrainedExactReport& report) {
  Json root = design_json(set, report.share.weights(), report.share.report);
  root["experiments"] = std::llround(report.share.experiments());
  root["request"] = to_json(report.share.request, report.share.constraints,
                            std::filesystem::path(path).parent_path());
  add_exact_keys(report, root);
  write_text_file(path, root.dump(1) + "\n");
}

}  // namespace graybox
