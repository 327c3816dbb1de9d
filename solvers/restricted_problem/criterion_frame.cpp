#include "solvers/restricted_problem/criterion_frame.hpp"

#include <algorithm>
#include <cmath>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr double kSmallestShare = 1e-12;  // points with less have no say in the curvature
// What a barrier's points may leave out of the second derivative together, which is at least one
// along the gradient.
constexpr double kLeftOut = 0.01;

}  // namespace

using Eigen::Index;

CriterionFrame::CriterionFrame(const Criterion& criterion, std::size_t dimension,
                               std::span<const double> coordinates)
    : form_(criterion.is_trace()                       ? Form::kTrace
            : criterion.kind() == CriterionKind::kPhiP ? Form::kPower
            : criterion.kind() == CriterionKind::kG    ? Form::kRegion
            : criterion.kind() == CriterionKind::kE    ? Form::kEigenvalue
                                                       : Form::kDeterminant),
      dual_(packed_size(dimension)) {
  const auto d = static_cast<Index>(dimension);
  if (form_ == Form::kRegion) {
    const std::span<const double> rows = criterion.region().rows();
    k_ = Eigen::Map<const Eigen::MatrixXd>(rows.data(), d, static_cast<Index>(rows.size()) / d);
    const auto counts = criterion.region().row_counts();
    row_counts_.assign(counts.begin(), counts.end());
    complete_ = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(k_).rank() == d;
  } else if (form_ == Form::kPower) {
    full_power_ = power_ = rank_one_ = criterion.p();
    k_ = Eigen::MatrixXd::Identity(d, d);
    complete_ = true;
  } else if (form_ == Form::kEigenvalue) {
    k_ = Eigen::MatrixXd::Identity(d, d);
    complete_ = barrier_ = true;
  } else {
    const std::vector<double> factor = criterion.factor(dimension);
    k_ = Eigen::Map<const Eigen::MatrixXd>(factor.data(), d, static_cast<Index>(factor.size()) / d);
    rank_one_ = is_trace() ? 1.0 : 0.0;
    complete_ = k_.cols() == d;
  }
  if (!coordinates.empty()) {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    k_ = (Eigen::Map<const RowMajor>(coordinates.data(), d, d) * k_).eval();
  }
  x_ = Eigen::MatrixXd::Zero(d, d);
  shares_ = Eigen::VectorXd::Zero(d);
}

void CriterionFrame::set_power_at_most(double limit) {
  if (form_ == Form::kPower) power_ = rank_one_ = std::min(full_power_, limit);
}

void CriterionFrame::set_sharpness(double sharpness) {
  sharpness_ = sharpness;
  if (is_smoothed()) rank_one_ = barrier_ ? 0.0 : sharpness;
}

void CriterionFrame::whiten(const InverseCholesky& inverse) {
  const std::span<const double> packed = inverse.inverse_factor();
  for (Index i = 0, k = 0; i < x_.rows(); ++i) {
    for (Index j = 0; j <= i; ++j, ++k) x_(i, j) = packed[static_cast<std::size_t>(k)];
  }
  whitened_.noalias() = x_ * k_;
}

// By expm1, because p may be small.
double CriterionFrame::power_value() {
  svd_.compute(whitened_, Eigen::ComputeFullU);
  const double largest = svd_.singularValues()(0);
  relative_ = (svd_.singularValues() / largest).cwiseAbs2();
  double excess = 0.0;  // sum of sigma^p - 1
  for (const double sigma : relative_) excess += std::expm1(power_ * std::log(sigma));
  const auto d = static_cast<double>(x_.rows());
  power_sum_ = d + excess;
  return 2.0 * std::log(largest) + std::log1p(excess / d) / power_;
}

// f less log of the largest of numbers whose ratios to it are given; D in share_. With t such that
// the largest u is 1 - e, the sum of D falls in e and is convex: Newton's method from below.
double CriterionFrame::barrier_value(std::span<const double> relative) {
  constexpr int kMostSteps = 100;
  const double tau = 1.0 / sharpness_;
  double e = tau / (1.0 + tau);
  for (int step = 0; step < kMostSteps; ++step) {
    double sum = 0.0, slope = 0.0;
    for (const double r : relative) {
      const double rest = (1.0 - r) + e * r;  // 1 - u
      sum += tau * (1.0 - e) * r / rest;
      slope += tau * r / (rest * rest);
    }
    const double change = (sum - 1.0) / slope;
    e = std::clamp(e + change, 1e-300, 1.0);
    if (std::abs(change) <= 1e-15 * e) break;
  }
  double sum = 0.0, logs = 0.0;
  share_.resize(relative.size());
  for (std::size_t a = 0; a < share_.size(); ++a) {
    const double rest = (1.0 - relative[a]) + e * relative[a];
    sum += share_[a] = tau * (1.0 - e) * relative[a] / rest;
    logs += std::log(rest);
  }
  smoothing_factor_ = 0.0;
  for (std::size_t a = 0; a < share_.size(); ++a) {
    share_[a] /= sum;
    smoothing_factor_ += relative[a] > 0.0 ? share_[a] / relative[a] : 0.0;
  }
  return -std::log1p(-e) - tau * logs;
}

// The smoothing factor of E is the inverse: there the D_a weigh numbers 1/l_a, not their inverses.
double CriterionFrame::eigenvalue_value() {
  svd_.compute(whitened_, Eigen::ComputeFullU);
  const double largest = svd_.singularValues()(0);
  relative_ = (svd_.singularValues() / largest).cwiseAbs2();
  const double f = barrier_value({relative_.data(), static_cast<std::size_t>(relative_.size())});
  double mean = 0.0;
  for (std::size_t a = 0; a < share_.size(); ++a) {
    mean += share_[a] * relative_(static_cast<Index>(a));
  }
  smoothing_factor_ = 1.0 / mean;
  return 2.0 * std::log(largest) + f;
}

double CriterionFrame::largest_variance() {
  variance_.resize(row_counts_.size());
  double largest = 0.0;
  for (std::size_t j = 0, column = 0; j < row_counts_.size(); column += row_counts_[j], ++j) {
    variance_[j] =
        whitened_.middleCols(static_cast<Index>(column), static_cast<Index>(row_counts_[j]))
            .squaredNorm();
    largest = std::max(largest, variance_[j]);
  }
  return largest;
}

double CriterionFrame::region_value() {
  const double largest = largest_variance();
  share_.resize(row_counts_.size());
  if (barrier_) {
    std::vector<double> relative(variance_.size());
    for (std::size_t j = 0; j < relative.size(); ++j) relative[j] = variance_[j] / largest;
    return std::log(largest) + barrier_value(relative);
  }
  double sum = 0.0;
  for (std::size_t j = 0; j < share_.size(); ++j) {
    share_[j] = variance_[j] > 0.0 ? std::exp(sharpness_ * std::log(variance_[j] / largest)) : 0.0;
    sum += share_[j];
  }
  smoothing_factor_ = 0.0;
  for (std::size_t j = 0; j < share_.size(); ++j) {
    share_[j] /= sum;
    if (share_[j] > 0.0) smoothing_factor_ += share_[j] * (largest / variance_[j]);
  }
  return std::log(largest) + std::log(sum) / sharpness_;
}

double CriterionFrame::value(const InverseCholesky& inverse) {
  whiten(inverse);
  switch (form_) {
    case Form::kTrace:
      return std::log(whitened_.squaredNorm());
    case Form::kPower:
      return power_value();
    case Form::kRegion:
      return region_value();
    case Form::kEigenvalue:
      return eigenvalue_value();
    case Form::kDeterminant:
      break;
  }
  qr_.compute(whitened_);
  const Index s = k_.cols();
  return 2.0 * qr_.matrixQR().diagonal().head(s).cwiseAbs().array().log().sum() /
         static_cast<double>(s);
}

double CriterionFrame::sharp_value(const InverseCholesky& inverse) {
  if (!is_smoothed()) return value(inverse);
  whiten(inverse);
  if (form_ == Form::kRegion) return std::log(largest_variance());
  dual_matrix_.noalias() = whitened_ * whitened_.transpose();
  eigen_.compute(dual_matrix_, Eigen::EigenvaluesOnly);
  return std::log(eigen_.eigenvalues().maxCoeff());
}

double CriterionFrame::compute(const InverseCholesky& inverse) {
  const double f = value(inverse);
  if (form_ == Form::kDeterminant) {
    axes_ = qr_.householderQ().transpose() * x_;
    shares_.head(k_.cols()).setConstant(1.0 / static_cast<double>(k_.cols()));
  } else if (form_ == Form::kPower) {
    axes_.noalias() = svd_.matrixU().transpose() * x_;
    shares_ = relative_.array().pow(power_) / power_sum_;
  } else if (form_ == Form::kEigenvalue) {
    axes_.noalias() = svd_.matrixU().transpose() * x_;
    shares_ = Eigen::VectorXd::Map(share_.data(), static_cast<Index>(share_.size()));
    collect_eigenvalue_term();
  } else {
    if (form_ == Form::kRegion) {
      for (std::size_t j = 0, column = 0; j < row_counts_.size(); column += row_counts_[j], ++j) {
        const double root = variance_[j] > 0.0 ? std::sqrt(share_[j] / variance_[j]) : 0.0;
        whitened_.middleCols(static_cast<Index>(column), static_cast<Index>(row_counts_[j])) *=
            root;
      }
    }
    dual_matrix_.noalias() = whitened_ * whitened_.transpose();
    eigen_.compute(dual_matrix_);
    shares_ = eigen_.eigenvalues().cwiseMax(0.0);
    shares_ /= shares_.sum();
    axes_.noalias() = eigen_.eigenvectors().transpose() * x_;
  }
  dual_matrix_.noalias() = axes_.transpose() * shares_.asDiagonal() * axes_;
  pack_trace_dual(dual_matrix_.data(), static_cast<std::size_t>(x_.rows()), dual_.data());
  if (form_ == Form::kRegion) collect_outer_terms();
  return f;
}

void CriterionFrame::collect_eigenvalue_term() {
  const Eigen::VectorXd q = shares_.array() * (1.0 + sharpness_ * shares_.array());
  dual_matrix_.noalias() = axes_.transpose() * q.asDiagonal() * axes_;
  outer_.resize(1);
  outer_.front().coefficient = -1.0 / (1.0 + sharpness_ * shares_.squaredNorm());
  outer_.front().dual.resize(dual_.size());
  pack_trace_dual(dual_matrix_.data(), static_cast<std::size_t>(x_.rows()),
                  outer_.front().dual.data());
}

// With the columns of a point scaled to pi_j in squared norm, their outer products over pi_j. As
// sum_j D_j v_j is the gradient, q is that and the points' own terms.
void CriterionFrame::collect_outer_terms() {
  outer_.clear();
  OuterTerm last{-1.0, dual_};
  double curvature = 1.0;
  const double least = kLeftOut / static_cast<double>(row_counts_.size());
  Eigen::MatrixXd v(x_.rows(), x_.rows());
  for (std::size_t j = 0, column = 0; j < row_counts_.size(); column += row_counts_[j], ++j) {
    if (share_[j] < kSmallestShare) continue;
    if (barrier_ && sharpness_ * share_[j] * share_[j] < least) continue;
    const Eigen::MatrixXd z =
        x_.transpose() *
        whitened_.middleCols(static_cast<Index>(column), static_cast<Index>(row_counts_[j]));
    v.noalias() = z * z.transpose() / share_[j];
    OuterTerm& term = outer_.emplace_back();
    term.coefficient = (sharpness_ - 1.0) * share_[j];
    term.dual.resize(dual_.size());
    pack_trace_dual(v.data(), static_cast<std::size_t>(x_.rows()), term.dual.data());
    if (!barrier_) continue;
    term.coefficient = sharpness_ * share_[j] * share_[j];
    curvature += term.coefficient;
    for (std::size_t k = 0; k < dual_.size(); ++k) last.dual[k] += term.coefficient * term.dual[k];
  }
  last.coefficient = -1.0 / curvature;
  if (barrier_) outer_.push_back(std::move(last));
}

double CriterionFrame::omega(Index a, Index b) const {
  if (form_ == Form::kDeterminant) return std::max(shares_(a), shares_(b));
  if (form_ == Form::kEigenvalue) {
    return shares_(a) + shares_(b) + sharpness_ * shares_(a) * shares_(b);
  }
  if (form_ != Form::kPower) return shares_(a) + shares_(b);
  // sigma_a^p (1 - t^(p+1))/(1 - t) with t = sigma_b/sigma_a <= 1.
  const double high = std::max(relative_(a), relative_(b));
  const double log_ratio = std::log(std::min(relative_(a), relative_(b)) / high);
  const double quotient = log_ratio > -1e-9
                              ? power_ + 1.0
                              : std::expm1((power_ + 1.0) * log_ratio) / std::expm1(log_ratio);
  return std::pow(high, power_) / power_sum_ * quotient;
}

std::vector<double> CriterionFrame::point_weights() const {
  std::vector<double> weights(share_.size(), 0.0);
  double sum = 0.0;
  for (std::size_t j = 0; j < weights.size(); ++j) {
    if (share_[j] > 0.0) sum += weights[j] = share_[j] / variance_[j];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace graybox
