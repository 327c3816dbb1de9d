#include "diagnosis/harmonic_balance/common_error.hpp"

#include <Eigen/Eigenvalues>

#include "diagnosis/harmonic_balance/real_products.hpp"

namespace graybox {
namespace {

constexpr double kNegligible = 0.01;

}  // namespace

void CommonError::take_out(Eigen::Ref<Eigen::MatrixXcd> columns) const {
  const Eigen::VectorXd shares = 1.0 - (1.0 + variances.array()).rsqrt();
  Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>> numbers(
      reinterpret_cast<double*>(columns.data()), 2 * columns.rows(), columns.cols(),
      Eigen::OuterStride<>(2 * columns.outerStride()));
  const Eigen::MatrixXd along = shares.asDiagonal() * (directions.transpose() * numbers);
  numbers.noalias() -= directions * along;
}

Eigen::MatrixXcd CommonError::inverse_directions() const {
  const Eigen::VectorXd shares = (variances.array() / (1.0 + variances.array())).sqrt();
  const Eigen::Map<const Eigen::MatrixXcd> complex(
      reinterpret_cast<const std::complex<double>*>(directions.data()), directions.rows() / 2,
      directions.cols());
  return complex * shares.asDiagonal();
}

CommonError common_error(const Eigen::MatrixXcd& motion,
                         const Eigen::LLT<Eigen::MatrixXd>& information) {
  // m I^-1 m^T = B B^T with B = m L^-T, I = L L^T; its eigenvectors are B P v^(-1/2) with those of
  // B^T B.
  const Eigen::MatrixXd moved =
      information.matrixL().solve(as_real(motion).transpose()).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(moved.transpose() * moved);
  const auto count = (eigen.eigenvalues().array() > kNegligible).count();
  CommonError result;
  result.variances = eigen.eigenvalues().tail(count);
  result.directions = moved * eigen.eigenvectors().rightCols(count) *
                      result.variances.cwiseSqrt().cwiseInverse().asDiagonal();
  return result;
}

}  // namespace graybox
