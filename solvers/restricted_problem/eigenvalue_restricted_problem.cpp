#include "solvers/restricted_problem/eigenvalue_restricted_problem.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/interior_point/range_system.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kIterationLimit = 60;
constexpr double kBoundaryFraction = 0.98;
constexpr double kRoughestGap = 0.01;  // of any solve: a design that is worse misleads the pricing
constexpr double kFineGap = 1e-6;      // from here on rounding may matter
constexpr int kPatience = 6;           // iterations without progress below it

// What an answer is made of.
struct Iterate {
  VectorXd lambda, s;
  MatrixXd e;
  double nu = 0.0;
};

// Largest t with x + t dx >= 0.
double step_to_boundary(const VectorXd& x, const VectorXd& dx) {
  double step = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < x.size(); ++i) {
    if (dx(i) < 0.0) step = std::min(step, -x(i) / dx(i));
  }
  return step;
}

// Largest t with diag(v) + t dv >= 0.
double step_to_boundary(const VectorXd& v, const MatrixXd& dv) {
  const VectorXd root = v.cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = root.asDiagonal() * dv * root.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  const double smallest = eigen.eigenvalues()(0);
  return smallest < 0.0 ? -1.0 / smallest : std::numeric_limits<double>::infinity();
}

}  // namespace

EigenvalueRestrictedProblem::EigenvalueRestrictedProblem(std::size_t dimension,
                                                         std::span<const double> coordinates)
    : RestrictedProblem(dimension), packed_(packed_size_), dual_(packed_size_) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto d = static_cast<Index>(dimension);
  coordinates_ = MatrixXd::Identity(d, d);
  if (!coordinates.empty()) coordinates_ = Eigen::Map<const RowMajor>(coordinates.data(), d, d);
  c_ = coordinates_ * coordinates_.transpose();
  const std::vector<double> scale = symmetric_scale(dimension);
  symmetric_scale_ = Eigen::Map<const VectorXd>(scale.data(), static_cast<Index>(scale.size()));
  unpacked_.resize(d, d);
}

// Through C relative to M, whose largest eigenvalue is the inverse: C may be as ill-conditioned as
// lambda_min is small, M is well conditioned in coordinates that whiten the set.
bool EigenvalueRestrictedProblem::compute_spectrum(std::span<const double> weights) {
  sum_information(weights, packed_);
  unpack(packed_.data(), dimension_, unpacked_.data());
  cholesky_.compute(unpacked_);
  if (cholesky_.info() != Eigen::Success) return false;
  product_ = cholesky_.matrixL().solve(coordinates_);
  spectrum_.compute(product_ * product_.transpose());
  return spectrum_.info() == Eigen::Success && std::isfinite(smallest_eigenvalue());
}

double EigenvalueRestrictedProblem::smallest_eigenvalue() const {
  return 1.0 / spectrum_.eigenvalues()(spectrum_.eigenvalues().size() - 1);
}

bool EigenvalueRestrictedProblem::refresh() {
  normalise();
  if (!compute_spectrum(weights_)) return false;
  const double smallest = smallest_eigenvalue();
  if (e_.size() == 0) {
    const VectorXd x = cholesky_.matrixU().solve(spectrum_.eigenvectors().rightCols<1>());
    e_ = x * x.transpose() * smallest;
  }
  const MatrixXd g = e_ / smallest;
  pack_trace_dual(g.data(), dimension_, dual_.data());
  return true;
}

std::vector<double> EigenvalueRestrictedProblem::dual_matrix() const {
  const MatrixXd own = coordinates_.transpose() * e_ * coordinates_;
  const MatrixXd symmetric = (own + own.transpose()) / (2.0 * own.trace());
  std::vector<double> packed(packed_size_);
  pack(symmetric.data(), dimension_, packed.data());
  return packed;
}

// Equal weights, t and nu with room on their sides, E as Z^-1.
bool EigenvalueRestrictedProblem::start() {
  const auto n = static_cast<Index>(size());
  lambda_ = VectorXd::Constant(n, 1.0 / static_cast<double>(n));
  if (!compute_spectrum({lambda_.data(), size()})) return false;
  t_ = 0.5 * smallest_eigenvalue();
  const MatrixXd x = cholesky_.matrixU().solve(spectrum_.eigenvectors());
  e_ = x * (1.0 - t_ * spectrum_.eigenvalues().array()).inverse().matrix().asDiagonal() *
       x.transpose();
  e_ /= e_.cwiseProduct(c_).sum();
  price();
  nu_ = 1.1 * s_.maxCoeff();
  if (!(t_ > 0.0) || !std::isfinite(nu_)) return false;
  update_residuals();
  return true;
}

// s := tr(E H_i).
void EigenvalueRestrictedProblem::price() {
  pack_trace_dual(e_.data(), dimension_, packed_.data());
  s_.resize(static_cast<Index>(size()));
  kernels().price(rows_.data(), size(), packed_size_, packed_.data(), s_.data());
}

// Z and s from lambda, t, E and nu, after these have been brought back to 1^T lambda = 1 and
// tr(E C) = 1; t and nu follow, so that no slack changes its sign.
void EigenvalueRestrictedProblem::update_residuals() {
  const double total = lambda_.sum();
  lambda_ /= total;
  t_ /= total;
  e_ = (0.5 * (e_ + e_.transpose())).eval();
  const double trace = e_.cwiseProduct(c_).sum();
  e_ /= trace;
  nu_ /= trace;
  sum_information({lambda_.data(), size()}, packed_);
  z_.resize(c_.rows(), c_.rows());
  unpack(packed_.data(), dimension_, z_.data());
  z_ -= t_ * c_;
  price();
  s_ = (nu_ - s_.array()).matrix();
}

// g and v; false where Z or E has lost definiteness to rounding.
bool EigenvalueRestrictedProblem::scale() {
  cholesky_.compute(z_);
  if (cholesky_.info() != Eigen::Success) return false;
  const MatrixXd l = cholesky_.matrixL();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(l.transpose() * e_ * l);
  if (!(eigen.eigenvalues()(0) > 0.0) || !(s_.minCoeff() > 0.0) || !(lambda_.minCoeff() > 0.0)) {
    return false;
  }
  v_ = eigen.eigenvalues().cwiseSqrt();
  g_ = cholesky_.matrixU().solve(MatrixXd(eigen.eigenvectors() * v_.cwiseSqrt().asDiagonal()));
  return true;
}

void EigenvalueRestrictedProblem::to_vector(const MatrixXd& symmetric, VectorXd& vector) const {
  vector.resize(static_cast<Index>(packed_size_));
  pack(symmetric.data(), dimension_, vector.data());
  vector.array() *= symmetric_scale_.array();
}

void EigenvalueRestrictedProblem::to_matrix(const VectorXd& vector, MatrixXd& symmetric) {
  Eigen::Map<VectorXd>(packed_.data(), vector.size()) = vector.cwiseQuotient(symmetric_scale_);
  symmetric.resize(c_.rows(), c_.rows());
  unpack(packed_.data(), dimension_, symmetric.data());
}

// The B_i as rows of A, and the factor of A A^T + S/Lambda.
bool EigenvalueRestrictedProblem::form_system(DampedLeastSquares::Method method) {
  const std::size_t n = size();
  stride_ = (packed_size_ + 7) / 8 * 8;
  if (scaled_rows_.size() < n * stride_) scaled_rows_ = AlignedArray(2 * n * stride_);
  for (std::size_t i = 0; i < n; ++i) {
    unpack(row(i), dimension_, unpacked_.data());
    product_.noalias() = unpacked_ * g_;
    unpacked_.noalias() = g_.transpose() * product_;
    to_vector(unpacked_, scaled_row_);
    double* out = scaled_rows_.data() + i * stride_;
    std::copy_n(scaled_row_.data(), packed_size_, out);
    std::fill(out + packed_size_, out + stride_, 0.0);
  }
  if (!system_.factor(scaled_rows_.data(), stride_, packed_size_,
                      s_.cwiseQuotient(lambda_).cwiseSqrt(), method)) {
    return false;
  }
  to_vector(MatrixXd(v_.asDiagonal()), scaled_v_);
  system_.solve(scaled_v_ / nu_, lambda_.cwiseProduct(s_).cwiseSqrt() / nu_, inverse_ones_);
  return true;
}

// The steps towards `mu`, with Mehrotra's second-order terms of the steps at hand if asked for.
void EigenvalueRestrictedProblem::solve_direction(double mu, bool second_order) {
  residual_ = ((mu / v_.array()) - v_.array()).matrix().asDiagonal();
  target_ = (mu - lambda_.array() * s_.array()).matrix();
  if (second_order) {
    product_.noalias() = scaled_e_step_ * scaled_z_step_;
    for (Index b = 0; b < v_.size(); ++b) {
      for (Index a = 0; a < v_.size(); ++a) {
        residual_(a, b) -= (product_(a, b) + product_(b, a)) / (v_(a) + v_(b));
      }
    }
    target_ -= lambda_step_.cwiseProduct(s_step_);
  }
  to_vector(residual_, scaled_residual_);
  system_.solve(scaled_residual_, target_.cwiseQuotient(lambda_.cwiseProduct(s_).cwiseSqrt()), x_);
  const double corner = 1.0 / (nu_ + t_);
  const double gamma = target_.sum() + residual_.diagonal().dot(v_);
  const double y = (gamma * corner - x_.sum()) / (corner - inverse_ones_.sum());
  x_ -= y * inverse_ones_;
  const double growth = -x_.sum();  // dt/t
  lambda_step_ = x_ + growth * lambda_;
  t_step_ = growth * t_;
  nu_step_ = y - growth * nu_;
  const Eigen::Map<const MatrixXd, Eigen::Aligned64, Eigen::OuterStride<>> rows(
      scaled_rows_.data(), static_cast<Index>(packed_size_), x_.size(),
      Eigen::OuterStride<>(static_cast<Index>(stride_)));
  const VectorXd z_step = rows * x_ + growth * scaled_v_;
  to_matrix(z_step, scaled_z_step_);
  scaled_e_step_ = residual_ - scaled_z_step_;
  s_step_ = (nu_step_ - (rows.transpose() * (scaled_residual_ - z_step)).array()).matrix();
}

// Steps to the boundary of the primal and of the dual; returns the product lambda s + tr(E Z)
// there.
double EigenvalueRestrictedProblem::steps(double& primal, double& dual) const {
  primal = std::min(step_to_boundary(lambda_, lambda_step_), step_to_boundary(v_, scaled_z_step_));
  dual = std::min(step_to_boundary(s_, s_step_), step_to_boundary(v_, scaled_e_step_));
  const double a = std::min(primal, 1.0), b = std::min(dual, 1.0);
  const MatrixXd z = MatrixXd(v_.asDiagonal()) + a * scaled_z_step_;
  const MatrixXd e = MatrixXd(v_.asDiagonal()) + b * scaled_e_step_;
  return (lambda_ + a * lambda_step_).dot(s_ + b * s_step_) + e.cwiseProduct(z).sum();
}

// One predictor and corrector step; false where rounding leaves none.
bool EigenvalueRestrictedProblem::iterate(DampedLeastSquares::Method method) {
  if (!scale() || !form_system(method)) return false;
  const double count = static_cast<double>(size() + dimension_);
  const double product = lambda_.dot(s_) + v_.squaredNorm();
  double primal = 0.0, dual = 0.0;
  solve_direction(0.0, false);
  const double ratio = steps(primal, dual) / product;
  solve_direction(std::pow(ratio, 3.0) * product / count, true);
  static_cast<void>(steps(primal, dual));
  primal = std::min(1.0, kBoundaryFraction * primal);
  dual = std::min(1.0, kBoundaryFraction * dual);
  if (!(t_ + primal * t_step_ > 0.0) || !(primal + dual > 1e-6)) return false;
  lambda_ += primal * lambda_step_;
  t_ += primal * t_step_;
  nu_ += dual * nu_step_;
  e_ += dual * (g_ * scaled_e_step_ * g_.transpose()).eval();
  update_residuals();
  return true;
}

// Iterates until the gap nu/t - 1 is at most `tolerance` or rounding stops it; returns the gap of
// the best iterate, which stays.
double EigenvalueRestrictedProblem::solve(double tolerance) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!start()) return kInfinity;
  Iterate best;
  double best_gap = kInfinity;
  for (int iteration = 0, since_best = 0; iteration < kIterationLimit; ++iteration) {
    const double gap = nu_ / t_ - 1.0;
    ++since_best;
    if (gap < best_gap) {
      if (gap < 0.9 * best_gap) since_best = 0;
      best_gap = gap;
      best = {lambda_, s_, e_, nu_};
    }
    if (gap <= tolerance || (best_gap < kFineGap && since_best >= kPatience)) break;
    if (!iterate(best_gap < kFineGap ? DampedLeastSquares::Method::kOrthogonal
                                     : DampedLeastSquares::Method::kNormalEquations)) {
      break;
    }
  }
  lambda_ = best.lambda;
  s_ = best.s;
  e_ = best.e;
  nu_ = best.nu;
  return best_gap;
}

// Takes off as many of the smallest weights as cost lambda_min no more than `share` of it:
// bisection.
void EigenvalueRestrictedProblem::finish_weights(double share) {
  std::vector<std::size_t> order(size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto weight = [&](std::size_t i) { return lambda_(static_cast<Index>(i)); };
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return weight(a) < weight(b); });
  const auto value_without = [&](std::size_t count) {
    for (std::size_t k = 0; k < size(); ++k) {
      weights_[order[k]] = k < count ? 0.0 : weight(order[k]);
    }
    normalise();
    return compute_spectrum(weights_) ? smallest_eigenvalue() : 0.0;
  };
  const double required = (1.0 - share) * value_without(0);
  std::size_t fits = 0, fails = size();
  while (fails - fits > 1) {
    const std::size_t middle = (fits + fails) / 2;
    (value_without(middle) >= required ? fits : fails) = middle;
  }
  static_cast<void>(value_without(fits));
}

bool EigenvalueRestrictedProblem::improve(double pool_gap, double tolerance) {
  const double wanted = std::min({kRoughestGap, 0.1 * pool_gap, pool_gap * pool_gap});
  const double target = std::max(0.1 * tolerance, wanted);
  const double reached = solve(0.1 * target);
  if (!std::isfinite(reached)) return false;
  finish_weights(target);
  if (!refresh()) return false;
  std::vector<bool> kept(size());
  const double threshold = 1.0 - std::sqrt(target + pool_gap);
  for (std::size_t i = 0; i < size(); ++i) {
    kept[i] = weights_[i] > 0.0 || 1.0 - s_(static_cast<Index>(i)) / nu_ >= threshold;
  }
  keep(kept);
  return reached <= target;
}

}  // namespace graybox
