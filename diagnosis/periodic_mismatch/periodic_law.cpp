#include "graybox/diagnosis/periodic_mismatch/periodic_law.hpp"

#include <cmath>
#include <numbers>
#include <string_view>

namespace graybox {
namespace {

using Complex = std::complex<double>;

// phi_1(x) = (e^x - 1) / x
double relative_growth(double x) { return std::abs(x) < 1e-12 ? 1.0 : std::expm1(x) / x; }

}  // namespace

PeriodicLaw::PeriodicLaw(const LawEntry& entry, std::span<const double> parameters)
    : entry_(&entry), parameters_(parameters.begin(), parameters.end()) {
  if (entry.make && !is_linear()) law_ = entry.make(parameters);
}

std::optional<Complex> PeriodicLaw::response(double w) const {
  const std::string_view name = entry_->name;
  const auto& p = parameters_;
  constexpr Complex i(0.0, 1.0);
  if (entry_->use == LawUse::kInertia) return -w * w * p[0];
  if (entry_->use == LawUse::kDelay) return std::polar(1.0, -w * p[0]) - 1.0;
  if (entry_->use == LawUse::kSignal) {
    if (name == "gain") return p[0];
    if (name == "lag") return 1.0 / (1.0 + i * w * p[0]) - 1.0;
    return {};
  }
  if (name == "stiffness") return p[0];
  if (name == "viscous") return i * w * p[0];
  if (name == "mode") {
    const double natural = 2.0 * std::numbers::pi * p[1];
    const Complex spring = p[0] * natural * (natural + 2.0 * i * w * p[2]);
    return -w * w * p[0] * spring / (spring - w * w * p[0]);
  }
  return {};
}

void PeriodicLaw::force(const PeriodicMotion& motion, Eigen::VectorXd& times) const {
  times.resize(motion.deflection.size());
  if (law_->state_count() > 0) {
    march(motion, times);
    return;
  }
  for (Eigen::Index t = 0; t < times.size(); ++t) {
    times(t) = law_->force(motion.deflection(t), motion.rate(t), {});
  }
}

void PeriodicLaw::march(const PeriodicMotion& motion, Eigen::VectorXd& times) const {
  double state = 0.0;
  double rate = 0.0, shifted_rate = 0.0;
  law_->rest(motion.deflection(0), {&state, 1});
  const Eigen::Index count = times.size();
  for (int run = 0; run < 2; ++run) {
    for (Eigen::Index t = 0; t < count; ++t) {
      times(t) = law_->force(motion.deflection(t), motion.rate(t), {&state, 1});
      const Eigen::Index next = t + 1 == count ? 0 : t + 1;
      const double z = 0.5 * (motion.deflection(t) + motion.deflection(next));
      const double v = 0.5 * (motion.rate(t) + motion.rate(next));
      law_->state_rate(z, v, {&state, 1}, {&rate, 1});
      const double shift = 1e-6 * (std::abs(state) + std::abs(rate) * motion.step) + 1e-300;
      const double shifted = state + shift;
      law_->state_rate(z, v, {&shifted, 1}, {&shifted_rate, 1});
      const double slope = (shifted_rate - rate) / shift;
      state += rate * motion.step * relative_growth(slope * motion.step);
    }
  }
}

std::pair<double, double> PeriodicLaw::describing_slopes(const PeriodicMotion& motion) const {
  Eigen::VectorXd f;
  force(motion, f);
  const Eigen::VectorXd swing = motion.deflection.array() - motion.deflection.mean();
  const double size = swing.squaredNorm(), speed = motion.rate.squaredNorm();
  return {size > 0.0 ? f.dot(swing) / size : 0.0, speed > 0.0 ? f.dot(motion.rate) / speed : 0.0};
}

void PeriodicLaw::slopes(const PeriodicMotion& motion, Eigen::VectorXd& by_deflection,
                         Eigen::VectorXd& by_rate) const {
  const Eigen::Index count = motion.deflection.size();
  const double root = std::sqrt(static_cast<double>(count));
  const double dz = 1e-4 * motion.deflection.norm() / root + 1e-300;
  const double dv = 1e-4 * motion.rate.norm() / root + 1e-300;
  by_deflection.resize(count);
  by_rate.resize(count);
  for (Eigen::Index t = 0; t < count; ++t) {
    const double z = motion.deflection(t), v = motion.rate(t);
    by_deflection(t) = (law_->force(z + dz, v, {}) - law_->force(z - dz, v, {})) / (2.0 * dz);
    by_rate(t) = (law_->force(z, v + dv, {}) - law_->force(z, v - dv, {})) / (2.0 * dv);
  }
}

}  // namespace graybox
