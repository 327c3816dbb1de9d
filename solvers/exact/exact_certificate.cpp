#include "solvers/exact/exact_certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exact_bounds/whitened_pool.hpp"

namespace graybox {
namespace {

// The first thing that keeps the counts from being a design of M experiments; empty if nothing
// does.
std::string find_fault(const InformationSet& set, const ExactDesign& design,
                       std::int64_t experiments) {
  if (design.counts.size() != set.candidate_count()) {
    return fmt::format("the design has {} counts, the set {} candidates", design.counts.size(),
                       set.candidate_count());
  }
  for (std::size_t i = 0; i < design.counts.size(); ++i) {
    if (design.counts[i] < 0) {
      return fmt::format("count {} is {}; counts must not be negative", i, design.counts[i]);
    }
  }
  const std::int64_t total = design.experiments();
  if (total != experiments || experiments < 1) {
    return fmt::format("the counts sum to {}, not to {} experiments", total, experiments);
  }
  return {};
}

// Extended precision takes the rounding of a rank-deficient sum for information. In coordinates
// where the relaxed optimum is the identity, pivots at the rounding of double are none.
bool well_conditioned(const InformationSet& set, const ExactDesign& design,
                      const Relaxation& relaxation) {
  return InverseCholesky(set.dimension()).factor(whitened_sum(set, relaxation, design.counts));
}

}  // namespace

ExactCertificate certify_exact(const InformationSet& set, const ExactDesign& design,
                               std::int64_t experiments, const Relaxation& relaxation,
                               double log_det_bound) {
  ExactCertificate certificate;
  certificate.message = find_fault(set, design, experiments);
  if (!certificate.message.empty()) return certificate;

  const auto d = static_cast<double>(set.dimension());
  certificate.experiments = experiments;
  certificate.log_det_bound = std::min(log_det_bound, relaxation.log_det_bound(experiments));
  certificate.covariance_bound = std::exp(-certificate.log_det_bound / d);
  const CheckedWeights checked(set, design.weights());
  certificate.support_size = checked.support_size;
  const ExtendedInformation information(set, checked.weights);
  if (!information.regular() || !well_conditioned(set, design, relaxation)) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the design's information matrix is singular: it can't estimate all parameters";
    return certificate;
  }
  certificate.status = CertificateStatus::kCertified;
  const Extended log_m = static_cast<Extended>(d) * std::log(static_cast<Extended>(experiments));
  certificate.log_det = static_cast<double>(information.log_det() + log_m);
  certificate.rounding_bound =
      log_det_rounding(information, set.dimension()) +
      std::numeric_limits<double>::epsilon() * std::abs(certificate.log_det);
  certificate.covariance = std::exp(-certificate.log_det / d);
  if (certificate.log_det - certificate.rounding_bound > certificate.log_det_bound) {
    // This design disproves the bound that came with it.
    certificate.message = "the bound stated is below this design's own log det; it is not used";
    certificate.log_det_bound = relaxation.log_det_bound(experiments);
    certificate.covariance_bound = std::exp(-certificate.log_det_bound / d);
  }
  const double shortfall =
      certificate.log_det_bound - certificate.log_det + certificate.rounding_bound;
  certificate.proven_efficiency = std::exp(-std::max(shortfall, 0.0) / d);
  return certificate;
}

}  // namespace graybox
