#include "graybox/solvers/certificate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "graybox/solvers/criterion_certificate.hpp"
#include "graybox/solvers/extended_information.hpp"

namespace graybox {
namespace {

// The largest sensitivity and how far rounding can have moved it.
void price(const InformationSet& set, const ExtendedInformation& information,
           Certificate& certificate) {
  const auto d = static_cast<Extended>(set.dimension());
  Extended largest = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const Extended sensitivity = information.sensitivity(set.information(i));
    if (sensitivity > largest) {
      largest = sensitivity;
      certificate.worst_candidate = i;
    }
  }
  const Extended delta = information.residual();
  const Extended trace_error = information.trace_unit() *
                               information.magnitude(set.information(certificate.worst_candidate));
  certificate.duality_gap = static_cast<double>(largest / d - 1);
  certificate.rounding_bound =
      static_cast<double>((largest * delta / (1 - delta) + trace_error) / d +
                          std::numeric_limits<double>::epsilon() * std::abs(largest / d - 1));
}

// How many factors the determinant has in which the criterion measures.
double log_det_size(const InformationSet& set, const Criterion& criterion) {
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return static_cast<double>(set.dimension());
    case CriterionKind::kDs:
      return static_cast<double>(criterion.interest().size());
    default:
      return std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace

std::string_view to_string(CertificateStatus status) {
  switch (status) {
    case CertificateStatus::kCertified:
      return "certified";
    case CertificateStatus::kSingular:
      return "singular";
    case CertificateStatus::kNotADesign:
      return "not_a_design";
  }
  return "unknown";
}

Certificate certify(const InformationSet& set, const Design& design, const Criterion& criterion) {
  criterion.require_fits(set);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Certificate certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  certificate.criterion_value = std::numeric_limits<double>::quiet_NaN();
  certificate.dual_repair = std::numeric_limits<double>::quiet_NaN();
  CheckedWeights checked(set, design);
  certificate.support_size = checked.support_size;
  certificate.clipped = checked.clipped;
  certificate.renormalised = checked.renormalised;
  if (!checked.message.empty()) {
    certificate.message = checked.message;
    return certificate;
  }
  const ExtendedInformation information(set, checked.weights, elimination_order(set, criterion));
  if (!information.regular()) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the design's information matrix is singular: it can't estimate all "
        "parameters";
    if (criterion.kind() == CriterionKind::kL || criterion.kind() == CriterionKind::kDs) {
      certificate.message += "; mix in a little of a design that can";
    }
    return certificate;
  }
  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = static_cast<double>(information.log_det());
  if (criterion.kind() == CriterionKind::kD) {
    certificate.criterion_value = certificate.log_det;
    price(set, information, certificate);
  } else {
    price_criterion(set, design, criterion, information, certificate);
  }
  const double gap = std::max(certificate.duality_gap, 0.0);
  certificate.log_det_gap = log_det_size(set, criterion) * std::log1p(gap);
  certificate.efficiency = 1.0 / (1.0 + gap);
  return certificate;
}

double relative_efficiency(const InformationSet& set, const Criterion& criterion, double value,
                           double best_value) {
  switch (criterion.kind()) {
    case CriterionKind::kA:
    case CriterionKind::kL:
      return best_value / value;
    case CriterionKind::kE:
      return value / best_value;
    default:
      return std::exp((value - best_value) / log_det_size(set, criterion));
  }
}

}  // namespace graybox
