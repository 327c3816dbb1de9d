#include "solvers/column_generation/lazy_bound.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

// Of the errors that sensitivity_error() gives: how many of them the threshold is lowered by.
constexpr double kErrorsAllowed = 4.0;

}  // namespace

double largest_ratio(std::span<const double> packed, std::span<const double> inverse_factor,
                     std::size_t dimension) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd m(d, d), x = Eigen::MatrixXd::Zero(d, d);
  unpack(packed.data(), dimension, m.data());
  for (std::size_t i = 0, k = 0; i < dimension; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) {
      x(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = inverse_factor[k];
    }
  }
  const Eigen::MatrixXd left = x.triangularView<Eigen::Lower>() * m;
  const Eigen::MatrixXd whitened = left * x.transpose();
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(whitened, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .maxCoeff();
}

LazyBound::LazyBound(const WorkingSet& design)
    : matrix_(design.information().begin(), design.information().end()),
      error_(design.sensitivity_error()) {}

double LazyBound::threshold(const WorkingSet& design, double level) const {
  const std::size_t d = design.dimension();
  const double kappa = largest_ratio(matrix_, design.inverse().inverse_factor(), d);
  const double eigenvalue_error =
      8.0 * static_cast<double>(d) * std::numeric_limits<double>::epsilon();
  const double error = kErrorsAllowed * (error_ + design.sensitivity_error()) + eigenvalue_error;
  if (!(error < 1.0) || !std::isfinite(kappa)) return -std::numeric_limits<double>::infinity();
  return level * (1.0 - error) / kappa;
}

}  // namespace graybox
