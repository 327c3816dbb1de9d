#include "solvers/constrained/constrained_certificate.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "solvers/certificates/criterion_certificate.hpp"
#include "solvers/certificates/dual_bound.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/conditioning/quadruple.hpp"
#include "solvers/constrained/linear_programme.hpp"
#include "solvers/constrained/multiplier_bound.hpp"
#include "solvers/core/candidate_region.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/restricted_problem/criterion_frame.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kUp = 1.0 + 1e-14;  // more than what conversions to double lose

// D is Ds with every parameter of interest, and G without a region is over the candidates.
Criterion as_partial(const InformationSet& set, const Criterion& criterion) {
  if (criterion.kind() != CriterionKind::kD) return over_candidates(criterion, set);
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

std::vector<CriterionPart> parts_of(const Criterion& criterion) {
  std::vector<CriterionPart> parts(criterion.parts().begin(), criterion.parts().end());
  if (parts.empty()) parts.push_back({1.0, criterion});
  return parts;
}

bool is_sharp(const Criterion& criterion) {
  return criterion.kind() == CriterionKind::kG || criterion.kind() == CriterionKind::kE;
}

// What Phi' of G or E is taken at.
struct PartDual {
  std::vector<double> points = {};  // G: mu
  Eigen::MatrixXd factor = {};      // E: Z
};

// What proves most of a design under criteria with G or E among them: for each the weights of the
// points of its region, or a matrix. One sharpness serves all parts.
class SharpDual {
 public:
  SharpDual(const InformationSet& set, std::span<const double> efforts,
            const DesignConstraints& constraints, const Criterion& criterion)
      : set_(set),
        efforts_(efforts),
        constraints_(constraints),
        inverse_(set.dimension()),
        dual_(set.packed_size()),
        gains_(set.candidate_count()) {
    const auto d = static_cast<Eigen::Index>(set.dimension());
    for (const CriterionPart& part : parts_of(criterion)) {
      shares_.push_back(part.share);
      frames_.emplace_back(part.criterion, set.dimension(), std::span<const double>{});
      frames_.back().smooth_by_barrier();
      best_.push_back({.points = std::vector<double>(part.criterion.region().count(), 1.0),
                       .factor = part.criterion.kind() == CriterionKind::kE
                                     ? Eigen::MatrixXd::Identity(d, d)
                                     : Eigen::MatrixXd()});
    }
    std::vector<double> matrix(set.packed_size());
    information_matrix(set, efforts, matrix);
    for (std::size_t k = 0; k < constraints.prior.size(); ++k) matrix[k] += constraints.prior[k];
    if (inverse_.factor(matrix)) search();
  }

  [[nodiscard]] const std::vector<PartDual>& parts() const { return best_; }

 private:
  // The gap at sharpness exp(log_sharpness), in double precision.
  double gap(double log_sharpness) {
    std::ranges::fill(dual_, 0.0);
    for (std::size_t part = 0; part < frames_.size(); ++part) {
      CriterionFrame& frame = frames_[part];
      frame.set_sharpness(std::exp(log_sharpness));
      frame.compute(inverse_);
      const double scale = shares_[part] * frame.smoothing_factor();
      for (std::size_t k = 0; k < dual_.size(); ++k) dual_[k] += scale * frame.trace_dual()[k];
    }
    const auto trace = [&](std::span<const double> h) {
      return std::inner_product(h.begin(), h.end(), dual_.begin(), 0.0);
    };
    for (std::size_t i = 0; i < gains_.size(); ++i) gains_[i] = trace(set_.information(i));
    std::vector<double> y = multipliers_of_design(constraints_, efforts_, gains_);
    if (y.empty()) y = maximise_linear(constraints_, {}, gains_).multipliers;
    y.resize(constraints_.rows.size(), 0.0);
    const double here = trace(constraints_.prior) +
                        multiplier_bound<double>(constraints_, {}, gains_, y).value - 1.0;
    if (here < least_) {
      least_ = here;
      at_ = log_sharpness;
      for (std::size_t part = 0; part < frames_.size(); ++part) keep(frames_[part], best_[part]);
    }
    return here;
  }

  static void keep(const CriterionFrame& frame, PartDual& dual) {
    if (!dual.points.empty()) dual.points = frame.point_weights();
    if (dual.factor.size() == 0) return;
    dual.factor = frame.axes().transpose() * frame.shares().cwiseSqrt().asDiagonal();
  }

  // A grid, then golden sections about its best point.
  void search() {
    constexpr double kMost = 28.0, kStep = 0.4, kGolden = 0.6180339887498949;
    for (double at = 0.0; at <= kMost; at += kStep) gap(at);
    double low = at_ - kStep, high = at_ + kStep;
    double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    double left_gap = gap(left), right_gap = gap(right);
    for (int k = 0; k < 40; ++k) {
      if (left_gap < right_gap) {
        high = right;
        right = left;
        right_gap = left_gap;
        left = high - kGolden * (high - low);
        left_gap = gap(left);
      } else {
        low = left;
        left = right;
        left_gap = right_gap;
        right = low + kGolden * (high - low);
        right_gap = gap(right);
      }
    }
  }

  const InformationSet& set_;
  std::span<const double> efforts_;
  const DesignConstraints& constraints_;
  std::vector<double> shares_;
  std::vector<CriterionFrame> frames_;
  std::vector<PartDual> best_;
  InverseCholesky inverse_;
  std::vector<double> dual_, gains_;
  double least_ = kInfinity, at_ = 0.0;
};

class Checker {
 public:
  Checker(const InformationSet& set, std::span<const double> efforts,
          const DesignConstraints& constraints, const Criterion& criterion)
      : set_(set),
        efforts_(efforts),
        constraints_(constraints),
        criterion_(as_partial(set, criterion)),
        support_(set, efforts, constraints.prior) {
    const auto is_sharp_part = [](const CriterionPart& part) { return is_sharp(part.criterion); };
    const std::vector<CriterionPart> parts = parts_of(criterion_);
    duals_.resize(parts.size());
    if (std::ranges::none_of(parts, is_sharp_part)) return;
    duals_ = SharpDual(set, efforts, constraints, criterion_).parts();
  }

  // False where M is singular in this arithmetic.
  template <class Real>
  bool check(double violation, ConstrainedCertificate& out);

 private:
  // Z and what is known of it for all parts of a criterion without factor (dual_bound.hpp), joined.
  template <class Real>
  DualBound<Real> joint_bound(const InformationIn<Real>& information) const;
  // tr(Z Z^T H_i) from above.
  template <class Real>
  std::vector<double> prices(const InformationSet& set, const DualBound<Real>& bound) const;
  // tr(G H_i) of all matrices of `set` from above, of trace 1 with M.
  template <class Real>
  std::vector<double> gains(const InformationSet& set, const InformationIn<Real>& information,
                            Certificate& certificate) const;

  const InformationSet& set_;
  std::span<const double> efforts_;
  const DesignConstraints& constraints_;
  Criterion criterion_;
  Support support_;
  std::vector<PartDual> duals_;  // of G and E, one a part
};

template <class Real>
DualBound<Real> Checker::joint_bound(const InformationIn<Real>& information) const {
  using std::sqrt;
  const std::size_t d = set_.dimension();
  const std::vector<CriterionPart> parts = parts_of(criterion_);
  DualBound<Real> joint;
  joint.z.resize(static_cast<Eigen::Index>(d), 0);
  joint.scale = 1;
  for (std::size_t at = 0; at < parts.size(); ++at) {
    const CriterionPart& part = parts[at];
    const std::vector<std::size_t> order = elimination_order(set_, part.criterion);
    DualBound<Real> bound =
        order.empty() ? dual_bound(part.criterion, d, information, duals_[at].points)
                      : dual_bound(part.criterion, d,
                                   InformationIn<Real>(support_.matrices, support_.weights, order));
    if (part.criterion.kind() == CriterionKind::kE) {
      bound.z = duals_[at].factor.template cast<Real>();
      bound.scale *= bound.z.squaredNorm();
      bound.error += static_cast<Real>(2 * d * d + 8) * (std::numeric_limits<Real>::epsilon() / 2);
    }
    const Eigen::Index before = joint.z.cols();
    joint.z.conservativeResize(Eigen::NoChange, before + bound.z.cols());
    joint.z.rightCols(bound.z.cols()) = sqrt(Real(Real(part.share) / bound.scale)) * bound.z;
    joint.error = std::max<Real>(joint.error, bound.error);
    joint.log_phi += Real(part.share) * bound.log_phi;
  }
  // Shares of sum one but for their rounding, in double precision.
  const Real shares = parts.size() > 1 ? Real(parts.size() + 1) * Real(1.2e-16) : Real(0);
  joint.error = std::min<Real>(
      joint.error + shares + 8 * (std::numeric_limits<Real>::epsilon() / 2), Real(0.5));
  return joint;
}

template <class Real>
std::vector<double> Checker::prices(const InformationSet& set, const DualBound<Real>& bound) const {
  using std::abs;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  const Matrix product = bound.z * bound.z.transpose();
  const Matrix size = bound.z.cwiseAbs() * bound.z.cwiseAbs().transpose();
  std::vector<Real> dual, magnitude;
  for (Eigen::Index i = 0; i < product.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      dual.push_back(i == j ? product(i, i) : Real(product(i, j) + product(j, i)));
      magnitude.push_back(i == j ? size(i, i) : Real(2 * size(i, j)));
    }
  }
  const auto terms = static_cast<Real>(dual.size() + 2 * set.dimension() +
                                       static_cast<std::size_t>(bound.z.cols()) + 4);
  const Real unit = terms * (std::numeric_limits<Real>::epsilon() / 2);
  std::vector<double> out(set.candidate_count());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto h = set.information(i);
    Real w = 0, rounding = 0;
    for (std::size_t k = 0; k < h.size(); ++k) {
      w += dual[k] * h[k];
      rounding += magnitude[k] * abs(h[k]);
    }
    const Real highest = std::max<Real>(Real(w + unit * rounding), Real(0)) / (1 - bound.error);
    out[i] = kUp * static_cast<double>(highest);
  }
  return out;
}

template <class Real>
std::vector<double> Checker::gains(const InformationSet& set,
                                   const InformationIn<Real>& information,
                                   Certificate& certificate) const {
  if (!criterion_.has_factor()) {
    using std::exp;
    const DualBound<Real> bound = joint_bound(information);
    const int sign = criterion_.kind() == CriterionKind::kE ? 1 : -1;
    const bool is_compound = criterion_.kind() == CriterionKind::kCompound;
    certificate.criterion_value =
        static_cast<double>(is_compound ? bound.log_phi : Real(exp(Real(sign * bound.log_phi))));
    return prices(set, bound);
  }
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
