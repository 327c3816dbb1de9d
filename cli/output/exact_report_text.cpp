#include "cli/output/exact_report_text.hpp"

#include <fmt/format.h>

namespace graybox::cli {

std::string describe_exact(const ExactReport& report) {
  const ExactCertificate& certificate = report.certificate;
  const ExactSolution& solution = report.solution;
  std::string text = fmt::format("{}: {}", report.share.solver, to_string(solution.status));
  if (!solution.message.empty()) text += fmt::format(" ({})", solution.message);
  text += '\n';
  if (certificate.status == CertificateStatus::kCertified) {
    text += fmt::format(
        "  experiments   {} in {} candidates\n"
        "  covariance    {:.10g}; no design of {} experiments is below {:.10g}\n"
        "  D-efficiency  at least {:.8f} of the best exact design\n",
        certificate.experiments, certificate.support_size, certificate.covariance,
        certificate.experiments, certificate.covariance_bound, certificate.proven_efficiency);
  }
  if (solution.survivors > 0) {
    text += fmt::format("  candidates    {} of {} left by screening\n", solution.survivors,
                        report.share.candidates);
  }
  text += fmt::format("  work          {} nodes ({} open), {} iterations, {:.3g} s\n",
                      solution.nodes, solution.open_nodes, solution.iterations, solution.seconds);
  return text;
}

std::string describe_counts(const InformationSet& set, const ExactDesign& design) {
  constexpr std::size_t kShown = 40;
  const CandidateTable& table = set.candidates();
  std::string text = fmt::format("  {:>10} {:>12}", "count", "candidate");
  for (std::size_t k = 0; k < table.names.size(); ++k) {
    const std::string unit = table.units[k].empty() ? "" : " [" + table.units[k] + "]";
    text += fmt::format(" {:>12}", table.names[k] + unit);
  }
  text += '\n';
  std::size_t listed = 0;
  for (std::size_t i = 0; i < design.counts.size(); ++i) {
    if (design.counts[i] == 0 || listed++ >= kShown) continue;
    text += fmt::format("  {:>10} {:>12}", design.counts[i], i);
    for (const double value : set.coordinates(i)) text += fmt::format(" {:>12.6g}", value);
    text += '\n';
  }
  if (listed > kShown) text += fmt::format("  {:>10} and {} more\n", "...", listed - kShown);
  return text;
}

}  // namespace graybox::cli
