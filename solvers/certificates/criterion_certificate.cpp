#include "solvers/certificates/criterion_certificate.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/multiprecision/eigen.hpp>
#include <cmath>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "solvers/certificates/dual_bound.hpp"
#include "solvers/conditioning/quadruple.hpp"
#include "solvers/core/candidate_region.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/pricing/criterion_column_generation.hpp"

namespace graybox {
namespace {

template <class Real>
using MatrixOf = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Matrix = MatrixOf<Extended>;
using Vector = Eigen::Matrix<Extended, Eigen::Dynamic, 1>;

constexpr double kGoodGap = 1e-9;    // no better dual matrix is looked for
constexpr double kUp = 1.0 + 1e-14;  // more than what conversions to double lose
constexpr Extended kUnit = std::numeric_limits<Extended>::epsilon() / 2;

// Packed so that a dot product with a packed symmetric H is tr(A H).
template <class Real>
std::vector<Real> trace_dual(const MatrixOf<Real>& a) {
  std::vector<Real> packed;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) packed.push_back(i == j ? a(i, i) : a(i, j) + a(j, i));
  }
  return packed;
}

template <class Real>
MatrixOf<Real> inverse_factor(const InformationIn<Real>& information, std::size_t d) {
  const auto size = static_cast<Eigen::Index>(d);
  using RowMajor = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(information.inverse_factor().data(), size, size);
}

// w_i = tr(Z^T H_i Z) for every candidate, with a bound on each error.
template <class Real>
class Pricing {
 public:
  Pricing(const InformationSet& set, const InformationIn<Real>& information,
          const MatrixOf<Real>& z)
      : set_(set),
        information_(information),
        dual_(trace_dual<Real>(z * z.transpose())),
        magnitude_(trace_dual<Real>(z.cwiseAbs() * z.cwiseAbs().transpose())),
        unit_(static_cast<Real>(dual_.size() + 2 * set.dimension() +
                                static_cast<std::size_t>(z.cols()) + 4) *
              (std::numeric_limits<Real>::epsilon() / 2)) {}

  // `model_error(w, i)` bounds the error of w_i beyond rounding.
  template <typename ModelError>
  void run(const CandidateList& candidates, SensitivityBounds& bounds,
           const ModelError& model_error) {
    using std::abs;
    for (std::size_t n = 0; n < candidates.count; ++n) {
      const std::size_t i = candidates[n];
      const auto h = set_.information(i);
      Real w = 0, magnitude = 0;
      for (std::size_t k = 0; k < h.size(); ++k) {
        w += dual_[k] * h[k];
        magnitude += magnitude_[k] * abs(h[k]);
      }
      const Real error = unit_ * magnitude + model_error(std::max<Real>(w, Real(0)), i);
      bounds.upper[i] = kUp * static_cast<double>(w + error);
      upper_ = std::max<Real>(upper_, w + error);
      if (w > largest_) {
        largest_ = w;
        error_of_largest_ = error;
        worst_ = i;
      }
    }
    bounds.largest = static_cast<double>(largest_ - error_of_largest_) / kUp;
  }

  [[nodiscard]] Real information_trace(std::size_t i) const {
    return information_.sensitivity(set_.information(i)) / (1 - information_.residual());
  }

  // The gap max w_i / scale - 1, with scale known to within the relative error given.
  void certify(Real scale, Real scale_error, Certificate& certificate) const {
    using std::abs;
    const Real ratio = largest_ / scale;
    const Real highest = upper_ / (scale * (1 - scale_error));
    const Real lowest = (largest_ - error_of_largest_) / (scale * (1 + scale_error));
    certificate.worst_candidate = worst_;
    certificate.duality_gap = static_cast<double>(ratio - 1);
    certificate.rounding_bound =
        static_cast<double>(std::max<Real>(highest - ratio, ratio - lowest) +
                            Real(std::numeric_limits<double>::epsilon()) * abs(ratio - 1));
  }

 private:
  const InformationSet& set_;
  const InformationIn<Real>& information_;
  std::vector<Real> dual_;
  std::vector<Real> magnitude_;
  Real unit_;
  Real largest_ = 0, error_of_largest_ = 0, upper_ = 0;
  std::size_t worst_ = 0;
};

template <class Real>
void price_trace(const InformationSet& set, const Criterion& criterion,
                 const InformationIn<Real>& information, const CandidateList& candidates,
                 SensitivityBounds& bounds, Certificate& certificate) {
  using std::sqrt;
  const std::size_t d = set.dimension();
  const std::vector<double> factor = criterion.factor(d);
  const auto rows = static_cast<Eigen::Index>(d);
  const MatrixOf<Real> k = Eigen::Map<const Eigen::MatrixXd>(
                               factor.data(), rows, static_cast<Eigen::Index>(factor.size() / d))
                               .template cast<Real>();
  const MatrixOf<Real> x = inverse_factor(information, d);
  const MatrixOf<Real> whitened = x * k;
  const Real phi = whitened.squaredNorm();
  const Real eta = information.residual() / (1 - information.residual());
  Pricing<Real> pricing(set, information, x.transpose() * whitened);
  pricing.run(candidates, bounds, [&](const Real& w, std::size_t i) -> Real {
    const Real a = pricing.information_trace(i);
    return 2 * eta * sqrt(Real(phi * w * a)) + eta * eta * phi * a;
  });
  const Real unit = std::numeric_limits<Real>::epsilon() / 2;
  pricing.certify(phi, eta + static_cast<Real>(4 * d) * unit, certificate);
  certificate.criterion_value = static_cast<double>(phi);
}

template <class Real>
void price_interest(const InformationSet& set, const Criterion& criterion,
                    const InformationIn<Real>& information, const CandidateList& candidates,
                    SensitivityBounds& bounds, Certificate& certificate) {
  const std::size_t d = set.dimension();
  const std::size_t s = criterion.interest().size();
  const MatrixOf<Real> x = inverse_factor(information, d);
  const Real eta = information.residual() / (1 - information.residual());
  Pricing<Real> pricing(set, information, x.bottomRows(static_cast<Eigen::Index>(s)).transpose());
  pricing.run(candidates, bounds, [&](const Real&, std::size_t i) -> Real {
    return 2 * eta * pricing.information_trace(i);
  });
  pricing.certify(static_cast<Real>(s), Real(0), certificate);
  Real log_det = 0;
  for (std::size_t k = d - s; k < d; ++k) log_det += information.log_pivot(k);
  certificate.criterion_value = static_cast<double>(log_det);
}

struct LargestEigenvalue {
  Extended value = 0;
  Extended relative_error = 0;
  Vector vector;
};

// Of a positive semidefinite matrix. With the computed eigenvectors V as a congruence, |V^T V - I|
// <= e, the largest eigenvalue of V^T Y V is within the factors 1 -+ e of Y's (Ostrowski), and its
// diagonal differs from its eigenvalues by no more than what stands beside it (Weyl).
LargestEigenvalue largest_eigenvalue(const Matrix& y) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(y);
  const Matrix& v = eigen.eigenvectors();
  const Eigen::Index d = y.rows();
  Matrix diagonalised = v.transpose() * y * v;
  const Extended value = diagonalised.diagonal().maxCoeff();
  diagonalised.diagonal().setZero();
  const Extended rounding = static_cast<Extended>(6 * d * d) * kUnit;
  const Extended skew = (v.transpose() * v - Matrix::Identity(d, d)).norm() + rounding;
  return {value, (diagonalised.norm() / value + rounding + skew) / (1 - skew), v.col(d - 1)};
}

// Z with E = Z Z^T positive semidefinite and of trace one, from the design's dual matrix; empty
// where that is no matrix at all.
Matrix repaired_factor(const InformationSet& set, const std::vector<double>& dual, double& repair) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  if (dual.size() != set.packed_size() ||
      !std::ranges::all_of(dual, [](double x) { return std::isfinite(x); })) {
    return {};
  }
  Eigen::MatrixXd full(d, d);
  unpack(dual.data(), set.dimension(), full.data());
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(full.cast<Extended>());
  const Vector kept = eigen.eigenvalues().cwiseMax(Extended{0});
  const Extended trace = kept.sum();
  if (!(trace > 0) || !std::isfinite(trace)) return {};
  repair = static_cast<double>((kept / trace - eigen.eigenvalues()).cwiseAbs().sum());
  return eigen.eigenvectors() * (kept / trace).cwiseSqrt().asDiagonal();
}

// The dual matrix of the best design, found from the support of this one. It needs no trust: it is
// repaired and priced like any other.
std::vector<double> best_dual_matrix(const InformationSet& set, const Design& design) {
  const SolveOptions options{.duality_gap = kGoodGap, .criterion = Criterion::e()};
  Tracer tracer(set, options, nullptr);
  Design start{design.weights};
  for (double& weight : start.weights) weight = std::max(weight, 0.0);
  return solve_criterion(set, options, start, tracer).design.dual_matrix;
}

void price_smallest_eigenvalue(const InformationSet& set, const Design& design,
                               const ExtendedInformation& information,
                               const CandidateList& candidates, SensitivityBounds& bounds,
                               Certificate& certificate) {
  const std::size_t d = set.dimension();
  const Matrix x = inverse_factor(information, d);
  const LargestEigenvalue inverse = largest_eigenvalue(x.transpose() * x);
  const auto price = [&](const Matrix& z) {
    Pricing<Extended> pricing(set, information, z);
    pricing.run(candidates, bounds, [](Extended, std::size_t) { return Extended{0}; });
    // The gap is max w_i / (tr E lambda_min) - 1.
    const Extended scale = z.squaredNorm() / inverse.value;
    const Extended error =
        inverse.relative_error + information.residual() + static_cast<Extended>(d * d + 4) * kUnit;
    pricing.certify(scale, std::min(error, Extended{0.5}), certificate);
    return certificate.duality_gap;
  };
  certificate.criterion_value = static_cast<double>(1 / inverse.value);
  if (const Matrix given = repaired_factor(set, design.dual_matrix, certificate.dual_repair);
      given.size() > 0) {
    price(given);
    return;
  }
  // The eigenvector is the one dual matrix that fits where the smallest eigenvalue is simple.
  const double simple_gap = price(inverse.vector);
  if (simple_gap <= kGoodGap) return;
  double unused = 0.0;
  const Matrix found = repaired_factor(set, best_dual_matrix(set, design), unused);
  if (found.size() == 0 || !(price(found) < simple_gap)) price(inverse.vector);
}

// What proves G and E beside other criteria, or alone.
struct SharpDuals {
  std::vector<double> points;  // mu of all G, one after another
  Matrix factor;               // Z of E
};

// How many points the regions of a criterion's G have.
std::vector<std::size_t> point_counts(std::span<const CriterionPart> parts) {
  std::vector<std::size_t> counts;
  for (const CriterionPart& part : parts) {
    if (part.criterion.kind() == CriterionKind::kG) {
      counts.push_back(part.criterion.region().count());
    }
  }
  return counts;
}

bool has_eigenvalue(std::span<const CriterionPart> parts) {
  return std::ranges::any_of(
      parts, [](const CriterionPart& part) { return part.criterion.kind() == CriterionKind::kE; });
}

// Makes each region's weights a distribution. False where they are none.
bool normalise(std::span<const std::size_t> counts, std::vector<double>& mu) {
  std::size_t first = 0, all = 0;
  for (const std::size_t count : counts) all += count;
  if (mu.size() != all) return false;
  for (const std::size_t count : counts) {
    const std::span<double> own = std::span(mu).subspan(first, count);
    double sum = 0.0;
    for (double& each : own) sum += each = std::isfinite(each) ? std::max(each, 0.0) : 0.0;
    if (!(sum > 0.0) || !std::isfinite(sum)) return false;
    for (double& each : own) each /= sum;
    first += count;
  }
  return true;
}

// Those of the design, else those of the best design, found from the support of this one. Neither
// needs trust: wrong ones loosen the bound.
SharpDuals sharp_duals(const InformationSet& set, const Design& design, const Criterion& criterion,
                       std::span<const CriterionPart> parts, double& repair) {
  const std::vector<std::size_t> counts = point_counts(parts);
  const bool needs_matrix = has_eigenvalue(parts);
  SharpDuals duals;
  if (counts.empty() && !needs_matrix) return duals;
  const auto take = [&](const Design& from, double& own_repair) {
    duals.points = from.dual_weights;
    if (needs_matrix) duals.factor = repaired_factor(set, from.dual_matrix, own_repair);
    return normalise(counts, duals.points) && (!needs_matrix || duals.factor.size() > 0);
  };
  if (take(design, repair)) return duals;
  const SolveOptions options{.duality_gap = kGoodGap, .criterion = criterion};
  Tracer tracer(set, options, nullptr);
  Design start{design.weights};
  for (double& weight : start.weights) weight = std::max(weight, 0.0);
  double unused = 0.0;
  if (take(solve_criterion(set, options, start, tracer).design, unused)) return duals;
  duals.points.clear();
  for (const std::size_t count : counts) {
    duals.points.insert(duals.points.end(), count, 1.0 / static_cast<double>(count));
  }
  const auto d = static_cast<Eigen::Index>(set.dimension());
  duals.factor = Matrix::Identity(d, d);
  return duals;
}

// The bound of one part. `first`: of its points among all, moved behind them.
template <class Real>
DualBound<Real> bound_of(const InformationSet& set, const Design& design,
                         const Criterion& criterion, const InformationIn<Real>& information,
                         const SharpDuals& duals, std::size_t& first) {
  const std::size_t d = set.dimension();
  // Nuisance parameters come first where there are some.
  const std::vector<std::size_t> order = elimination_order(set, criterion);
  if (!order.empty()) {
    return dual_bound(criterion, d,
                      InformationIn<Real>(set, CheckedWeights(set, design).weights, order));
  }
  std::vector<double> mu;
  if (criterion.kind() == CriterionKind::kG) {
    const auto own = std::span(duals.points).subspan(first, criterion.region().count());
    mu.assign(own.begin(), own.end());
    first += own.size();
  }
  DualBound<Real> bound = dual_bound(criterion, d, information, mu);
  if (criterion.kind() == CriterionKind::kE) {
    bound.z = duals.factor.template cast<Real>();
    bound.scale *= bound.z.squaredNorm();
    bound.error += static_cast<Real>(2 * d * d + 8) * (std::numeric_limits<Real>::epsilon() / 2);
  }
  return bound;
}

// The bounds of all parts, joined to one matrix Z (dual_bound.hpp).
template <class Real>
void price_dual_bounds(const InformationSet& set, const Design& design, const Criterion& criterion,
                       const InformationIn<Real>& information, const CandidateList& candidates,
                       SensitivityBounds& bounds, Certificate& certificate) {
  using std::exp;
  using std::sqrt;
  std::vector<CriterionPart> parts(criterion.parts().begin(), criterion.parts().end());
  if (parts.empty()) parts.push_back({1.0, criterion});
  const SharpDuals duals = sharp_duals(set, design, criterion, parts, certificate.dual_repair);
  MatrixOf<Real> z(static_cast<Eigen::Index>(set.dimension()), 0);
  Real error = 0, log_phi = 0;
  std::size_t first = 0;
  for (const CriterionPart& part : parts) {
    const DualBound<Real> bound = bound_of(set, design, part.criterion, information, duals, first);
    const Eigen::Index before = z.cols();
    z.conservativeResize(Eigen::NoChange, before + bound.z.cols());
    z.rightCols(bound.z.cols()) = sqrt(Real(Real(part.share) / bound.scale)) * bound.z;
    error = std::max<Real>(error, bound.error);
    log_phi += Real(part.share) * bound.log_phi;
  }
  const Real unit = std::numeric_limits<Real>::epsilon() / 2;
  Pricing<Real> pricing(set, information, z);
  pricing.run(candidates, bounds, [](const Real&, std::size_t) -> Real { return 0; });
  // Shares of sum one but for their rounding, in double precision.
  const Real shares = parts.size() > 1 ? Real(parts.size() + 1) * Real(1.2e-16) : Real(0);
  pricing.certify(Real(1), std::min<Real>(error + shares + 8 * unit, Real(0.5)), certificate);
  certificate.criterion_value = static_cast<double>(
      criterion.kind() == CriterionKind::kCompound ? log_phi : Real(exp(Real(-log_phi))));
}

}  // namespace

std::vector<std::size_t> elimination_order(const InformationSet& set, const Criterion& criterion) {
  std::vector<std::size_t> order;
  if (criterion.kind() != CriterionKind::kDs) return order;
  for (std::size_t k = 0; k < set.dimension(); ++k) {
    if (!std::ranges::binary_search(criterion.interest(), k)) order.push_back(k);
  }
  order.insert(order.end(), criterion.interest().begin(), criterion.interest().end());
  return order;
}

template <class Real>
void price_criterion(const InformationSet& set, const Design& design, const Criterion& criterion,
                     const InformationIn<Real>& information, const CandidateList& candidates,
                     SensitivityBounds& bounds, Certificate& certificate) {
  if constexpr (std::is_same_v<Real, Extended>) {
    if (criterion.kind() == CriterionKind::kE) {
      return price_smallest_eigenvalue(set, design, information, candidates, bounds, certificate);
    }
  }
  if (!criterion.has_factor()) {
    return price_dual_bounds(set, design, over_candidates(criterion, set), information, candidates,
                             bounds, certificate);
  }
  if (criterion.kind() == CriterionKind::kDs) {
    return price_interest(set, criterion, information, candidates, bounds, certificate);
  }
  price_trace(set, criterion, information, candidates, bounds, certificate);
}

template void price_criterion(const InformationSet&, const Design&, const Criterion&,
                              const InformationIn<Extended>&, const CandidateList&,
                              SensitivityBounds&, Certificate&);
template void price_criterion(const InformationSet&, const Design&, const Criterion&,
                              const InformationIn<Quadruple>&, const CandidateList&,
                              SensitivityBounds&, Certificate&);

}  // namespace graybox
