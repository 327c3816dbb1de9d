#include "diagnosis/hypotheses/law_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

// Of the motion, below which a threshold leaves hardly anything to see of what is below it.
constexpr double kSmallShare = 0.05;

// Thresholds that divide the recorded motion: small ones geometrically, large ones by quantiles.
std::vector<double> thresholds(const MotionScale& scale) {
  std::vector<double> values;
  for (const double share : {0.01, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.995}) {
    const double value = scale.deflection(share);
    if (value > 0.0 && (values.empty() || value > 1.05 * values.back())) values.push_back(value);
  }
  return values;
}

std::vector<double> transition_velocities(const MotionScale& scale) {
  std::vector<double> values;
  for (const double share : {0.003, 0.03, 0.15}) {
    if (scale.rate(share) > 0.0) values.push_back(scale.rate(share));
  }
  const double widest = widest_transition(scale);
  if (scale.stands_under_force) {
    std::erase_if(values, [&](double value) { return value > widest; });
    if (values.empty() && widest > 0.0) values.push_back(widest);
  }
  return values;
}

// A play small against the motion shows by stiffness x gap alone; its flanks then are as stiff as
// the spring that has it.
LawShape small_backlash(double gap, double spring_stiffness) {
  constexpr double kOneParameter = 2.0;  // Akaike 1974
  LawShape shape = single_amplitude({gap, 1.0}, 1, true);
  shape.head_start = kOneParameter;
  shape.parameters = [gap, spring_stiffness](const VectorXd& a) {
    if (!(a(0) > 0.0)) return std::vector<double>();
    const double stiffness = std::max(a(0), spring_stiffness);
    return std::vector<double>{gap * a(0) / stiffness, stiffness};
  };
  return shape;
}

std::vector<LawShape> backlash(const CandidatePlace& place, const MotionScale& scale) {
  std::vector<LawShape> shapes;
  const double small = scale.deflection(kSmallShare);
  for (const double gap : thresholds(scale)) {
    shapes.push_back(gap <= small ? small_backlash(gap, place.spring_stiffness)
                                  : single_amplitude({gap, 1.0}, 1, true));
  }
  return shapes;
}

std::vector<LawShape> dead_zone(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double clearance : thresholds(scale)) {
    if (clearance < scale.deflection(0.99))
      shapes.push_back(single_amplitude({clearance, 1.0}, 1, false));
  }
  return shapes;
}

std::vector<LawShape> coulomb(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale))
    shapes.push_back(single_amplitude({1.0, v}, 0, true));
  return shapes;
}

std::vector<LawShape> asymmetric_coulomb(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale)) {
    LawShape shape;
    shape.basis = {{1.0, 0.0, v}, {0.0, 1.0, v}};
    shape.parameters = [v](const VectorXd& a) {
      if (!(a.sum() > 0.0)) return std::vector<double>();
      // Data that hardly see the difference of the levels still see their sum.
      if (!(a.minCoeff() > 0.0)) return std::vector<double>{0.5 * a.sum(), 0.5 * a.sum(), v};
      return std::vector<double>{a(0), a(1), v};
    };
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

// F_c tanh + (F_s - F_c) exp(..) tanh: the second basis has no level of its own.
std::vector<LawShape> stribeck(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double v : transition_velocities(scale)) {
    for (const double share : {0.15, 0.4, 0.7}) {
      const double slow = scale.rate(share);
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

// Whole multiples of a turn where the place turns by at least one period of them; besides waves of
// the recorded range, half a wave apart, where those leave them out.
std::vector<LawShape> ripple(const CandidatePlace& place, const MotionScale& scale) {
  constexpr int kHarmonics = 64;
  constexpr int kHalfWaves = 24, kHalfWavesOfLines = 120;  // magnets and screws of linear axes
  constexpr double kTurn = 2.0 * std::numbers::pi;
  std::vector<LawShape> shapes;
  if (!(scale.range > 0.0)) return shapes;
  for (int harmonic = 1; place.turns && harmonic <= kHarmonics; ++harmonic) {
    const double period = kTurn / harmonic;
    if (scale.range >= period) shapes.push_back(ripple_of(period));
  }
  const int most = scale.finest_wave > 0.0 ? kHalfWavesOfLines : kHalfWaves;
  for (int half_waves = 1; half_waves <= most; ++half_waves) {
    const double period = 2.0 * scale.range / half_waves;
    if (half_waves > kHalfWaves && period < scale.finest_wave) break;
    const bool is_whole_turn = period >= kTurn;
    const bool is_there = period <= scale.range && period >= kTurn / kHarmonics;
    if (!place.turns || !(is_whole_turn || is_there)) shapes.push_back(ripple_of(period));
  }
  return shapes;
}

std::vector<LawShape> dahl(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  for (const double share : {0.005, 0.02, 0.1, 0.3, 0.6, 0.95}) {
    const double reach = scale.excursion(share);  // F_c / stiffness
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
  for (const double share : {0.005, 0.02, 0.1, 0.3}) {
    const double reach = scale.excursion(share);
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
  for (const double share : {0.1, 0.3, 0.6, 0.95}) {
    const double yield = scale.excursion(share);
    if (yield > 0.0) shapes.push_back(single_amplitude({1.0, yield, 2.0, 0.5}, 0, true));
  }
  return shapes;
}

// A spring with play behind a slider: force and slip level scale together.
std::vector<LawShape> play_and_slip(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  // Shares of the motion's reach, not quantiles: a motion that rests or comes in bursts of several
  // sizes has quantiles far from each other, and either parameter may be the smaller.
  const double whole = scale.excursion(0.99);
  if (!(whole > 0.0)) return shapes;
  for (const double gap : {0.03 * whole, 0.1 * whole, 0.3 * whole}) {
    for (const double reach : {0.03 * whole, 0.1 * whole, 0.3 * whole, whole}) {
      LawShape shape;
      shape.basis = {{1.0, 0.1, gap, reach, 2.0}};
      shape.parameters = [gap, reach](const VectorXd& a) {
        if (!(a(0) > 0.0)) return std::vector<double>();
        return std::vector<double>{a(0), 0.1 * a(0), gap, reach * a(0), 2.0};
      };
      shapes.push_back(std::move(shape));
    }
  }
  return shapes;
}

// One damping each way.
LawShape asymmetric_viscous() {
  LawShape shape;
  shape.basis = {{1.0, 0.0}, {0.0, 1.0}};
  shape.parameters = [](const VectorXd& a) { return std::vector<double>{a(0), a(1)}; };
  return shape;
}

std::vector<LawShape> sublinear_friction(const MotionScale& scale) {
  std::vector<LawShape> shapes;
  const double reference = scale.rate(0.9);
  double transition = scale.rate(0.03);
  if (scale.stands_under_force) transition = std::min(transition, widest_transition(scale));
  if (!(reference > 0.0) || !(transition > 0.0)) return shapes;
  for (const double exponent : {0.2, 0.4, 0.6, 0.8}) {
    shapes.push_back(single_amplitude({1.0, exponent, reference, transition}, 0, true));
  }
  return shapes;
}

// Laws that a file defines: all amplitudes, for all combinations of what its other parameters are
// tried at.
std::vector<double> trial_values(const LawParameter& parameter, const MotionScale& scale) {
  std::vector<double> values = parameter.trials.values;
  for (const double share : parameter.trials.deflection_shares) {
    if (scale.deflection(share) > 0.0) values.push_back(scale.deflection(share));
  }
  for (const double share : parameter.trials.rate_shares) {
    if (scale.rate(share) > 0.0) values.push_back(scale.rate(share));
  }
  return values;
}

bool in_range(double value, ParameterRange range) {
  switch (range) {
    case ParameterRange::kAny:
      return true;
    case ParameterRange::kPositive:
      return value > 0.0;
    case ParameterRange::kNonNegative:
      return value >= 0.0;
    case ParameterRange::kUnitInterval:
      break;
  }
  return value >= 0.0 && value <= 1.0;
}

// `values`: of the parameters that are no amplitudes; the others are overwritten.
LawShape shape_at(const LawEntry& entry, const std::vector<double>& values) {
  LawShape shape;
  std::vector<std::size_t> linear;
  for (std::size_t p = 0; p < entry.parameters.size(); ++p) {
    if (entry.parameters[p].is_linear) linear.push_back(p);
  }
  for (const std::size_t p : linear) {
    std::vector<double>& basis = shape.basis.emplace_back(values);
    for (const std::size_t other : linear) basis[other] = other == p ? 1.0 : 0.0;
  }
  shape.parameters = [values, linear, &entry](const VectorXd& amplitudes) {
    std::vector<double> parameters = values;
    for (std::size_t a = 0; a < linear.size(); ++a) {
      parameters[linear[a]] = amplitudes(static_cast<Eigen::Index>(a));
      if (!in_range(parameters[linear[a]], entry.parameters[linear[a]].range)) {
        return std::vector<double>();
      }
    }
    return parameters;
  };
  return shape;
}

std::vector<LawShape> shapes_of_definition(const LawEntry& entry, const MotionScale& scale) {
  constexpr std::size_t kMost = 200;
  std::vector<std::vector<double>> combinations{{}};
  for (const LawParameter& parameter : entry.parameters) {
    const std::vector<double> trials =
        parameter.is_linear ? std::vector<double>{0.0} : trial_values(parameter, scale);
    std::vector<std::vector<double>> longer;
    for (const std::vector<double>& begun : combinations) {
      for (const double value : trials) {
        if (longer.size() == kMost) break;
        longer.push_back(begun);
        longer.back().push_back(value);
      }
    }
    combinations = std::move(longer);
  }
  std::vector<LawShape> shapes;
  for (const std::vector<double>& values : combinations) {
    shapes.push_back(shape_at(entry, values));
  }
  return shapes;
}

}  // namespace

LawShape single_amplitude(std::vector<double> unit, std::size_t index, bool positive) {
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

// At the flange, and anywhere: masses there and a little off along each axis have its mass and its
// first moments. Where unknown gains take up most of a mass, these alone may lead to none that can
// be: so also at some places off the flange.
std::vector<LawShape> payload() {
  constexpr double kOff = 0.1, kFarthest = 1.0;  // m
  LawShape anywhere;
  anywhere.basis = {
      {1.0, 0.0, 0.0, 0.0}, {1.0, kOff, 0.0, 0.0}, {1.0, 0.0, kOff, 0.0}, {1.0, 0.0, 0.0, kOff}};
  anywhere.parameters = [](const VectorXd& a) {
    const double mass = a.sum();
    const bool is_near = kOff * a.tail<3>().norm() <= kFarthest * mass;
    if (!(mass > 0.0) || !is_near) return std::vector<double>();
    return std::vector<double>{mass, kOff * a(1) / mass, kOff * a(2) / mass, kOff * a(3) / mass};
  };
  std::vector<LawShape> shapes = {single_amplitude({1.0, 0.0, 0.0, 0.0}, 0, true),
                                  std::move(anywhere)};
  for (std::size_t axis = 1; axis <= 3; ++axis) {
    for (const double place : {-0.5, -0.2, 0.2, 0.5}) {  // m
      std::vector<double> unit{1.0, 0.0, 0.0, 0.0};
      unit[axis] = place;
      shapes.push_back(single_amplitude(std::move(unit), 0, true));
    }
  }
  return shapes;
}

// Over less than a radian it is a spring and a constant force, but for what a load adds.
std::vector<LawShape> gravity(const CandidatePlace& place, const MotionScale& scale) {
  constexpr double kTurned = 1.0;  // rad
  if (scale.range < kTurned && place.location.load.empty()) return {};
  LawShape shape;
  shape.basis = {{1.0, 0.0}, {0.0, 1.0}};
  shape.parameters = [](const VectorXd& a) { return std::vector<double>{a(0), a(1)}; };
  return {std::move(shape)};
}

std::vector<LawShape> balancer_shapes(const std::vector<double>& levers,
                                      const std::vector<double>& free_lengths, int angles) {
  std::vector<LawShape> shapes;
  for (const double lever : levers) {
    for (const double free_length : free_lengths) {
      for (int k = 0; k < angles; ++k) {
        const double angle = 2.0 * std::numbers::pi * k / angles;
        shapes.push_back(single_amplitude({1.0, free_length, 1.0, lever, angle}, 0, true));
        shapes.back().valley = k;
      }
    }
  }
  return shapes;
}

double MotionScale::deflection(double share) const {
  return deflections.empty() ? 0.0 : quantile(deflections, share);
}
double MotionScale::excursion(double share) const {
  return excursions.empty() ? 0.0 : quantile(excursions, share);
}
double MotionScale::rate(double share) const {
  return rates.empty() ? 0.0 : quantile(rates, share);
}

namespace {

bool has_memory(std::string_view law) {
  return law == "dahl" || law == "lugre" || law == "bouc_wen" || law == "play_and_slip";
}

}  // namespace

std::vector<LawShape> law_shapes(const LawEntry& entry, const CandidatePlace& place,
                                 const MotionScale& scale) {
  const std::string& name = entry.name;
  if (scale.goes_one_way && has_memory(name)) return {};
  if (!entry.definition.empty()) return shapes_of_definition(entry, scale);
  if (name == "backlash") return backlash(place, scale);
  if (name == "dead_zone") return dead_zone(scale);
  if (name == "coulomb") return coulomb(scale);
  if (name == "asymmetric_coulomb") return asymmetric_coulomb(scale);
  if (name == "stribeck") return stribeck(scale);
  if (name == "ripple") return ripple(place, scale);
  if (name == "dahl") return dahl(scale);
  if (name == "lugre") return lugre(scale);
  if (name == "bouc_wen") return bouc_wen(scale);
  if (name == "play_and_slip") return play_and_slip(scale);
  if (name == "balancer") return balancer_shapes({0.15, 0.3, 0.6}, {0.0, 0.4, 0.8}, 12);
  if (name == "gravity") return gravity(place, scale);
  if (name == "asymmetric_viscous") return {asymmetric_viscous()};
  if (name == "sublinear_friction") return sublinear_friction(scale);
  if (name == "payload") return payload();
  if (entry.parameters.size() > 1) return {};
  const bool is_positive = entry.parameters.front().range != ParameterRange::kAny;
  return {single_amplitude({1.0}, 0, is_positive)};
}

Characteristic characteristic_of(const LawEntry& entry, const CandidatePlace& place) {
  static const std::set<std::string> kSprings = {"cubic_spring", "backlash", "dead_zone", "ripple"};
  // Fluids drag besides.
  static const std::set<std::string> kFrictions = {"coulomb",
                                                   "asymmetric_coulomb",
                                                   "stribeck",
                                                   "sublinear_friction",
                                                   "load_dependent_friction",
                                                   "deflection_damping",
                                                   "dahl",
                                                   "lugre",
                                                   "bouc_wen",
                                                   "play_and_slip"};
  if (kFrictions.count(entry.name) > 0) return Characteristic::kFriction;
  // Where there is no spring, what comes back with the position and what limits it are two things.
  const bool is_spring = place.spring_stiffness > 0.0 && kSprings.count(entry.name) > 0;
  return is_spring ? Characteristic::kSpring : Characteristic::kNone;
}

bool is_dry_friction(std::string_view law) {
  static const std::set<std::string_view> kDry = {
      "coulomb", "asymmetric_coulomb", "stribeck", "dahl", "lugre", "play_and_slip"};
  return kDry.count(law) > 0;
}

bool are_one_friction(std::string_view one, std::string_view other) {
  const auto bends = [](std::string_view law) { return law == "sublinear_friction"; };
  if (is_dry_friction(one) && is_dry_friction(other)) return true;
  return (bends(one) && is_dry_friction(other) && other != "coulomb") ||
         (bends(other) && is_dry_friction(one) && one != "coulomb");
}

std::vector<std::string> special_cases_of(const LawEntry& entry, bool dry_friction_may_creep) {
  const std::string& name = entry.name;
  const bool is_dry_friction = name == "stribeck" || name == "asymmetric_coulomb" ||
                               name == "sublinear_friction" || name == "coulomb";
  if (is_dry_friction) {
    std::vector<std::string> cases;
    if (name != "coulomb") cases.emplace_back("coulomb");
    if (dry_friction_may_creep) cases.emplace_back("viscous");
    return cases;
  }
  if (name == "dahl" || name == "load_dependent_friction") return {"coulomb"};
  if (name == "asymmetric_viscous" || name == "driven_viscous") return {"viscous"};
  if (name == "lugre") return {"coulomb", "stribeck", "dahl", "viscous"};
  if (name == "bouc_wen") return {"stiffness", "dahl", "coulomb"};
  if (name == "play_and_slip") return {"dahl", "coulomb"};
  if (name == "mode") return {"inertia", "stiffness", "viscous"};
  if (name == "dead_zone") return {"stiffness"};
  if (name == "balancer") return {"stiffness", "gravity"};
  if (name == "ripple") return {"gravity"};
  return {};
}

bool is_about_a_turn(double period) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return period > 0.75 * kTurn && period < kTurn / 0.75;
}

}  // namespace graybox
