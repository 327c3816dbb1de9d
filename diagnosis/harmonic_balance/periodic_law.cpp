#include "diagnosis/harmonic_balance/periodic_law.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string_view>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;

constexpr int kRuns = 2;  // through the period; the last counts

// The mean of a time and the next, around the period.
double halfway(const Eigen::VectorXd& times, Eigen::Index t) {
  return 0.5 * (times(t) + times(t + 1 == times.size() ? 0 : t + 1));
}

// (e^x - 1) / x; where x is small by its series, to rounding.
double relative_growth(double x) {
  if (std::abs(x) > 0.05) return std::expm1(x) / x;
  double sum = 1.0;
  for (const double n : {8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0}) sum = 1.0 + sum * x / n;
  return sum;
}

}  // namespace

Complex LinearForce::response(double w) const {
  const Complex spring(stiffness, w * damping);
  return swings ? -w * w * inertia * transmission(w) : spring - w * w * inertia;
}

Complex LinearForce::transmission(double w) const {
  const Complex spring(stiffness, w * damping);
  return spring / (spring - w * w * inertia);
}

void require_one_state(const LawEntry& entry) {
  if (entry.definition.empty()) return;  // graybox's own have one at most
  const std::vector<double> any(entry.parameters.size(), 1.0);
  const std::size_t states = entry.make(any)->state_count();
  if (states <= 1) return;
  throw InputError(
      fmt::format("laws: {}: states: there are {}, but periodic recordings are diagnosed with laws "
                  "of one state at "
                  "most; leave one out, or describe the drive as graybox-rigid-robot/1",
                  entry.name, states));
}

PeriodicLaw::PeriodicLaw(const LawEntry& entry, std::span<const double> parameters)
    : entry_(&entry), parameters_(parameters.begin(), parameters.end()) {
  if (entry.make && !is_linear()) law_ = entry.make(parameters);
}

std::optional<Complex> PeriodicLaw::response(double w) const {
  const std::string_view name = entry_->name;
  const auto& p = parameters_;
  constexpr Complex i(0.0, 1.0);
  if (entry_->use == LawUse::kDelay) return std::polar(1.0, -w * p[0]) - 1.0;
  if (entry_->use == LawUse::kSignal) {
    if (name == "gain") return p[0];
    if (name == "lag") return 1.0 / (1.0 + i * w * p[0]) - 1.0;
    return {};
  }
  const std::optional<LinearForce> force = linear_force();
  return force ? std::optional(force->response(w)) : std::nullopt;
}

std::optional<LinearForce> PeriodicLaw::linear_force() const {
  const std::string_view name = entry_->name;
  const auto& p = parameters_;
  if (entry_->use == LawUse::kInertia) return LinearForce{.inertia = p[0]};
  if (entry_->use == LawUse::kDelay || entry_->use == LawUse::kSignal) return {};
  if (name == "stiffness") return LinearForce{.stiffness = p[0]};
  if (name == "viscous") return LinearForce{.damping = p[0]};
  if (name == "mode") {
    const double natural = 2.0 * std::numbers::pi * p[1];
    return LinearForce{.inertia = p[0],
                       .damping = 2.0 * p[2] * natural * p[0],
                       .stiffness = natural * natural * p[0],
                       .swings = true};
  }
  return {};
}

void PeriodicLaw::force(const PeriodicMotion& motion, Eigen::VectorXd& times) const {
  times.resize(motion.deflection.size());
  if (law_->state_count() > 0) {
    Eigen::VectorXd states;
    march(motion, states);
    for (Eigen::Index t = 0; t < times.size(); ++t) {
      times(t) = law_->force(motion.deflection(t), motion.rate(t), {&states(t), 1});
    }
    return;
  }
  for (Eigen::Index t = 0; t < times.size(); ++t) {
    times(t) = law_->force(motion.deflection(t), motion.rate(t), {});
  }
}

PeriodicLaw::Advance PeriodicLaw::advanced(double deflection, double rate, double state,
                                           double step) const {
  const StateRate change = law_->state_rate_and_slope(deflection, rate, state);
  const double growth = change.by_state * step;
  const double relative = relative_growth(growth);
  return {state + change.value * step * relative, 1.0 + growth * relative};
}

// The states at the times of the grid.
void PeriodicLaw::march(const PeriodicMotion& motion, Eigen::VectorXd& states) const {
  const Eigen::Index count = motion.deflection.size();
  states.resize(count);
  double state = 0.0;
  law_->rest(motion.deflection(0), {&state, 1});
  for (int run = 0; run < kRuns; ++run) {
    for (Eigen::Index t = 0; t < count; ++t) {
      states(t) = state;
      state = advanced(halfway(motion.deflection, t), halfway(motion.rate, t), state, motion.step)
                  .state;
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

void PeriodicLaw::linearise(const PeriodicMotion& motion, LawTangent& tangent) const {
  const Eigen::Index count = motion.deflection.size();
  const double root = std::sqrt(static_cast<double>(count));
  const double dz = 1e-4 * motion.deflection.norm() / root + 1e-300;
  const double dv = 1e-4 * motion.rate.norm() / root + 1e-300;
  tangent.by_deflection.resize(count);
  tangent.by_rate.resize(count);
  if (has_states()) {
    linearise_state(motion, dz, dv, tangent);
    return;
  }
  for (Eigen::Index t = 0; t < count; ++t) {
    const double z = motion.deflection(t), v = motion.rate(t);
    tangent.by_deflection(t) =
        (law_->force(z + dz, v, {}) - law_->force(z - dz, v, {})) / (2.0 * dz);
    tangent.by_rate(t) = (law_->force(z, v + dv, {}) - law_->force(z, v - dv, {})) / (2.0 * dv);
  }
}

// One-sided differences: a state is dearer than a force, and as good as smooth but where it turns.
void PeriodicLaw::linearise_state(const PeriodicMotion& motion, double dz, double dv,
                                  LawTangent& tangent) const {
  Eigen::VectorXd states;
  march(motion, states);
  const Eigen::Index count = states.size();
  const double ds = 1e-4 * states.norm() / std::sqrt(static_cast<double>(count)) + 1e-300;
  for (auto* values :
       {&tangent.by_state, &tangent.growth, &tangent.state_by_deflection, &tangent.state_by_rate}) {
    values->resize(count);
  }
  for (Eigen::Index t = 0; t < count; ++t) {
    const double z = motion.deflection(t), v = motion.rate(t), s = states(t), beside = s + ds;
    const double force = law_->force(z, v, {&s, 1});
    tangent.by_deflection(t) = (law_->force(z + dz, v, {&s, 1}) - force) / dz;
    tangent.by_rate(t) = (law_->force(z, v + dv, {&s, 1}) - force) / dv;
    tangent.by_state(t) = (law_->force(z, v, {&beside, 1}) - force) / ds;
    const double z_on = halfway(motion.deflection, t), v_on = halfway(motion.rate, t);
    const Advance on = advanced(z_on, v_on, s, motion.step);
    tangent.growth(t) = on.growth;
    tangent.state_by_deflection(t) =
        (advanced(z_on + dz, v_on, s, motion.step).state - on.state) / dz;
    tangent.state_by_rate(t) = (advanced(z_on, v_on + dv, s, motion.step).state - on.state) / dv;
  }
}

void LawTangent::apply(const PeriodicMotion& change, Eigen::VectorXd& times) const {
  times = by_deflection.cwiseProduct(change.deflection) + by_rate.cwiseProduct(change.rate);
  if (by_state.size() == 0) return;
  double state = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    for (Eigen::Index t = 0; t < times.size(); ++t) {
      if (run + 1 == kRuns) times(t) += by_state(t) * state;
      state = growth(t) * state + state_by_deflection(t) * halfway(change.deflection, t) +
              state_by_rate(t) * halfway(change.rate, t);
    }
  }
}

}  // namespace graybox
