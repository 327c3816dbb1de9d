#include "diagnosis/first_masses/free_response.hpp"

#include <Eigen/QR>
#include <cmath>

namespace graybox {
namespace {

// (1 - exp(-x))/x and (1 - that)/x, by series where x is small.
double phi_one(double x) { return x < 1e-8 ? 1.0 - 0.5 * x : -std::expm1(-x) / x; }
double phi_two(double x) {
  return x < 1e-3 ? 0.5 - x / 6.0 + x * x / 24.0 : (1.0 - phi_one(x)) / x;
}

}  // namespace

FreeResponse::FreeResponse(double pole, double step, bool is_velocity, Eigen::Index length)
    : is_velocity_(is_velocity),
      decay_(std::exp(-pole * step)),
      by_speed_(phi_one(pole * step) * step),
      by_force_(phi_two(pole * step) * step * step),
      speed_by_force_(phi_one(pole * step) * step) {
  Eigen::MatrixXd starts(length, is_velocity ? 1 : 2);
  for (Eigen::Index k = 0; k < length; ++k) {
    const double t = static_cast<double>(k) * step;
    starts(k, 0) = is_velocity ? std::exp(-pole * t) : 1.0;
    if (!is_velocity) starts(k, 1) = t * phi_one(pole * t) / (static_cast<double>(length) * step);
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(starts);
  starts_ = qr.householderQ() * Eigen::MatrixXd::Identity(length, starts.cols());
}

Eigen::VectorXd FreeResponse::of(const Eigen::Ref<const Eigen::VectorXd>& force) const {
  Eigen::VectorXd result(force.size());
  double x = 0.0, v = 0.0;
  for (Eigen::Index k = 0; k < force.size(); ++k) {
    result(k) = is_velocity_ ? v : x;
    x += by_speed_ * v + by_force_ * force(k);
    v = decay_ * v + speed_by_force_ * force(k);
  }
  return result;
}

Eigen::MatrixXd FreeResponse::without_start(
    const Eigen::Ref<const Eigen::MatrixXd>& segment) const {
  return segment - starts_ * (starts_.transpose() * segment);
}

}  // namespace graybox
