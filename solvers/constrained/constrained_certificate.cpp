#include "solvers/constrained/constrained_certificate.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/error.hpp"
#include "solvers/certificates/criterion_certificate.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/conditioning/quadruple.hpp"
#include "solvers/constrained/linear_programme.hpp"
#include "solvers/constrained/multiplier_bound.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kUp = 1.0 + 1e-14;  // more than what conversions to double lose

// D is Ds with every parameter of interest.
Criterion as_partial(const InformationSet& set, const Criterion& criterion) {
  if (criterion.kind() != CriterionKind::kD) return criterion;
  std::vector<std::size_t> all(set.dimension());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return Criterion::ds(std::move(all));
}

// The multipliers that complementary slackness gives: w_i = a_i . y of the candidates between their
// limits, over the rows that bind, in the sense of least squares. Empty where nothing is between.
std::vector<double> multipliers_of_design(const DesignConstraints& constraints,
                                          std::span<const double> efforts,
                                          std::span<const double> gains) {
  constexpr double kAtBound = 1e-7;
  std::vector<std::size_t> free, active;
  for (std::size_t i = 0; i < efforts.size(); ++i) {
    const double inside = kAtBound * constraints.largest_effort(i);
    if (efforts[i] > constraints.lower_of(i) + inside &&
        efforts[i] < constraints.upper_of(i) - inside) {
      free.push_back(i);
    }
  }
  for (std::size_t j = 0; j < constraints.rows.size(); ++j) {
    const LinearConstraint& row = constraints.rows[j];
    const double value = row_value(row, efforts);
    const double slack = std::min(value - row.lower, row.upper - value);
    if (slack <= kAtBound * std::max(std::abs(value), 1e-300)) active.push_back(j);
  }
  if (free.empty() || active.empty()) return {};
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(free.size()),
                         static_cast<Eigen::Index>(active.size()));
  Eigen::VectorXd right(static_cast<Eigen::Index>(free.size()));
  for (Eigen::Index k = 0; k < matrix.rows(); ++k) {
    const std::size_t i = free[static_cast<std::size_t>(k)];
    right(k) = gains[i];
    for (Eigen::Index l = 0; l < matrix.cols(); ++l) {
      matrix(k, l) = constraints.rows[active[static_cast<std::size_t>(l)]].coefficients[i];
    }
  }
  const Eigen::VectorXd solution = matrix.completeOrthogonalDecomposition().solve(right);
  std::vector<double> y(constraints.rows.size(), 0.0);
  for (Eigen::Index l = 0; l < solution.size(); ++l) {
    y[active[static_cast<std::size_t>(l)]] = solution(l);
  }
  return y;
}

// The smaller of the bounds that the linear programme's multipliers give, which are known to its
// tolerance, and those of the design.
MultiplierBound<Extended> best_bound(const DesignConstraints& constraints,
                                     std::span<const double> efforts,
                                     std::span<const double> gains) {
  std::vector<double> y = maximise_linear(constraints, {}, gains).multipliers;
  y.resize(constraints.rows.size(), 0.0);
  auto bound = multiplier_bound<Extended>(constraints, {}, gains, y);
  y = multipliers_of_design(constraints, efforts, gains);
  if (y.empty()) return bound;
  auto other = multiplier_bound<Extended>(constraints, {}, gains, y);
  return other.value < bound.value ? other : bound;
}

// What is summed to M: the candidates that are run, and the prior as the last one.
struct Support {
  Support(const InformationSet& set, std::span<const double> efforts,
          const std::vector<double>& prior)
      : matrices(gather(set, efforts, prior)) {}

  InformationSet gather(const InformationSet& set, std::span<const double> efforts,
                        const std::vector<double>& prior) {
    const std::size_t p = set.packed_size();
    std::vector<std::size_t> run;
    for (std::size_t i = 0; i < efforts.size(); ++i) {
      if (efforts[i] > 0.0) run.push_back(i);
    }
    AlignedArray packed((run.size() + (prior.empty() ? 0 : 1)) * p);
    double* out = packed.data();
    for (const std::size_t i : run) {
      out = std::ranges::copy(set.information(i), out).out;
      weights.push_back(efforts[i]);
    }
    if (!prior.empty()) {
      std::ranges::copy(prior, out);
      weights.push_back(1);
    }
    return {set.dimension(), std::move(packed)};
  }

  std::vector<Extended> weights;
  InformationSet matrices;
};

class Checker {
 public:
  Checker(const InformationSet& set, std::span<const double> efforts,
          const DesignConstraints& constraints, const Criterion& criterion)
      : set_(set),
        efforts_(efforts),
        constraints_(constraints),
        criterion_(as_partial(set, criterion)),
        support_(set, efforts, constraints.prior) {}

  // False where M is singular in this arithmetic.
  template <class Real>
  bool check(double violation, ConstrainedCertificate& out);

 private:
  // tr(G H_i) of all matrices of `set` from above, of trace 1 with M.
  template <class Real>
  std::vector<double> gains(const InformationSet& set, const InformationIn<Real>& information,
                            Certificate& certificate) const;

  const InformationSet& set_;
  std::span<const double> efforts_;
  const DesignConstraints& constraints_;
  Criterion criterion_;
  Support support_;
};

template <class Real>
std::vector<double> Checker::gains(const InformationSet& set,
                                   const InformationIn<Real>& information,
                                   Certificate& certificate) const {
  SensitivityBounds bounds;
  bounds.upper.resize(set.candidate_count());
  price_criterion(set, Design{}, criterion_, information, CandidateList(set.candidate_count()),
                  bounds, certificate);
  double scale = static_cast<double>(criterion_.interest().size());
  if (criterion_.kind() != CriterionKind::kDs) {
    const Real eta = information.residual() / (1 - information.residual());
    scale = certificate.criterion_value * (1.0 - static_cast<double>(eta)) / kUp;
  }
  for (double& gain : bounds.upper) gain = kUp * std::max(gain, 0.0) / scale;
  return std::move(bounds.upper);
}

template <class Real>
bool Checker::check(double violation, ConstrainedCertificate& out) {
  Certificate& certificate = out.certificate;
  const InformationIn<Real> information(support_.matrices, support_.weights,
                                        elimination_order(support_.matrices, criterion_));
  if (!information.regular()) return false;
  const std::vector<double> gain = gains(set_, information, certificate);
  double prior_gain = 0.0;
  if (!constraints_.prior.empty()) {
    AlignedArray packed(set_.packed_size());
    std::ranges::copy(constraints_.prior, packed.begin());
    Certificate unused = certificate;
    prior_gain =
        gains(InformationSet(set_.dimension(), std::move(packed)), information, unused).front();
  }
  const MultiplierBound<Extended> bound = best_bound(constraints_, efforts_, gain);
  out.multipliers.assign(bound.multipliers.begin(), bound.multipliers.end());
  certificate.status = CertificateStatus::kCertified;
  certificate.message.clear();
  certificate.log_det = static_cast<double>(information.log_det());
  certificate.worst_candidate = bound.best;
  certificate.duality_gap = static_cast<double>(bound.value + prior_gain - 1);
  double broken = 0.0;
  for (std::size_t j = 0; j < constraints_.rows.size(); ++j) {
    const LinearConstraint& row = constraints_.rows[j];
    const double limit = bound.multipliers[j] > 0 ? row.upper : row.lower;
    if (out.multipliers[j] != 0.0) broken += violation * std::abs(out.multipliers[j] * limit);
  }
  certificate.rounding_bound = static_cast<double>(bound.rounding) + broken +
                               std::numeric_limits<double>::epsilon() * (2.0 + prior_gain);
  return true;
}

Certificate nothing_proven() {
  Certificate certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  certificate.criterion_value = std::numeric_limits<double>::quiet_NaN();
  certificate.dual_repair = std::numeric_limits<double>::quiet_NaN();
  return certificate;
}

// Empty for a design that obeys the constraints.
std::string why_no_design(const InformationSet& set, std::span<const double> efforts,
                          const DesignConstraints& constraints, double& violation) {
  if (efforts.size() != set.candidate_count()) {
    return fmt::format("{} efforts for {} candidates", efforts.size(), set.candidate_count());
  }
  for (std::size_t i = 0; i < efforts.size(); ++i) {
    if (!std::isfinite(efforts[i]) || efforts[i] < -1e-12) {
      return fmt::format("the effort of candidate {} is {:g}", i, efforts[i]);
    }
  }
  violation = largest_violation(constraints, efforts);
  if (violation <= kAllowedViolation) return {};
  for (const LinearConstraint& row : constraints.rows) {
    const double value = row_value(row, efforts);
    if (value > row.upper || value < row.lower) {
      return fmt::format("'{}' is {:.10g}, outside {:g} to {:g}", row.name, value, row.lower,
                         row.upper);
    }
  }
  return "a candidate is run more often, or less, than its limits say";
}

}  // namespace

ConstrainedCertificate certify_constrained(const InformationSet& set,
                                           std::span<const double> efforts,
                                           const DesignConstraints& constraints,
                                           const Criterion& criterion, double asked_gap) {
  criterion.require_fits(set);
  require_fits(constraints, set);
  if (!criterion.has_factor()) {
    throw InputError(
        fmt::format("criterion {} has no certificate under constraints; use D, A, L, I, c or Ds",
                    to_string(criterion.kind())));
  }
  ConstrainedCertificate out{.certificate = nothing_proven()};
  Certificate& certificate = out.certificate;
  certificate.message = why_no_design(set, efforts, constraints, out.violation);
  if (!certificate.message.empty()) return out;
  certificate.support_size =
      static_cast<std::size_t>(std::ranges::count_if(efforts, [](double x) { return x > 0.0; }));
  Checker checker(set, efforts, constraints, criterion);
  if (!checker.check<Extended>(out.violation, out) || !proves(certificate, asked_gap)) {
    ConstrainedCertificate again = out;
    if (checker.check<Quadruple>(out.violation, again) &&
        largest_gap(again.certificate) < largest_gap(certificate)) {
      out = std::move(again);
    }
  }
  if (certificate.status != CertificateStatus::kCertified) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the information matrix is singular: design and prior together can't estimate all "
        "parameters";
    return out;
  }
  state_bounds(log_det_size(set, criterion), certificate);
  return out;
}

}  // namespace graybox
