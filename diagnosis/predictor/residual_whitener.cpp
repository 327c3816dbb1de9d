#include "diagnosis/predictor/residual_whitener.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMemory = 10;  // samples

}  // namespace

ResidualWhitener::ResidualWhitener(const PredictionTask& task, Index outputs,
                                   const VectorXd& residuals)
    : task_(&task), outputs_(outputs), filter_(outputs, kMemory) {
  for (Index j = 0; j < outputs; ++j) fit(j, residuals);
}

VectorXd ResidualWhitener::apply(const VectorXd& residuals) const {
  VectorXd result = residuals;
  Index first = 0;
  for (const PredictionRun& run : task_->runs) {
    for (Index k = 0; k < run.samples; ++k) {
      for (Index j = 0; j < outputs_; ++j) {
        const Index at = first + k * outputs_ + j;
        const Index lags = std::min(k, kMemory);
        for (Index i = 1; i <= lags; ++i) {
          result(at) -= filter_(j, i - 1) * residuals(at - i * outputs_);
        }
      }
    }
    first += run.samples * outputs_;
  }
  return result;
}

void ResidualWhitener::fit(Index output, const VectorXd& residuals) {
  VectorXd covariance = VectorXd::Zero(kMemory + 1);
  Index first = 0;
  for (const PredictionRun& run : task_->runs) {
    for (Index k = 0; k < run.samples; ++k) {
      const Index at = first + k * outputs_ + output;
      for (Index i = 0; i <= std::min(k, kMemory); ++i) {
        covariance(i) += residuals(at) * residuals(at - i * outputs_);
      }
    }
    first += run.samples * outputs_;
  }
  MatrixXd toeplitz(kMemory, kMemory);
  for (Index i = 0; i < kMemory; ++i) {
    for (Index k = 0; k < kMemory; ++k) toeplitz(i, k) = covariance(std::abs(i - k));
  }
  toeplitz.diagonal() *= 1.0 + 1e-9;
  const VectorXd solved = toeplitz.colPivHouseholderQr().solve(VectorXd(covariance.tail(kMemory)));
  filter_.row(output) = solved.allFinite() ? solved.transpose()
                                           : Eigen::RowVectorXd(Eigen::RowVectorXd::Zero(kMemory));
}

double white_evidence(const PredictionTask& task, Index outputs, const VectorXd& poorer,
                      const VectorXd& richer) {
  const ResidualWhitener whitener(task, outputs, richer);
  const double left = whitener.apply(richer).squaredNorm();
  const double more = whitener.apply(poorer).squaredNorm() - left;
  return more / left * static_cast<double>(richer.size());
}

}  // namespace graybox
