#include "graybox/solvers/exact/exact_method.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "graybox/problems/error.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/solvers/exact/branch_and_bound.hpp"
#include "graybox/solvers/exact/efficient_rounding.hpp"
#include "graybox/solvers/exact/exact_certificate.hpp"
#include "graybox/solvers/exact/exchange.hpp"
#include "graybox/solvers/exact/rounding.hpp"

namespace graybox {
namespace {

// An upper bound of the largest rank in the set: d as soon as one matrix has it.
std::size_t largest_rank(const InformationSet& set) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd full(d, d);
  Eigen::Index largest = 0;
  for (std::size_t i = 0; i < set.candidate_count() && largest < d; ++i) {
    unpack(set.information(i).data(), set.dimension(), full.data());
    // Rank does not depend on the units of the parameters; the threshold does.
    const Eigen::VectorXd scale = full.diagonal().unaryExpr(
        [](double entry) { return entry > 0.0 ? 1.0 / std::sqrt(entry) : 0.0; });
    const Eigen::MatrixXd unit = scale.asDiagonal() * full * scale.asDiagonal();
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(unit);
    factor.setThreshold(1e-13);
    largest = std::max(largest, factor.rank());
  }
  return static_cast<std::size_t>(largest);
}

}  // namespace

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

void require_exact_problem(const InformationSet& set, const ExactOptions& options) {
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
  const std::size_t d = set.dimension(), rank = largest_rank(set);
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
