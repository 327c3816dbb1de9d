#include "graybox/diagnosis/hypotheses/law_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace graybox {
namespace {

using Eigen::VectorXd;

double quantile_of(const std::vector<double>& sorted, double quantile) {
  if (sorted.empty()) return 0.0;
  const double place = quantile * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double share = place - static_cast<double>(below);
  return (1.0 - share) * sorted[below] + share * sorted[above];
}

// One amplitude, the parameter at `index`; the others are as given.
LawShape single(std::vector<double> unit, std::size_t index, bool positive) {
  LawShape shape;
  shape.basis = {unit};
  shape.parameters = [unit, index, positive](const VectorXd& amplitudes) {
    if (positive && !(amplitudes(0) > 0.0)) return std::vector<double>();
    std::vector<double> parameters = unit;
    parameters[index] *= amplitudes(0);
    return parameters;
  };
  return shape;
}

// Thresholds that divide the recorded motion: small ones geometrically, large ones by quantiles.
std::vector<double> thresholds(const MotionScale& scale) {
  std::vector<double> values;
  for (const double quantile : {0.01, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.995}) {
    const double value = scale.deflection(quantile);
    if (value > 0.0 && (values.empty() || value > 1.05 * values.back())) values.push_back(value);
  }
  return values;
}

std::vector<double> transition_velocities(const MotionScale& scale) {
  std::vector<double> values;
  for (const double quantile : {0.003, 0.03, 0.15}) {
    if (scale.rate(quantile) > 0.0) values.push_back(scale.rate(quantile));
  }
  return values;
}

std::vector<LawShape> backlash(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double gap : thresholds(scale)) shapes.push_back(single({gap, 1.0}, 1, true));
  return shapes;
}

std::vector<LawShape> dead_zone(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double clearance : thresholds(scale)) {
    if (clearance < scale.deflection(0.99)) shapes.push_back(single({clearance, 1.0}, 1, false));
  }
  return shapes;
}

std::vector<LawShape> coulomb(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale)) shapes.push_back(single({1.0, v}, 0, true));
  return shapes;
}

std::vector<LawShape> asymmetric_coulomb(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale)) {
    LawShape shape;
    shape.basis = {{1.0, 0.0, v}, {0.0, 1.0, v}};
    shape.parameters = [v](const VectorXd& a) {
      if (!(a.maxCoeff() > 0.0)) return std::vector<double>();
      return std::vector<double>{std::max(a(0), 0.0), std::max(a(1), 0.0), v};
    };
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

// F_c tanh + (F_s - F_c) exp(..) tanh: the second basis has no level of its own.
std::vector<LawShape> stribeck(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale)) {
    for (const double quantile : {0.15, 0.4, 0.7}) {
      const double slow = scale.rate(quantile);
      if (!(slow > 2.0 * v)) continue;
      LawShape shape;
      shape.basis = {{1.0, 0.0, slow, v}, {0.0, 1.0, slow, v}};
      shape.parameters = [v, slow](const VectorXd& a) {
        if (!(a.maxCoeff() > 0.0)) return std::vector<double>();
        return std::vector<double>{std::max(a(0), 0.0), std::max(a(1), 0.0), slow, v};
      };
      shapes.push_back(std::move(shape));
    }
  }
  return shapes;
}

LawShape ripple_of(double period) {
  LawShape shape;
  shape.basis = {{1.0, period, 0.0}, {1.0, period, 0.5 * std::numbers::pi}};
  shape.parameters = [period](const VectorXd& a) {
    return std::vector<double>{std::hypot(a(0), a(1)), period, std::atan2(a(1), a(0))};
  };
  return shape;
}

std::vector<LawShape> ripple(const CandidatePlace& place, const MotionScale& scale) {
  std::vector<LawShape> shapes;
  if (place.turns) {
    for (const double waves : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 24.0, 36.0, 48.0}) {
      const double period = 2.0 * std::numbers::pi / waves;
      if (period < 4.0 * scale.range) shapes.push_back(ripple_of(period));
    }
  }
  if (!place.turns || shapes.empty()) {
    for (const double waves : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}) {
      if (scale.range > 0.0) shapes.push_back(ripple_of(scale.range / waves));
    }
  }
  return shapes;
}

std::vector<LawShape> dahl(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double quantile : {0.02, 0.1, 0.3, 0.6, 0.95}) {
    const double reach = scale.deflection(quantile);  // F_c / stiffness
    if (!(reach > 0.0)) continue;
    LawShape shape;
    shape.basis = {{1.0 / reach, 1.0}};
    shape.parameters = [reach](const VectorXd& a) {
      if (!(a(0) > 0.0)) return std::vector<double>();
      return std::vector<double>{a(0) / reach, a(0)};
    };
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

// Bristles without Stribeck effect and damping; the refit finds those.
std::vector<LawShape> lugre(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double quantile : {0.02, 0.1, 0.3}) {
    const double reach = scale.deflection(quantile);
    const double slow = scale.rate(0.2);
    if (!(reach > 0.0) || !(slow > 0.0)) continue;
    const double damping = 0.3 * reach / slow;  // s_1 / F_c
    LawShape shape;
    shape.basis = {{1.0 / reach, damping / reach * 1e-3, 0.0, 1.0, 1.2, slow}};
    shape.parameters = [reach, slow](const VectorXd& a) {
      if (!(a(0) > 0.0)) return std::vector<double>();
      return std::vector<double>{a(0) / reach, 1e-3 * a(0) / slow, 1e-3 * a(0) / slow,
                                 a(0),         1.2 * a(0),         slow};
    };
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

std::vector<LawShape> bouc_wen(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double quantile : {0.1, 0.3, 0.6, 0.95}) {
    const double yield = scale.deflection(quantile);
    if (yield > 0.0) shapes.push_back(single({1.0, yield, 2.0, 0.5}, 0, true));
  }
  return shapes;
}

std::vector<LawShape> mode(const MotionScale& scale) {
  constexpr int kFrequencies = 24;
  std::vector<LawShape> shapes;
  for (int i = 0; i <= kFrequencies; ++i) {
    const double share = static_cast<double>(i) / kFrequencies;
    const double frequency = scale.lowest * std::pow(1.5 * scale.highest / scale.lowest, share);
    shapes.push_back(single({1.0, frequency, 0.03}, 0, true));
  }
  return shapes;
}

std::vector<LawShape> payload() {
  std::vector<LawShape> shapes;
  for (const double x : {-0.25, 0.0, 0.25}) {
    for (const double y : {-0.25, 0.0, 0.25}) {
      for (const double z : {0.0, 0.25}) {
        shapes.push_back(single({1.0, x, y, z}, 0, true));
      }
    }
  }
  return shapes;
}

// Laws without amplitude: as they are.
LawShape as_it_is(std::vector<double> parameters) {
  LawShape shape;
  shape.basis = {parameters};
  shape.parameters = [parameters](const VectorXd& a) {
    return a(0) > 0.0 ? parameters : std::vector<double>();
  };
  return shape;
}

// First order in a short time, which is its amplitude.
LawShape short_time() {
  constexpr double kShort = 1e-6;  // s
  LawShape shape;
  shape.basis = {{kShort}};
  shape.parameters = [](const VectorXd& a) {
    if (!(a(0) > 0.0)) return std::vector<double>();
    return std::vector<double>{kShort * a(0)};
  };
  return shape;
}

std::vector<LawShape> signal_shapes(const LawEntry& entry, const MotionScale& scale) {
  if (entry.name == "gain") return {single({1.0}, 0, false)};
  if (entry.name == "lag" || entry.name == "delay") return {short_time()};
  std::vector<LawShape> shapes;
  if (entry.name == "saturation") {
    for (const double quantile : {0.999, 0.98, 0.9, 0.7, 0.5}) {
      if (scale.deflection(quantile) > 0.0) {
        shapes.push_back(as_it_is({scale.deflection(quantile)}));
      }
    }
  } else if (entry.name == "dead_zone") {
    for (const double quantile : {0.01, 0.05, 0.15, 0.4, 0.7}) {
      if (scale.deflection(quantile) > 0.0) {
        shapes.push_back(as_it_is({scale.deflection(quantile)}));
      }
    }
  }
  return shapes;
}

}  // namespace

double MotionScale::deflection(double quantile) const { return quantile_of(deflections, quantile); }
double MotionScale::rate(double quantile) const { return quantile_of(rates, quantile); }

std::vector<LawShape> law_shapes(const LawEntry& entry, const CandidatePlace& place,
                                 const MotionScale& scale) {
  const std::string& name = entry.name;
  if (place.location.kind != LocationKind::kElement) return signal_shapes(entry, scale);
  if (name == "payload") return payload();
  if (name == "backlash") return backlash(scale);
  if (name == "dead_zone") return dead_zone(scale);
  if (name == "coulomb") return coulomb(scale);
  if (name == "asymmetric_coulomb") return asymmetric_coulomb(scale);
  if (name == "stribeck") return stribeck(scale);
  if (name == "ripple") return ripple(place, scale);
  if (name == "dahl") return dahl(scale);
  if (name == "lugre") return lugre(scale);
  if (name == "bouc_wen") return bouc_wen(scale);
  if (name == "mode") return mode(scale);
  const bool is_positive = entry.parameters.front().range != ParameterRange::kAny;
  return {single({1.0}, 0, is_positive)};
}

std::vector<std::string> special_cases_of(const LawEntry& entry) {
  const std::string& name = entry.name;
  if (name == "asymmetric_coulomb" || name == "dahl") return {"coulomb"};
  if (name == "stribeck") return {"coulomb"};
  if (name == "lugre") return {"coulomb", "stribeck", "dahl", "viscous"};
  if (name == "bouc_wen") return {"stiffness", "dahl", "coulomb"};
  if (name == "mode") return {"inertia", "stiffness", "viscous"};
  if (name == "dead_zone") return {"stiffness"};
  return {};
}

}  // namespace graybox
