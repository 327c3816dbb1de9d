#include "cli/output/constrained_report_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "cli/output/console.hpp"
#include "cli/output/exact_report_text.hpp"

namespace graybox::cli {
namespace {

constexpr std::size_t kShown = 10;
constexpr double kNegligible = 1e-7;  // a multiplier times its bound; of an efficiency of one

std::string binding_row(const LinearConstraint& row, double multiplier) {
  const double bound = multiplier > 0.0 ? row.upper : row.lower;
  const char* sign = row.lower == row.upper ? "=" : multiplier > 0.0 ? "<=" : ">=";
  const std::string text = fmt::format("{} {} {:g}", row.name, sign, bound);
  const bool counts = std::abs(bound) >= 1.0 || bound == 0.0;
  return fmt::format("  binds         {:<34} {}: {:+.3g} % efficiency\n", text,
                     counts ? "one more" : "1 % more",
                     counts ? 100.0 * multiplier : multiplier * bound);
}

}  // namespace

std::string describe_constrained(const ConstrainedReport& report) {
  std::string text = describe(report.report);
  if (report.efforts.empty()) return text;
  text += fmt::format("  request       {}\n", describe(report.request));
  std::vector<std::size_t> binding;
  for (std::size_t j = 0; j < report.proof.multipliers.size(); ++j) {
    const LinearConstraint& row = report.constraints.rows[j];
    const double y = report.proof.multipliers[j];
    const double bound = y > 0.0 ? row.upper : row.lower;
    if (std::abs(y) * std::max(std::abs(bound), 1e-9) > kNegligible) binding.push_back(j);
  }
  for (std::size_t k = 0; k < std::min(binding.size(), kShown); ++k) {
    const std::size_t j = binding[k];
    text += binding_row(report.constraints.rows[j], report.proof.multipliers[j]);
  }
  if (binding.size() > kShown) {
    text += fmt::format("                and {} more that bind\n", binding.size() - kShown);
  }
  return text;
}

std::string describe_efforts(const InformationSet& set, const ConstrainedReport& report) {
  std::vector<std::size_t> support;
  for (std::size_t i = 0; i < report.efforts.size(); ++i) {
    if (report.efforts[i] > 0.0) support.push_back(i);
  }
  std::ranges::stable_sort(
      support, [&](std::size_t a, std::size_t b) { return report.efforts[a] > report.efforts[b]; });
  const CandidateTable& table = set.candidates();
  std::string text = fmt::format("  support       {} candidates, {:.6g} experiments\n",
                                 support.size(), report.experiments());
  text += fmt::format("  {:>12} {:>12}", "experiments", "candidate");
  for (std::size_t k = 0; k < table.names.size(); ++k) {
    const std::string unit = table.units[k].empty() ? "" : " [" + table.units[k] + "]";
    text += fmt::format(" {:>12}", table.names[k] + unit);
  }
  text += '\n';
  for (std::size_t rank = 0; rank < std::min(support.size(), kShown); ++rank) {
    const std::size_t i = support[rank];
    text += fmt::format("  {:>12.6g} {:>12}", report.efforts[i], i);
    for (const double value : set.coordinates(i)) text += fmt::format(" {:>12.6g}", value);
    text += '\n';
  }
  if (support.size() > kShown) {
    text += fmt::format("  {:>12} and {} more\n", "...", support.size() - kShown);
  }
  return text;
}

std::string describe_constrained_exact(const InformationSet& set,
                                       const ConstrainedExactReport& report) {
  const ConstrainedExactSolution& solution = report.solution;
  std::string text = fmt::format("branch_and_bound: {}", to_string(solution.status));
  if (!solution.message.empty()) text += fmt::format(" ({})", solution.message);
  text += fmt::format("\n  request       {}\n", describe(report.share.request));
  if (!solution.designs.empty()) {
    const Certificate& certificate = report.share.report.certificate;
    text += fmt::format("  log det M     {:.10g}{}\n", certificate.log_det,
                        report.share.constraints.prior.empty() ? "" : ", earlier trials included");
    const CriterionKind kind = report.share.report.options.criterion.kind();
    if (kind != CriterionKind::kD) {
      text += fmt::format("  {:<12}  {:.10g}\n", name_of_value(kind), certificate.criterion_value);
    }
    text += fmt::format("  {}-efficiency  at least {:.8f} of the best exact design\n",
                        to_string(kind), report.proven_efficiency);
  }
  text += fmt::format("  work          {} nodes ({} open), {} of {} candidates left, {:.3g} s\n",
                      solution.nodes, solution.open_nodes, solution.survivors,
                      report.share.report.candidates, solution.seconds);
  for (std::size_t k = 0; k < solution.designs.size(); ++k) {
    if (solution.designs.size() > 1) {
      text += fmt::format("  design {}: efficiency {:.6f} of the first\n", k + 1,
                          std::exp(solution.designs[k].value - solution.designs.front().value));
    }
    text += describe_counts(set, ExactDesign{solution.designs[k].counts});
  }
  return text;
}

}  // namespace graybox::cli
