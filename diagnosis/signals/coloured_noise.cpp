#include "diagnosis/signals/coloured_noise.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Index = Eigen::Index;

// Autocorrelations at lags 0 to `last`.
Eigen::VectorXd autocorrelations(const Eigen::VectorXd& values, Index last) {
  const Index n = values.size();
  const double square = values.squaredNorm();
  Eigen::VectorXd result = Eigen::VectorXd::Unit(last + 1, 0);
  if (!(square > 0.0)) return result;
  for (Index lag = 1; lag <= last; ++lag) {
    result(lag) = values.head(n - lag).dot(values.tail(n - lag)) / square;
  }
  return result;
}

}  // namespace

ColouredNoise::ColouredNoise(const Eigen::VectorXd& values) : samples_(values.size()) {
  const auto n = static_cast<double>(samples_);
  deviation_ = std::sqrt(values.squaredNorm() / n);
  const Index last = std::min<Index>(static_cast<Index>(10.0 * std::log10(n)), samples_ / 4);
  const Eigen::VectorXd r = autocorrelations(values, last);
  Eigen::VectorXd a;
  double variance = 1.0, least = 0.0;
  for (Index order = 1; order <= last; ++order) {
    const double reflection = (r(order) - a.dot(r.segment(1, order - 1).reverse())) / variance;
    Eigen::VectorXd next(order);
    next.head(order - 1) = a - reflection * a.reverse();
    next(order - 1) = reflection;
    a = next;
    variance *= 1.0 - reflection * reflection;
    if (!(variance > 0.0)) break;
    const double criterion = n * std::log(variance) + static_cast<double>(order) * std::log(n);
    if (criterion >= least) continue;
    least = criterion;
    coefficients_ = a;
    innovation_ = variance;
  }
}

double ColouredNoise::effective_samples() const {
  const double gain = 1.0 - coefficients_.sum();
  const double time = innovation_ / (gain * gain);
  return static_cast<double>(samples_) / std::max(1.0, time);
}

Eigen::VectorXd ColouredNoise::draw(Random& random) const {
  // Long enough for the beginning at zero to be forgotten.
  const Index order = coefficients_.size(), ahead = 20 * order;
  Eigen::VectorXd values = Eigen::VectorXd::Zero(order + ahead + samples_);
  const double scale = deviation_ * std::sqrt(innovation_);
  for (Index t = order; t < values.size(); ++t) {
    values(t) = scale * random.normal();
    for (Index k = 0; k < order; ++k) values(t) += coefficients_(k) * values(t - 1 - k);
  }
  return values.tail(samples_);
}

}  // namespace graybox
