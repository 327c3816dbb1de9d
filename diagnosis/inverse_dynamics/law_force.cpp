#include "diagnosis/inverse_dynamics/law_force.hpp"

#include <array>
#include <cmath>
#include <span>

namespace graybox {
namespace {

// (e^x - 1) / x.
double phi_1(double x) { return std::abs(x) < 1e-8 ? 1.0 + 0.5 * x : std::expm1(x) / x; }

}  // namespace

Eigen::VectorXd law_force(const Law& law, const RecordedPlaceMotion& motion) {
  constexpr double kShare = 1e-3;  // of the step, for the slope along it
  const Eigen::Index n = motion.deflection.size();
  const std::size_t states = law.state_count();
  std::array<double, kMaxLawStates> storage{}, change{}, moved{}, moved_change{};
  const std::span<double> state(storage.data(), states);
  Eigen::VectorXd force(n);
  if (n > 0 && states > 0) law.rest(motion.deflection(0), state);
  for (Eigen::Index k = 0; k < n; ++k) {
    force(k) = law.force(motion.deflection(k), motion.rate(k), state);
    if (states == 0 || k + 1 == n) continue;
    const double step = motion.time(k + 1) - motion.time(k);
    const double z = 0.5 * (motion.deflection(k) + motion.deflection(k + 1));
    const double rate = 0.5 * (motion.rate(k) + motion.rate(k + 1));
    if (states == 1) {
      const auto [value, slope] = law.state_rate_and_slope(z, rate, storage[0]);
      if (value != 0.0) storage[0] += step * phi_1(step * slope) * value;
      continue;
    }
    law.state_rate(z, rate, state, {change.data(), states});
    for (std::size_t i = 0; i < states; ++i) {
      const double ahead = kShare * step * change[i];
      if (ahead == 0.0) continue;
      moved = storage;
      moved[i] += ahead;
      law.state_rate(z, rate, {moved.data(), states}, {moved_change.data(), states});
      const double slope = (moved_change[i] - change[i]) / ahead;
      storage[i] += step * phi_1(step * slope) * change[i];
    }
  }
  return force;
}

bool depends_on_position(const Law& law) {
  constexpr Eigen::Index kSamples = 200;
  constexpr double kEqual = 1e-9;
  RecordedPlaceMotion motion;
  motion.time = Eigen::VectorXd::LinSpaced(kSamples, 0.0, 2.0);
  motion.deflection = (3.0 * motion.time.array()).sin();
  motion.rate = 3.0 * (3.0 * motion.time.array()).cos();
  motion.acceleration = -9.0 * motion.deflection;
  const Eigen::VectorXd here = law_force(law, motion);
  motion.deflection.array() += 0.37;
  const Eigen::VectorXd elsewhere = law_force(law, motion);
  return !((elsewhere - here).norm() <= kEqual * here.norm());
}

}  // namespace graybox
