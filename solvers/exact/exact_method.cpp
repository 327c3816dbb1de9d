#include "solvers/exact/exact_method.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "problems/base/error.hpp"
#include "solvers/exact/branch_and_bound.hpp"
#include "solvers/exact/efficient_rounding.hpp"
#include "solvers/exact/exact_certificate.hpp"
#include "solvers/exact/exchange.hpp"
#include "solvers/exact/rounding.hpp"

namespace graybox {
std::string_view to_string(ExactStatus status) {
  switch (status) {
    case ExactStatus::kOptimal:
      return "optimal";
    case ExactStatus::kFeasible:
      return "feasible";
    case ExactStatus::kTimeLimit:
      return "time_limit";
    case ExactStatus::kMemoryLimit:
      return "memory_limit";
    case ExactStatus::kSingular:
      return "singular";
  }
  return "unknown";
}

const std::vector<std::unique_ptr<ExactMethod>>& exact_methods() {
  static const auto methods = [] {
    std::vector<std::unique_ptr<ExactMethod>> all;
    all.push_back(std::make_unique<Rounding>());
    all.push_back(std::make_unique<EfficientRounding>());
    all.push_back(std::make_unique<Exchange>());
    all.push_back(std::make_unique<BranchAndBound>());
    return all;
  }();
  return methods;
}

const ExactMethod& exact_method(std::string_view name) {
  std::string known;
  for (const auto& method : exact_methods()) {
    if (method->name() == name) return *method;
    known += (known.empty() ? "" : ", ") + std::string(method->name());
  }
  throw InputError(fmt::format("method '{}' is unknown; choose one of {}", name, known));
}

void require_exact_options(const ExactOptions& options) {
  if (options.experiments < 1 || options.experiments > kMostExperiments) {
    throw InputError(fmt::format("experiments is {}; it must be a whole number from 1 to {}",
                                 options.experiments, kMostExperiments));
  }
  if (!(options.gap >= 1e-9) || !std::isfinite(options.gap)) {
    throw InputError(fmt::format(
        "gap is {}; it must be a number of at least 1e-9, which double precision can prove",
        options.gap));
  }
  if (!(options.time_limit > 0.0)) {
    throw InputError(fmt::format("time limit is {}; it must be positive", options.time_limit));
  }
  if (options.threads < 1) {
    throw InputError(fmt::format("threads is {}; it must be at least 1", options.threads));
  }
}

void require_exact_problem(const InformationSet& set, const Relaxation& relaxation,
                           const ExactOptions& options) {
  require_exact_options(options);
  const std::size_t d = set.dimension(), rank = relaxation.largest_rank;
  const std::size_t least = (d + rank - 1) / rank;
  if (options.experiments < static_cast<std::int64_t>(least)) {
    throw InputError(fmt::format(
        "{}: {} experiments of rank at most {} can't estimate {} parameters; take at least {}",
        set.name(), options.experiments, rank, d, least));
  }
}

void judge_exact(const InformationSet& set, const Relaxation& relaxation,
                 const ExactOptions& options, ExactSolution& solution) {
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

}  // namespace graybox
