#include "diagnosis/responses/settling.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/signals/real_transform.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kRounding = 1e-12;  // of the signal's rms

// 1 + 2 sum of rho(tau)^2 over lags up to an eighth of the signal. By its power spectrum, padded.
double variance_inflation(const Eigen::VectorXd& signal) {
  const Index size = signal.size();
  Eigen::VectorXd padded = Eigen::VectorXd::Zero(2 * size);
  padded.head(size) = signal.array() - signal.mean();
  RealTransform transform(static_cast<std::size_t>(2 * size));
  const Eigen::VectorXd power = transform.run(padded).cwiseAbs2();
  // The inverse transform of a real even spectrum is the forward one.
  Eigen::VectorXd even(2 * size);
  even.head(size + 1) = power;
  even.tail(size - 1) = power.segment(1, size - 1).reverse();
  const Eigen::VectorXd correlation = transform.run(even).real();
  const Index lags = std::max<Index>(1, size / 8);
  const double sum = correlation.segment(1, lags).squaredNorm() / std::pow(correlation(0), 2);
  // Of a white signal rho^2 is about 1/size at every lag.
  return 1.0 + 2.0 * std::max(0.0, sum - static_cast<double>(lags) / static_cast<double>(size));
}

}  // namespace

double settling_p_value(const Eigen::Ref<const Eigen::VectorXd>& signal, std::size_t period) {
  const auto n = static_cast<Index>(period);
  const Index quarter = n / 4;
  if (quarter < 4) return 1.0;
  const Eigen::VectorXd difference = signal.segment(n, n) - signal.head(n);
  const double first = difference.head(quarter).squaredNorm();
  const double last = difference.tail(quarter).squaredNorm();
  const double floor = kRounding * kRounding * signal.head(n).squaredNorm();
  if (!(first > floor)) return 1.0;
  if (!(last > 1e-3 * floor)) return 0.0;
  const double effective =
      static_cast<double>(quarter) / variance_inflation(difference.tail(n / 2));
  return fisher_tail(first / last, effective, effective);
}

}  // namespace graybox
