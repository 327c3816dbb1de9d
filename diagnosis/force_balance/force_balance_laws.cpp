#include "graybox/diagnosis/force_balance/force_balance_laws.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace graybox {
namespace {

bool is_inertia(const LawEntry& entry) { return entry.use == LawUse::kInertia; }

// One amplitude at `index`, the other parameters as given.
LawShape one_amplitude(std::vector<double> parameters, std::size_t index, bool positive) {
  LawShape shape;
  shape.basis = {parameters};
  shape.parameters = [parameters, index, positive](const Eigen::VectorXd& amplitudes) {
    if (positive && !(amplitudes(0) > 0.0)) return std::vector<double>();
    std::vector<double> result = parameters;
    result[index] *= amplitudes(0);
    return result;
  };
  return shape;
}

// a sin + b cos of whole multiples of one turn, the place's own.
std::vector<LawShape> ripple_shapes(const MotionScale& scale) {
  constexpr int kHarmonics = 64;
  std::vector<LawShape> shapes;
  for (int harmonic = 1; harmonic <= kHarmonics; ++harmonic) {
    const double period = 2.0 * std::numbers::pi / harmonic;
    // Less than a period of motion tells no ripple.
    if (scale.range < period) continue;
    LawShape shape;
    shape.basis = {{1.0, period, 0.0}, {1.0, period, 0.5 * std::numbers::pi}};
    shape.parameters = [period](const Eigen::VectorXd& a) {
      return std::vector<double>{std::hypot(a(0), a(1)), period, std::atan2(a(1), a(0))};
    };
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

// Geometry in units of the anchor's distance; only ratios and the angle shape the torque.
std::vector<LawShape> balancer_shapes() {
  constexpr int kAngles = 12;
  std::vector<LawShape> shapes;
  for (const double lever : {0.15, 0.3, 0.6}) {
    for (const double free_length : {0.0, 0.4, 0.8}) {
      for (int k = 0; k < kAngles; ++k) {
        const double angle = 2.0 * std::numbers::pi * k / kAngles;
        shapes.push_back(one_amplitude({1.0, free_length, 1.0, lever, angle}, 0, true));
      }
    }
  }
  return shapes;
}

// One damping each way.
LawShape asymmetric_viscous_shape() {
  LawShape shape;
  shape.basis = {{1.0, 0.0}, {0.0, 1.0}};
  shape.parameters = [](const Eigen::VectorXd& a) { return std::vector<double>{a(0), a(1)}; };
  return shape;
}

std::vector<LawShape> sublinear_shapes(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  const double reference = scale.rate(0.9), transition = scale.rate(0.03);
  if (!(reference > 0.0) || !(transition > 0.0)) return shapes;
  for (const double exponent : {0.2, 0.4, 0.6, 0.8}) {
    shapes.push_back(one_amplitude({1.0, exponent, reference, transition}, 0, true));
  }
  return shapes;
}

}  // namespace

std::vector<std::size_t> PlacedLaw::linear() const {
  std::vector<std::size_t> result;
  if (is_inertia(*entry)) return {0};
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    if (entry->parameters[i].is_linear) result.push_back(i);
  }
  return result;
}

std::vector<std::size_t> PlacedLaw::refined() const {
  std::vector<std::size_t> result;
  if (is_inertia(*entry)) return result;
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    const LawParameter& parameter = entry->parameters[i];
    const bool is_scale =
        parameter.name == "anchor_distance" || parameter.name == "reference_velocity";
    if (!parameter.is_linear && !is_scale) result.push_back(i);
  }
  return result;
}

Eigen::VectorXd shape_rows(const CandidatePlace& place, const LawEntry& entry,
                           std::span<const double> parameters, const ForceBalanceRows& rows) {
  if (is_inertia(entry)) return parameters[0] * inertia_rows(place, rows);
  return law_rows(place, *entry.make(parameters), rows);
}

Eigen::MatrixXd linear_columns(const PlacedLaw& law, const ForceBalanceRows& rows) {
  const std::vector<std::size_t> linear = law.linear();
  Eigen::MatrixXd columns(rows.base.torque.size(), static_cast<Eigen::Index>(linear.size()));
  for (std::size_t k = 0; k < linear.size(); ++k) {
    std::vector<double> unit = law.parameters;
    for (const std::size_t other : linear) unit[other] = 0.0;
    unit[linear[k]] = 1.0;
    columns.col(static_cast<Eigen::Index>(k)) = shape_rows(*law.place, *law.entry, unit, rows);
  }
  return columns;
}

Eigen::VectorXd force_rows(const PlacedLaw& law, const ForceBalanceRows& rows) {
  return shape_rows(*law.place, *law.entry, law.parameters, rows);
}

std::vector<const LawEntry*> force_balance_laws(const CandidatePlace& place) {
  std::vector<const LawEntry*> laws;
  for (const LawEntry& entry : law_catalogue()) {
    if (entry.use != LawUse::kForce && entry.use != LawUse::kInertia) continue;
    // A hidden mass on a spring needs its own motion, which a force balance does not follow.
    if (entry.name == "mode") continue;
    if (entry.name == "balancer" && !place.turns) continue;
    laws.push_back(&entry);
  }
  return laws;
}

std::vector<LawShape> force_balance_shapes(const LawEntry& entry, const CandidatePlace& place,
                                           const MotionScale& scale) {
  if (is_inertia(entry)) return {one_amplitude({1.0}, 0, false)};
  if (entry.name == "balancer") return balancer_shapes();
  if (entry.name == "asymmetric_viscous") return {asymmetric_viscous_shape()};
  if (entry.name == "sublinear_friction") return sublinear_shapes(scale);
  if (entry.name == "offset") return {one_amplitude({1.0}, 0, false)};
  if (entry.name == "ripple" && place.turns) {
    std::vector<LawShape> shapes = ripple_shapes(scale);
    if (!shapes.empty()) return shapes;
  }
  return law_shapes(entry, place, scale);
}

MotionScale motion_scale(const CandidatePlace& place, const ForceBalanceRows& rows) {
  MotionScale scale;
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  double duration = 0.0, step = std::numeric_limits<double>::infinity();
  for (const Motion& piece : rows.pieces) {
    const PlaceMotion motion = motion_at(place, piece);
    for (Eigen::Index t = 0; t < motion.deflection.size(); ++t) {
      scale.deflections.push_back(std::abs(motion.deflection(t)));
      scale.rates.push_back(std::abs(motion.rate(t)));
      lowest = std::min(lowest, motion.deflection(t));
      highest = std::max(highest, motion.deflection(t));
    }
    if (motion.time.size() < 2) continue;
    const double piece_duration = motion.time(motion.time.size() - 1) - motion.time(0);
    duration = std::max(duration, piece_duration);
    step = std::min(step, piece_duration / static_cast<double>(motion.time.size() - 1));
  }
  std::sort(scale.deflections.begin(), scale.deflections.end());
  std::sort(scale.rates.begin(), scale.rates.end());
  scale.range = highest - lowest;
  scale.lowest = duration > 0.0 ? 1.0 / duration : 0.0;
  scale.highest = step > 0.0 ? 0.2 / step : 0.0;
  return scale;
}

}  // namespace graybox
