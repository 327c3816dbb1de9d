#include "diagnosis/studies/estimator_statistics.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/quantile.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

constexpr double kLowerTail = (1.0 - kConfidence) / 2.0;
constexpr double kUpperTail = 1.0 - kLowerTail;

// The lower triangular A of S = A A^T ~ Wishart_d(freedom, I).
void draw_bartlett(double freedom, Random& random, Eigen::MatrixXd& factor) {
  for (Eigen::Index i = 0; i < factor.rows(); ++i) {
    const double left = freedom - static_cast<double>(i);
    // One degree of freedom is the square of a normal number.
    factor(i, i) =
        left < 2.0 ? std::abs(random.normal()) : std::sqrt(2.0 * random.gamma(left / 2.0));
    for (Eigen::Index j = 0; j < i; ++j) factor(i, j) = random.normal();
  }
}

// (det S)^(1/d) / freedom.
double determinant_root(const Eigen::MatrixXd& factor, double freedom) {
  return std::exp(2.0 * factor.diagonal().array().log().mean()) / freedom;
}

void check(const Eigen::MatrixXd& estimates) {
  if (estimates.rows() <= estimates.cols() || estimates.cols() < 1) {
    throw InputError(fmt::format("covariance of {} estimates of {} parameters: more are needed",
                                 estimates.rows(), estimates.cols()));
  }
  if (!estimates.allFinite()) throw InputError("covariance of estimates: not all are finite");
}

// What sample estimates / truth is where the draws are sample quantiles / truth.
Interval interval_of(double ratio, std::vector<double>& draws) {
  std::ranges::sort(draws);
  return {ratio / quantile(draws, 0.5), ratio / quantile(draws, kUpperTail),
          ratio / quantile(draws, kLowerTail)};
}

double log_det(const Eigen::MatrixXd& matrix, const char* what) {
  const Eigen::LLT<Eigen::MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) {
    throw InputError(std::string(what) + " is not positive definite");
  }
  return 2.0 * Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
}

// Determinant and eigenvalues of S / (n - 1) against draws of Wishart matrices.
void compare_with_wishart(const Eigen::MatrixXd& whitened, int draws,
                          EfficiencyStatistics& result) {
  const Eigen::Index d = whitened.cols();
  const auto freedom = static_cast<double>(whitened.rows() - 1);
  const Eigen::MatrixXd covariance = sample_covariance(whitened);
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;
  result.eigenvalues = Solver(covariance, Eigen::EigenvaluesOnly).eigenvalues();
  Random random(1);
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(d, d);
  std::vector<double> determinants;
  std::vector<std::vector<double>> eigenvalues(static_cast<std::size_t>(d));
  Solver solver(d);
  for (int k = 0; k < draws; ++k) {
    draw_bartlett(freedom, random, factor);
    determinants.push_back(determinant_root(factor, freedom));
    solver.compute(factor * factor.transpose() / freedom, Eigen::EigenvaluesOnly);
    for (Eigen::Index i = 0; i < d; ++i) {
      eigenvalues[static_cast<std::size_t>(i)].push_back(solver.eigenvalues()(i));
    }
  }
  const double ratio =
      std::exp(log_det(covariance, "the sample covariance") / static_cast<double>(d));
  result.determinant = interval_of(ratio, determinants);
  result.eigenvalues_lower.resize(d);
  result.eigenvalues_upper.resize(d);
  for (Eigen::Index i = 0; i < d; ++i) {
    std::vector<double>& drawn = eigenvalues[static_cast<std::size_t>(i)];
    std::ranges::sort(drawn);
    result.eigenvalues_lower(i) = quantile(drawn, kLowerTail);
    result.eigenvalues_upper(i) = quantile(drawn, kUpperTail);
  }
}

void test_bias(const Eigen::MatrixXd& errors, EfficiencyStatistics& result) {
  const auto n = static_cast<double>(errors.rows());
  const auto d = static_cast<double>(errors.cols());
  const Eigen::VectorXd mean = errors.colwise().mean();
  const Eigen::MatrixXd covariance = sample_covariance(errors);
  result.bias = std::sqrt(n) * mean.cwiseQuotient(covariance.diagonal().cwiseSqrt());
  const double hotelling = n * mean.dot(covariance.llt().solve(mean));
  result.bias_p_value = fisher_tail(hotelling * (n - d) / (d * (n - 1.0)), d, n - d);
}

}  // namespace

Eigen::MatrixXd sample_covariance(const Eigen::MatrixXd& estimates) {
  const Eigen::MatrixXd centred = estimates.rowwise() - estimates.colwise().mean();
  return centred.transpose() * centred / static_cast<double>(estimates.rows() - 1);
}

EfficiencyStatistics compare_with_prediction(const Eigen::MatrixXd& estimates,
                                             const Eigen::VectorXd& theta,
                                             const Eigen::MatrixXd& covariance, int draws) {
  check(estimates);
  const Eigen::Index d = estimates.cols();
  if (theta.size() != d || covariance.rows() != d || covariance.cols() != d) {
    throw InputError("estimates, parameters and predicted covariance differ in size");
  }
  EfficiencyStatistics result;
  result.estimates = static_cast<std::size_t>(estimates.rows());
  const Eigen::MatrixXd errors = estimates.rowwise() - theta.transpose();
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) {
    throw InputError("the predicted covariance is not positive definite");
  }
  // L^-1 of C = L L^T serves as H^(1/2): det, trace and eigenvalues are the same.
  const Eigen::MatrixXd whitened = factor.matrixL().solve(errors.transpose()).transpose();
  compare_with_wishart(whitened, draws, result);

  const double freedom = static_cast<double>(estimates.rows() - 1);
  const double all = freedom * static_cast<double>(d);
  const double sum = freedom * sample_covariance(whitened).trace();
  result.trace = {sum / all, sum / chi_square_quantile(kUpperTail, all),
                  sum / chi_square_quantile(kLowerTail, all)};
  const double tail = chi_square_tail(sum, all);
  result.trace_p_value = 2.0 * std::min(tail, 1.0 - tail);

  const Eigen::VectorXd variances = sample_covariance(errors).diagonal();
  for (Eigen::Index p = 0; p < d; ++p) {
    const double ratio = variances(p) / covariance(p, p);
    result.variances.push_back({ratio, ratio * freedom / chi_square_quantile(kUpperTail, freedom),
                                ratio * freedom / chi_square_quantile(kLowerTail, freedom)});
  }
  test_bias(errors, result);
  return result;
}

CovarianceRatio compare_covariances(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                                    int draws) {
  check(first);
  check(second);
  if (first.cols() != second.cols()) throw InputError("estimates of different parameters");
  const Eigen::Index d = first.cols();
  const Eigen::MatrixXd covariance_1 = sample_covariance(first);
  const Eigen::MatrixXd covariance_2 = sample_covariance(second);
  const auto freedom_1 = static_cast<double>(first.rows() - 1);
  const auto freedom_2 = static_cast<double>(second.rows() - 1);

  Random random(1);
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(d, d);
  std::vector<double> ratios;
  for (int k = 0; k < draws; ++k) {
    draw_bartlett(freedom_1, random, factor);
    const double below = determinant_root(factor, freedom_1);
    draw_bartlett(freedom_2, random, factor);
    ratios.push_back(determinant_root(factor, freedom_2) / below);
  }
  const double difference =
      log_det(covariance_2, "a sample covariance") - log_det(covariance_1, "a sample covariance");
  CovarianceRatio result;
  result.determinant = interval_of(std::exp(difference / static_cast<double>(d)), ratios);
  for (Eigen::Index p = 0; p < d; ++p) {
    const double ratio = covariance_2(p, p) / covariance_1(p, p);
    result.variances.push_back({ratio, ratio / fisher_quantile(kUpperTail, freedom_2, freedom_1),
                                ratio / fisher_quantile(kLowerTail, freedom_2, freedom_1)});
  }
  return result;
}

Interval share_of(std::size_t successes, std::size_t trials) {
  if (trials == 0 || successes > trials) throw InputError("a share needs trials");
  const auto n = static_cast<double>(trials);
  const double share = static_cast<double>(successes) / n;
  const double z = normal_quantile(kUpperTail);
  const double centre = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half =
      z * std::sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n)) / (1.0 + z * z / n);
  return {share, centre - half, centre + half};
}

}  // namespace graybox
