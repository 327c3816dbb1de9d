#include "solvers/certificates/certificate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "solvers/certificates/criterion_certificate.hpp"
#include "solvers/certificates/sensitivity_sieve.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/conditioning/quadruple.hpp"

namespace graybox {
namespace {

constexpr double kUp = 1.0 + 1e-14;  // more than what conversions to double lose

// The largest sensitivity of the candidates and how far it can be off. Extended precision reads all
// candidates, but takes only those that double precision can't rule out. Each tr(M^-1 H_i) is known
// to within the factors 1/(1 +- residual) and the rounding of its trace.
template <class Real>
void price(const InformationSet& set, const InformationIn<Real>& information,
           const CandidateList& candidates, SensitivityBounds& bounds, Certificate& certificate) {
  using std::abs;
  const Real d(set.dimension()), delta = information.residual(), unit = information.trace_unit(set);
  const auto rounding = static_cast<double>(unit), stretch = static_cast<double>(delta);
  Real largest = 0, highest = 0;
  double floor = -std::numeric_limits<double>::infinity();
  if constexpr (std::is_same_v<Real, Extended>) {
    floor = sieve_sensitivities(set, information, bounds.upper);
  }
  for (std::size_t k = 0; k < candidates.count; ++k) {
    const std::size_t i = candidates[k];
    if (bounds.upper[i] < floor) {
      bounds.upper[i] *= kUp / (1.0 - stretch);
      continue;
    }
    const Real sensitivity = information.sensitivity(set, i);
    if (sensitivity > largest) {
      largest = sensitivity;
      certificate.worst_candidate = i;
    }
    const double error = rounding * information.largest_magnitude(set, i);
    bounds.upper[i] = kUp * (static_cast<double>(sensitivity) + error) / (1.0 - stretch);
    if (bounds.upper[i] > static_cast<double>(highest)) {
      const Real exact = (sensitivity + unit * information.magnitude(set, i)) / (1 - delta);
      highest = std::max<Real>(highest, exact);
    }
  }
  const Real error = unit * information.magnitude(set, certificate.worst_candidate);
  const Real lowest = (largest - error) / (1 + delta);
  bounds.largest = static_cast<double>(lowest) / kUp;
  const Real gap = largest / d - 1;
  certificate.duality_gap = static_cast<double>(gap);
  certificate.rounding_bound =
      static_cast<double>(std::max<Real>(highest - largest, largest - lowest) / d +
                          Real(std::numeric_limits<double>::epsilon()) * abs(gap));
}

// Everything that a regular information matrix tells about the criterion.
template <class Real>
void price_all(const InformationSet& set, const Design& design, const Criterion& criterion,
               const InformationIn<Real>& information, const CandidateList& candidates,
               SensitivityBounds& bounds, Certificate& certificate) {
  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = static_cast<double>(information.log_det());
  bounds.upper.resize(set.candidate_count());
  if (criterion.is_solved_as_d()) {
    price(set, information, candidates, bounds, certificate);
    // The D-optimal designs are those of G, and d its least value (Kiefer and Wolfowitz 1960).
    certificate.criterion_value =
        criterion.kind() == CriterionKind::kG
            ? static_cast<double>(set.dimension()) * (1.0 + certificate.duality_gap)
            : certificate.log_det;
  } else {
    price_criterion(set, design, criterion, information, candidates, bounds, certificate);
  }
}

// True where the rounding bound stands between the gap and what is asked of it.
bool rounding_matters(const Certificate& certificate, double asked_gap) {
  const double gap = certificate.duality_gap, bound = certificate.rounding_bound;
  const bool open = gap - bound <= asked_gap && asked_gap < gap + bound;
  return open || !(bound <= 0.1 * std::max(gap, asked_gap)) || arithmetic_broke(certificate);
}

// The same once more in quadruple precision. `bounds`: of the first pass, empty where M was
// singular.
void price_again(const InformationSet& set, const Design& design, const CheckedWeights& checked,
                 const Criterion& criterion, SensitivityBounds& bounds, Certificate& certificate) {
  const InformationIn<Quadruple> information(set, checked.weights,
                                             elimination_order(set, criterion));
  if (!information.regular()) return;
  const bool was_regular = !bounds.upper.empty();
  std::vector<std::size_t> in_question;
  for (std::size_t i = 0; was_regular && i < set.candidate_count(); ++i) {
    if (!(bounds.upper[i] < bounds.largest)) in_question.push_back(i);
  }
  const CandidateList candidates(was_regular ? in_question.size() : set.candidate_count(),
                                 in_question);
  Certificate again = certificate;
  price_all(set, design, criterion, information, candidates, bounds, again);
  if (was_regular || proves(again, 1.0)) certificate = std::move(again);
}

}  // namespace

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

Certificate certify(const InformationSet& set, const Design& design, const Criterion& criterion,
                    double asked_gap) {
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
  SensitivityBounds bounds;
  const ExtendedInformation information(set, checked.weights, elimination_order(set, criterion));
  if (information.regular()) {
    const CandidateList all(set.candidate_count());
    price_all(set, design, criterion, information, all, bounds, certificate);
  }
  if (criterion.kind() != CriterionKind::kE &&
      (!information.regular() || rounding_matters(certificate, asked_gap))) {
    price_again(set, design, checked, criterion, bounds, certificate);
  }
  if (certificate.status != CertificateStatus::kCertified) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the design's information matrix is singular: it can't estimate all "
        "parameters";
    if (criterion.has_weights() || criterion.kind() == CriterionKind::kDs) {
      certificate.message += "; mix in a little of a design that can";
    }
    return certificate;
  }
  state_bounds(log_det_size(set, criterion), certificate);
  return certificate;
}

bool proves(const Certificate& certificate, double asked_gap) {
  return certificate.status == CertificateStatus::kCertified && !arithmetic_broke(certificate) &&
         certificate.duality_gap + certificate.rounding_bound <= asked_gap;
}

bool arithmetic_broke(const Certificate& certificate) {
  return certificate.status == CertificateStatus::kCertified &&
         !(certificate.duality_gap >= -certificate.rounding_bound);
}

double largest_gap(const Certificate& certificate) {
  return std::max(certificate.duality_gap, 0.0) + certificate.rounding_bound;
}

void state_bounds(double factors, Certificate& certificate) {
  const double gap = largest_gap(certificate);
  certificate.log_det_gap = factors * std::log1p(gap);
  certificate.efficiency = 1.0 / (1.0 + gap);
}

double relative_efficiency(const InformationSet& set, const Criterion& criterion, double value,
                           double best_value) {
  switch (criterion.kind()) {
    case CriterionKind::kE:
      return value / best_value;
    case CriterionKind::kD:
    case CriterionKind::kDs:
      return std::exp((value - best_value) / log_det_size(set, criterion));
    case CriterionKind::kCompound:
      return std::exp(value - best_value);
    default:
      return best_value / value;
  }
}

}  // namespace graybox
