#include "graybox/solvers/exact/rounded_solution.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "graybox/solvers/exact/exact_certificate.hpp"

namespace graybox {

void judge(const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
           ExactSolution& solution) {
  const ExactCertificate certificate =
      certify_exact(set, solution.design, options.experiments, relaxation, solution.log_det_bound);
  if (certificate.status != CertificateStatus::kCertified) {
    solution.status = ExactStatus::kSingular;
    solution.message = certificate.message;
    return;
  }
  solution.status = certificate.proven_efficiency * (1.0 + options.gap) >= 1.0
                        ? ExactStatus::kOptimal
                        : ExactStatus::kFeasible;
  if (certificate.proven_efficiency >= kMarkedEfficiency) {
    solution.seconds_to_mark = std::min(solution.seconds_to_mark, solution.seconds);
  }
}

ExactSolution solve_by_rounding(const InformationSet& set, const Relaxation& relaxation,
                                const ExactOptions& options,
                                std::vector<std::int64_t> (*round)(std::span<const double> weights,
                                                                   std::int64_t experiments)) {
  require_exact_problem(set, options);
  const auto start = std::chrono::steady_clock::now();
  ExactSolution solution;
  solution.design.counts = round(relaxation.weights, options.experiments);
  solution.log_det_bound = relaxation.log_det_bound(options.experiments);
  solution.seconds =
      relaxation.seconds +
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  judge(set, relaxation, options, solution);
  return solution;
}

}  // namespace graybox
