#include "solvers/certificates/dual_bound.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

using Eigen::Index;

template <class Real>
using MatrixIn = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

template <class Real>
const Real kUnitOf = std::numeric_limits<Real>::epsilon() / 2;

template <class Real>
class BoundMaker {
 public:
  BoundMaker(const Criterion& criterion, std::size_t dimension,
             const InformationIn<Real>& information, const std::vector<double>& dual_weights)
      : criterion_(criterion),
        information_(information),
        dual_weights_(dual_weights),
        d_(static_cast<Index>(dimension)),
        eta_(information.residual() / (1 - information.residual())) {
    using RowMajor = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    x_ = Eigen::Map<const RowMajor>(information.inverse_factor().data(), d_, d_);
  }

  DualBound<Real> determinant(std::size_t s) const {
    DualBound<Real> bound;
    bound.z = x_.bottomRows(static_cast<Index>(s)).transpose();
    bound.scale = static_cast<Real>(s);
    bound.error = eta_ + rounding(4);
    for (auto k = static_cast<std::size_t>(d_) - s; k < static_cast<std::size_t>(d_); ++k) {
      bound.log_phi += information_.log_pivot(k) / static_cast<Real>(s);
    }
    return bound;
  }

  DualBound<Real> trace() const {
    using std::log;
    const std::vector<double> factor = criterion_.factor(static_cast<std::size_t>(d_));
    const MatrixIn<Real> k =
        Eigen::Map<const Eigen::MatrixXd>(factor.data(), d_, static_cast<Index>(factor.size()) / d_)
            .template cast<Real>();
    const MatrixIn<Real> whitened = x_ * k;
    const Real phi = whitened.squaredNorm();
    DualBound<Real> bound = cauchy_schwarz(k, whitened);
    bound.scale /= phi;
    const Real lost = whitening_loss(k.cwiseAbs(), phi);
    bound.error += eta_ + 2 * lost + lost * lost + rounding(2 * k.cols());
    bound.log_phi = -log(phi);
    return bound;
  }

  DualBound<Real> power() const;
  DualBound<Real> smallest_eigenvalue() const;
  DualBound<Real> region() const;

 private:
  // The eigenvalues of X^T X, within 1 -+ error, and their axes.
  struct Spectrum {
    MatrixIn<Real> v;
    std::vector<Real> l;  // their logarithms
    Real largest = 0, error = 0;
  };
  [[nodiscard]] Spectrum spectrum() const;

  // The rounding of a sum of d and n more terms, relative to its magnitude.
  [[nodiscard]] Real rounding(Index n) const {
    return static_cast<Real>(2 * d_ + n + 8) * kUnitOf<Real>;
  }

  // |fl(X K) - X K|_F over |X K|_F.
  [[nodiscard]] Real whitening_loss(const MatrixIn<Real>& magnitude, const Real& phi) const {
    using std::sqrt;
    const MatrixIn<Real> all = x_.cwiseAbs() * magnitude;
    return rounding(0) * sqrt(Real(all.squaredNorm() / phi));
  }

  // Z = X^T (X K) and tr(K^T Z)^2, with its relative error.
  DualBound<Real> cauchy_schwarz(const MatrixIn<Real>& k, const MatrixIn<Real>& whitened) const {
    DualBound<Real> bound;
    bound.z = x_.transpose() * whitened;
    const Real product = k.cwiseProduct(bound.z).sum();
    const Real magnitude = k.cwiseAbs().cwiseProduct(bound.z.cwiseAbs()).sum();
    bound.scale = product * product;
    bound.error = 2 * rounding(k.size()) * magnitude / product;
    return bound;
  }

  const Criterion& criterion_;
  const InformationIn<Real>& information_;
  const std::vector<double>& dual_weights_;
  Index d_;
  Real eta_;
  MatrixIn<Real> x_;
};

// A V with orthogonal columns, by one-sided Jacobi rotations (Hestenes 1958), which are accurate
// for the small columns too.
template <class Real>
void orthogonalise(MatrixIn<Real>& a, MatrixIn<Real>& v) {
  using std::abs;
  using std::sqrt;
  constexpr int kSweeps = 60;
  const Index d = a.cols();
  const Real small = static_cast<Real>(d) * kUnitOf<Real>;
  bool rotated = true;
  for (int sweep = 0; rotated && sweep < kSweeps; ++sweep) {
    rotated = false;
    for (Index p = 0; p < d; ++p) {
      for (Index q = p + 1; q < d; ++q) {
        const Real pp = a.col(p).squaredNorm(), qq = a.col(q).squaredNorm();
        const Real pq = a.col(p).dot(a.col(q));
        if (!(abs(pq) > small * sqrt(Real(pp * qq)))) continue;
        rotated = true;
        const Real zeta = (qq - pp) / (2 * pq);
        const Real root = sqrt(Real(1 + zeta * zeta));
        const Real t = zeta >= 0 ? Real(1 / (zeta + root)) : Real(1 / (zeta - root));
        const Real c = 1 / sqrt(Real(1 + t * t)), s = c * t;
        for (MatrixIn<Real>* matrix : {&a, &v}) {
          const auto left = (c * matrix->col(p) - s * matrix->col(q)).eval();
          matrix->col(q) = (s * matrix->col(p) + c * matrix->col(q)).eval();
          matrix->col(p) = left;
        }
      }
    }
  }
}

// log of the mean of exp(p l_k), over p, for l_k <= 0; p may be small.
template <class Real>
Real log_mean(const std::vector<Real>& l, const Real& p) {
  using std::expm1;
  using std::log1p;
  Real excess = 0;
  for (const Real& each : l) excess += expm1(Real(p * each));
  return log1p(Real(excess / static_cast<Real>(l.size()))) / p;
}

// The eigenvalues of X^T X are within 1 -+ skew of those of V^T X^T X V (Ostrowski), skew bounding
// V^T V - I, and these, A being the computed X V and D = diag |a_j|, within 1 -+ spread of D^2,
// spread bounding D^-1 A^T A D^-1 - I.
template <class Real>
typename BoundMaker<Real>::Spectrum BoundMaker<Real>::spectrum() const {
  using std::log;
  using std::sqrt;
  Spectrum out;
  out.v = MatrixIn<Real>::Identity(d_, d_);
  MatrixIn<Real> a = x_;
  orthogonalise(a, out.v);
  a = x_ * out.v;
  const MatrixIn<Real> magnitude = x_.cwiseAbs() * out.v.cwiseAbs();
  Real lost = 0;
  out.largest = -std::numeric_limits<Real>::max();
  for (Index j = 0; j < d_; ++j) {
    const Real length = a.col(j).norm();
    const Real each = rounding(0) * magnitude.col(j).norm() / length;
    lost += each * each;
    out.l.push_back(2 * log(length));
    out.largest = std::max<Real>(out.largest, out.l.back());
    a.col(j) /= length;
  }
  lost = sqrt(lost);
  const auto distance = [&](const MatrixIn<Real>& q) -> Real {
    return (q.transpose() * q - MatrixIn<Real>::Identity(d_, d_)).norm() +
           static_cast<Real>(d_) * rounding(0);
  };
  const Real skew = distance(out.v), spread = distance(a) + 2 * lost + lost * lost;
  out.error = eta_ + spread + 3 * skew;
  return out;
}

template <class Real>
DualBound<Real> BoundMaker<Real>::smallest_eigenvalue() const {
  using std::abs;
  using std::exp;
  const Spectrum spectrum_of = spectrum();
  DualBound<Real> bound;
  bound.z.resize(d_, 0);
  bound.log_phi = -spectrum_of.largest;
  bound.scale = exp(bound.log_phi);
  bound.error = spectrum_of.error + rounding(8) * (1 + abs(spectrum_of.largest));
  bound.error += 4 * bound.error * bound.error;
  return bound;
}

template <class Real>
DualBound<Real> BoundMaker<Real>::power() const {
  using std::abs;
  using std::exp;
  const Real p(criterion_.p());
  Spectrum spectrum_of = spectrum();
  std::vector<Real>& l = spectrum_of.l;
  const Real largest = spectrum_of.largest;
  Real range = 0;
  std::vector<Real> dual;
  for (Real& each : l) {
    each -= largest;
    range = std::max<Real>(range, abs(each));
    dual.push_back((p + 1) * each);
  }
  DualBound<Real> bound;
  bound.z = spectrum_of.v;
  for (Index j = 0; j < d_; ++j) {
    bound.z.col(j) *= exp(Real(dual[static_cast<std::size_t>(j)] / 2));
  }
  const Real q = p / (p + 1);
  bound.log_phi = -largest - log_mean(l, p);
  bound.scale = static_cast<Real>(d_) * exp(Real(log_mean(dual, q) - log_mean(l, p) - largest));
  const Real evaluation =
      static_cast<Real>(d_) * rounding(8) * (1 + (p + 2) * range + abs(largest));
  bound.error = spectrum_of.error + evaluation;
  bound.error += 4 * bound.error * bound.error;
  return bound;
}

template <class Real>
DualBound<Real> BoundMaker<Real>::region() const {
  using std::log;
  using std::sqrt;
  const PredictionRegion& region = criterion_.region();
  const std::span<const double> rows = region.rows();
  const auto columns = static_cast<Index>(rows.size()) / d_;
  const Eigen::Map<const Eigen::MatrixXd> all(rows.data(), d_, columns);
  MatrixIn<Real> k(d_, columns);
  Index used = 0;
  Real largest = 0, highest = 0, mass = 0;
  for (std::size_t j = 0, column = 0; j < region.count(); ++j) {
    const auto width = static_cast<Index>(region.row_counts()[j]);
    const MatrixIn<Real> point =
        all.middleCols(static_cast<Index>(column), width).template cast<Real>();
    column += region.row_counts()[j];
    const Real length = (x_ * point).norm();
    const Real lost = rounding(width) * (x_.cwiseAbs() * point.cwiseAbs()).norm();
    largest = std::max<Real>(largest, length * length);
    highest = std::max<Real>(highest, (length + lost) * (length + lost));
    if (!(dual_weights_[j] > 0.0)) continue;
    const Real root = sqrt(Real(dual_weights_[j]));
    mass += root * root;
    k.middleCols(used, width) = root * point;
    used += width;
  }
  k.conservativeResize(d_, used);
  const MatrixIn<Real> whitened = x_ * k;
  DualBound<Real> bound = cauchy_schwarz(k, whitened);
  bound.scale /= mass * largest;
  bound.error += eta_ + (highest / largest - 1) + rounding(4 + static_cast<Index>(region.count()));
  bound.log_phi = -log(largest);
  return bound;
}

}  // namespace

template <class Real>
DualBound<Real> dual_bound(const Criterion& criterion, std::size_t dimension,
                           const InformationIn<Real>& information,
                           const std::vector<double>& dual_weights) {
  const BoundMaker<Real> maker(criterion, dimension, information, dual_weights);
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return maker.determinant(dimension);
    case CriterionKind::kDs:
      return maker.determinant(criterion.interest().size());
    case CriterionKind::kPhiP:
      return maker.power();
    case CriterionKind::kE:
      return maker.smallest_eigenvalue();
    case CriterionKind::kG:
      return maker.region();
    default:
      return maker.trace();
  }
}

template DualBound<Extended> dual_bound(const Criterion&, std::size_t,
                                        const InformationIn<Extended>&, const std::vector<double>&);
template DualBound<Quadruple> dual_bound(const Criterion&, std::size_t,
                                         const InformationIn<Quadruple>&,
                                         const std::vector<double>&);

}  // namespace graybox
