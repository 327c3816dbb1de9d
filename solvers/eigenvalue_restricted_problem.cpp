#include "graybox/solvers/eigenvalue_restricted_problem.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kIterationLimit = 60;
constexpr double kBoundaryFraction = 0.98;
constexpr double kRoundingGap = 1e-6;  // where a gap that grows again is rounding's

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
  unpacked_.resize(d, d);
}

bool EigenvalueRestrictedProblem::refresh() {
  normalise();
  sum_information(weights_, packed_);
  unpack(packed_.data(), dimension_, unpacked_.data());
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(unpacked_, c_);
  const double smallest = eigen.eigenvalues()(0);
  if (!(smallest > 0.0)) return false;
  if (e_.size() == 0) e_ = eigen.eigenvectors().col(0) * eigen.eigenvectors().col(0).transpose();
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

// Equal weights, E as C^-1, t and nu with room on their sides.
bool EigenvalueRestrictedProblem::start() {
  const auto n = static_cast<Index>(size());
  const auto d = static_cast<Index>(dimension_);
  lambda_ = VectorXd::Constant(n, 1.0 / static_cast<double>(n));
  sum_information({lambda_.data(), size()}, packed_);
  unpack(packed_.data(), dimension_, unpacked_.data());
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(unpacked_, c_);
  const double mean = eigen.eigenvalues().mean();
  t_ = std::min(0.5 * eigen.eigenvalues()(0), eigen.eigenvalues()(0) - 0.1 * mean);
  e_ = eigen.eigenvectors() * eigen.eigenvectors().transpose() / static_cast<double>(d);
  pack_trace_dual(e_.data(), dimension_, packed_.data());
  s_.resize(n);
  kernels().price(rows_.data(), size(), packed_size_, packed_.data(), s_.data());
  nu_ = 1.1 * s_.maxCoeff();
  if (!(eigen.eigenvalues()(0) > 0.0) || !std::isfinite(nu_)) return false;
  update_residuals();
  return true;
}

// Z and s from lambda, t, E and nu.
void EigenvalueRestrictedProblem::update_residuals() {
  lambda_ /= lambda_.sum();
  e_ = (0.5 * (e_ + e_.transpose())).eval();
  e_ /= e_.cwiseProduct(c_).sum();
  sum_information({lambda_.data(), size()}, packed_);
  z_.resize(c_.rows(), c_.rows());
  unpack(packed_.data(), dimension_, z_.data());
  z_ -= t_ * c_;
  pack_trace_dual(e_.data(), dimension_, packed_.data());
  kernels().price(rows_.data(), size(), packed_size_, packed_.data(), s_.data());
  s_ = (nu_ - s_.array()).matrix();
}

// g and v; false where Z or E has lost definiteness to rounding.
bool EigenvalueRestrictedProblem::scale() {
  const Eigen::LLT<MatrixXd> cholesky(z_);
  if (cholesky.info() != Eigen::Success) return false;
  const MatrixXd l = cholesky.matrixL();
  const MatrixXd product = l.transpose() * e_ * l;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(product);
  if (!(eigen.eigenvalues()(0) > 0.0) || !(s_.minCoeff() > 0.0) || !(lambda_.minCoeff() > 0.0)) {
    return false;
  }
  v_ = eigen.eigenvalues().cwiseSqrt();
  g_ = cholesky.matrixU().solve(MatrixXd(eigen.eigenvectors() * v_.cwiseSqrt().asDiagonal()));
  return true;
}

// The matrix of the linear system.
void EigenvalueRestrictedProblem::form_system() {
  const std::size_t n = size();
  const std::size_t stride = (packed_size_ + 7) / 8 * 8;
  if (gram_rows_.size() < n * stride) gram_rows_ = AlignedArray(2 * n * stride);
  scaled_information_.resize(n);
  scaled_c_ = g_.transpose() * c_ * g_;
  system_.resize(static_cast<Index>(n) + 2, static_cast<Index>(n) + 2);
  for (std::size_t i = 0; i < n; ++i) {
    unpack(row(i), dimension_, unpacked_.data());
    scaled_information_[i].noalias() = g_.transpose() * (unpacked_ * g_).eval();
    double* out = gram_rows_.data() + i * stride;
    for (Index a = 0; a < c_.rows(); ++a) {
      for (Index b = 0; b <= a; ++b) {
        *out++ = scaled_information_[i](a, b) * (a == b ? 1.0 : std::numbers::sqrt2);
      }
    }
    std::fill(out, gram_rows_.data() + (i + 1) * stride, 0.0);
  }
  gram_.resize(n * n);
  dense_kernels().gram(gram_rows_.data(), n, stride, gram_.data());
  const auto last = static_cast<Index>(n);
  for (Index j = 0; j < last; ++j) {
    for (Index i = j; i < last; ++i) {
      system_(i, j) = system_(j, i) = gram_[static_cast<std::size_t>(j * last + i)];
    }
    system_(j, j) += s_(j) / lambda_(j);
    const double k = scaled_information_[static_cast<std::size_t>(j)].cwiseProduct(scaled_c_).sum();
    system_(j, last) = -k;
    system_(last, j) = k;
  }
  system_.col(last + 1).setOnes();
  system_.row(last + 1).setOnes();
  system_(last, last) = -scaled_c_.squaredNorm();
  system_(last, last + 1) = system_(last + 1, last) = system_(last + 1, last + 1) = 0.0;
}

// The steps towards `mu`, with Mehrotra's second-order terms of the steps at hand if asked for.
void EigenvalueRestrictedProblem::solve_direction(double mu, bool second_order) {
  const auto n = static_cast<Index>(size());
  MatrixXd residual = MatrixXd(((mu / v_.array()) - v_.array()).matrix().asDiagonal());
  VectorXd target = (mu - lambda_.array() * s_.array()).matrix();
  if (second_order) {
    const MatrixXd product = scaled_e_step_ * scaled_z_step_;
    for (Index b = 0; b < v_.size(); ++b) {
      for (Index a = 0; a < v_.size(); ++a) {
        residual(a, b) -= (product(a, b) + product(b, a)) / (v_(a) + v_(b));
      }
    }
    target -= lambda_step_.cwiseProduct(s_step_);
  }
  VectorXd right(n + 2);
  for (Index i = 0; i < n; ++i) {
    right(i) = target(i) / lambda_(i) +
               residual.cwiseProduct(scaled_information_[static_cast<std::size_t>(i)]).sum();
  }
  right(n) = residual.cwiseProduct(scaled_c_).sum();
  right(n + 1) = 0.0;
  const VectorXd solution = system_.partialPivLu().solve(right);
  lambda_step_ = solution.head(n);
  t_step_ = solution(n);
  nu_step_ = solution(n + 1);
  scaled_z_step_ = -t_step_ * scaled_c_;
  for (Index i = 0; i < n; ++i) {
    scaled_z_step_ += lambda_step_(i) * scaled_information_[static_cast<std::size_t>(i)];
  }
  scaled_e_step_ = residual - scaled_z_step_;
  s_step_ = (target - s_.cwiseProduct(lambda_step_)).cwiseQuotient(lambda_);
}

// Steps to the boundary of the primal and of the dual; returns the product lambda s + tr(E Z) there.
double EigenvalueRestrictedProblem::steps(double& primal, double& dual) const {
  primal = std::min(step_to_boundary(lambda_, lambda_step_), step_to_boundary(v_, scaled_z_step_));
  dual = std::min(step_to_boundary(s_, s_step_), step_to_boundary(v_, scaled_e_step_));
  const double a = std::min(primal, 1.0), b = std::min(dual, 1.0);
  const MatrixXd z = MatrixXd(v_.asDiagonal()) + a * scaled_z_step_;
  const MatrixXd e = MatrixXd(v_.asDiagonal()) + b * scaled_e_step_;
  return (lambda_ + a * lambda_step_).dot(s_ + b * s_step_) + e.cwiseProduct(z).sum();
}

// False if rounding stops it before `tolerance`; the best iterate stays.
bool EigenvalueRestrictedProblem::solve(double tolerance) {
  if (!start()) return false;
  const double count = static_cast<double>(size() + dimension_);
  Iterate best;
  double best_gap = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kIterationLimit; ++iteration) {
    const double gap = t_ > 0.0 ? nu_ / t_ - 1.0 : std::numeric_limits<double>::infinity();
    if (gap < best_gap) {
      best_gap = gap;
      best = {lambda_, s_, e_, nu_};
    }
    const bool rounding = best_gap < kRoundingGap && gap > 1.5 * best_gap;
    if (gap <= tolerance || rounding || !scale()) break;
    form_system();
    const double product = lambda_.dot(s_) + v_.squaredNorm();
    double primal = 0.0, dual = 0.0;
    solve_direction(0.0, false);
    const double ratio = steps(primal, dual) / product;
    solve_direction(std::pow(ratio, 3.0) * product / count, true);
    static_cast<void>(steps(primal, dual));
    primal = std::min(1.0, kBoundaryFraction * primal);
    dual = std::min(1.0, kBoundaryFraction * dual);
    if (!std::isfinite(t_step_) || !(primal + dual > 1e-6)) break;
    lambda_ += primal * lambda_step_;
    t_ += primal * t_step_;
    nu_ += dual * nu_step_;
    e_ += dual * (g_ * scaled_e_step_ * g_.transpose()).eval();
    update_residuals();
  }
  if (std::isfinite(best_gap)) {
    lambda_ = best.lambda;
    s_ = best.s;
    e_ = best.e;
    nu_ = best.nu;
  }
  return best_gap <= tolerance;
}

// Weights that are small beside their reduced costs vanish at the optimum.
void EigenvalueRestrictedProblem::finish_weights() {
  for (std::size_t i = 0; i < size(); ++i) {
    const auto k = static_cast<Index>(i);
    weights_[i] = lambda_(k) > 1e-3 * s_(k) / nu_ || lambda_(k) > 1e-4 ? lambda_(k) : 0.0;
  }
}

bool EigenvalueRestrictedProblem::improve(double pool_gap, double tolerance) {
  const double target = std::max(0.1 * tolerance, std::min(0.1 * pool_gap, pool_gap * pool_gap));
  const bool solved = solve(target);
  finish_weights();
  if (!refresh()) {
    std::copy_n(lambda_.data(), size(), weights_.begin());
    if (!refresh()) return false;
  }
  std::vector<bool> kept(size());
  const double threshold = 1.0 - std::sqrt(target + pool_gap);
  for (std::size_t i = 0; i < size(); ++i) {
    kept[i] = weights_[i] > 0.0 || 1.0 - s_(static_cast<Index>(i)) / nu_ >= threshold;
  }
  keep(kept);
  return solved;
}

}  // namespace graybox
