#include "bench/any_motion_challenge/any_motion_system.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "bench/any_motion_challenge/any_motion_laws.hpp"

namespace graybox::bench {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kLargestError = 0.1;

double log_uniform(Random& random, double from, double to) {
  return from * std::pow(to / from, random.uniform());
}

// The digits that the model file has.
double rounded(double value) { return std::stod(fmt::format("{:.4e}", value)); }

const PlaceUnits& units() {
  static const PlaceUnits all{"N m", "rad", "kg m^2"};
  return all;
}

ChallengePlace force_place(const VectorXd& direction, const std::string& name, unsigned kinds) {
  ChallengePlace place;
  place.location.name = name;
  place.location.input = place.location.output = direction;
  place.location.units = units();
  place.kinds = kinds;
  place.turns = true;
  place.inertia_is_fitted = true;
  return place;
}

ChallengePlace signal_place(LocationKind kind, Index channel, const std::string& name,
                            const std::string& unit) {
  ChallengePlace place;
  place.location.kind = kind;
  place.location.channel = channel;
  place.location.name = name;
  place.location.units.force = unit;
  place.kinds = kind == LocationKind::kActuator ? kActuatorPlace : kSensorPlace;
  return place;
}

}  // namespace

double DriveOutput::deviation() const {
  return is_velocity ? white_noise : quantum / std::sqrt(12.0);
}

AnyMotionSystem::AnyMotionSystem(Family family, std::uint64_t seed)
    : family_(family),
      is_drive_(family != Family::kAxisEncoder && family != Family::kAxisTachometer),
      has_tachometer_(family == Family::kAxisTachometer || family == Family::kDriveTachometer) {
  if (set_of(family) != kAnyMotionSet) throw std::logic_error("a family of another set");
  Random random(derived_seed(seed, {1}));
  is_drive_ ? draw_drive(random) : draw_axis(random);
  draw_controller(random);
  draw_plan(random);
  draw_sensors(random);
  force_noise_share_ = random.uniform(0.01, 0.03);
  force_noise_memory_ = log_uniform(random, 0.05, 0.5);
  has_stamps_ = random.uniform() < 0.25;
  jitter_ = has_stamps_ ? 0.04 : random.uniform(0.0, 0.01);
  list_places();
}

void AnyMotionSystem::add_parameter(const std::string& name, double value, Random& random) {
  parameters_.push_back(
      {name, rounded(value), 1.0 + random.uniform(-kLargestError, kLargestError)});
}

void AnyMotionSystem::draw_axis(Random& random) {
  const double inertia = log_uniform(random, 1e-3, 1e-2);
  add_parameter("rotor", inertia, random);
  if (has_tachometer_) add_parameter("bearing", inertia / random.uniform(0.5, 2.0), random);
}

void AnyMotionSystem::draw_drive(Random& random) {
  const double motor = log_uniform(random, 1e-3, 5e-3), load = motor * random.uniform(1.5, 6.0);
  const double resonance = kTurn * log_uniform(random, 10.0, 60.0);
  const double reduced = motor * load / (motor + load);
  add_parameter("motor", motor, random);
  add_parameter("load", load, random);
  add_parameter("shaft", reduced * resonance * resonance, random);
  add_parameter("shaft damping", 2.0 * random.uniform(0.02, 0.04) * reduced * resonance, random);
  if (has_tachometer_) add_parameter("bearing", load / random.uniform(0.5, 2.0), random);
}

double AnyMotionSystem::total_inertia() const {
  return parameters_[0].believed + (is_drive_ ? parameters_[1].believed : 0.0);
}

void AnyMotionSystem::draw_controller(Random& random) {
  const double inertia = total_inertia();
  bandwidth_ = kTurn * (is_drive_ ? random.uniform(1.5, 3.0) : random.uniform(2.0, 5.0));
  controller_.of_speed = has_tachometer_;
  controller_.limit = inertia * random.uniform(500.0, 1000.0);
  if (has_tachometer_) {
    controller_.proportional = inertia * bandwidth_;
    controller_.integral = 0.25 * controller_.proportional * bandwidth_;
    return;
  }
  controller_.proportional = inertia * bandwidth_ * bandwidth_;
  controller_.derivative = 2.0 * random.uniform(0.6, 1.0) * inertia * bandwidth_;
}

// Three recordings to fit, two kept out: another motion, and one of the same kind, both smaller.
void AnyMotionSystem::draw_plan(Random& random) {
  constexpr Index kSamples = 4000, kKeptOut = 3000;
  std::array<MotionKind, kMotionKinds> kinds{MotionKind::kSteps, MotionKind::kWorkCycle,
                                             MotionKind::kSmooth, MotionKind::kRandomTargets};
  for (std::size_t k = kinds.size(); k > 1; --k) std::swap(kinds[k - 1], kinds[random.below(k)]);
  const double amplitude = has_tachometer_ ? random.uniform(8.0, 30.0) : random.uniform(1.0, 4.0);
  for (std::size_t k = 0; k < 3; ++k) {
    plan_.push_back({kinds[k], amplitude * random.uniform(0.7, 1.0), kSamples, false});
  }
  for (const std::size_t k : {3U, 0U}) {
    plan_.push_back({kinds[k], amplitude * random.uniform(0.4, 0.6), kKeptOut, true});
  }
}

void AnyMotionSystem::draw_sensors(Random& random) {
  const auto encoder = [&](const char* name, Index mass) {
    outputs_.push_back({name, mass, false, rounded(log_uniform(random, 5e-5, 5e-4)), 0.0});
  };
  const auto tachometer = [&](const char* name) {
    double largest = 0.0;
    for (const PlannedMotion& motion : plan_) largest = std::max(largest, motion.amplitude);
    outputs_.push_back({name, 0, true, 0.0, rounded(largest * log_uniform(random, 2e-3, 1e-2))});
  };
  if (has_tachometer_) return tachometer(is_drive_ ? "motor_speed" : "speed");
  encoder(is_drive_ ? "motor_angle" : "angle", 0);
  if (family_ == Family::kDriveEncoders) encoder("load_angle", 1);
}

std::string AnyMotionSystem::mass_name(Index mass) const {
  return !is_drive_ ? "rotor" : mass == 0 ? "motor" : "load";
}

void AnyMotionSystem::list_places() {
  const Index n = mass_count();
  for (Index i = 0; i < n; ++i) {
    unsigned kinds = kAxisPlace;
    if (!has_tachometer_) kinds |= kHeldAxisPlace;
    if (!has_tachometer_ || i + 1 < n) kinds |= kUndampedAxisPlace;
    places_.push_back(force_place(VectorXd::Unit(n, i), mass_name(i), kinds));
  }
  if (is_drive_) {
    places_.push_back(force_place(Eigen::Vector2d(1.0, -1.0), "motor-load", kSpringPlace));
    places_.back().spring = parameters_[2].believed * parameters_[2].factor;
  }
  places_.push_back(signal_place(LocationKind::kActuator, 0, "actuator torque", units().force));
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    places_.push_back(signal_place(LocationKind::kSensor, static_cast<Index>(i),
                                   "sensor " + outputs_[i].name,
                                   outputs_[i].is_velocity ? "rad/s" : "rad"));
  }
}

VectorXd AnyMotionSystem::true_values() const {
  VectorXd values(static_cast<Index>(parameters_.size()));
  for (std::size_t p = 0; p < parameters_.size(); ++p) {
    values(static_cast<Index>(p)) = parameters_[p].believed * parameters_[p].factor;
  }
  return values;
}

DriveDynamics AnyMotionSystem::dynamics(const VectorXd& values) const {
  const Index n = mass_count();
  DriveDynamics result{values.head(n), MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
  Index next = n;
  if (is_drive_) {
    MatrixXd along(2, 2);
    along << 1.0, -1.0, -1.0, 1.0;
    result.stiffness = values(next++) * along;
    result.damping = values(next++) * along;
  }
  if (has_tachometer_) result.damping(n - 1, n - 1) += values(next);
  return result;
}

std::map<std::string, std::vector<std::string>> AnyMotionSystem::same_places() const {
  const std::string actuator = "actuator torque", sensor = "sensor " + outputs_[0].name;
  std::map<std::string, std::vector<std::string>> groups{{"offset", {actuator, mass_name(0)}}};
  if (outputs_.size() > 1) return groups;
  if (is_drive_) groups["offset"].push_back(mass_name(1));
  if (has_tachometer_) groups["offset"].push_back(sensor);
  groups["late"] = {actuator, sensor};
  if (is_drive_) {
    const double on_shaft = std::sqrt(parameters_[2].believed / parameters_[1].believed);
    if (on_shaft > 6.0 * bandwidth_) groups["force"] = {mass_name(0), mass_name(1)};
  }
  return groups;
}

std::string AnyMotionSystem::model_text() const {
  std::string text =
      fmt::format("format: graybox-lumped/1\nsample_time: {}\nmotion: rotation\nmasses:\n",
                  kAnyMotionSampleTime);
  const auto n = static_cast<std::size_t>(mass_count());
  for (std::size_t p = 0; p < n; ++p) {
    text += fmt::format("  {}: {:.4e}\n", parameters_[p].name, parameters_[p].believed);
  }
  if (parameters_.size() > n) text += "elements:\n";
  for (std::size_t p = n; p < parameters_.size(); ++p) {
    const bool is_spring = parameters_[p].name == "shaft";
    const std::string place = parameters_[p].name == "bearing"
                                  ? "mass: " + mass_name(mass_count() - 1)
                                  : "between: [motor, load]";
    text += fmt::format(
        "  - name: {}\n    location: {{kind: element, {}}}\n    law: {}\n"
        "    parameters: {{{}: {{value: {:.4e}, unit: {}}}}}\n",
        parameters_[p].name, place, is_spring ? "stiffness" : "viscous",
        is_spring ? "stiffness" : "damping", parameters_[p].believed,
        is_spring ? "N m/rad" : "N m s/rad");
  }
  text += fmt::format("inputs:\n  - {{name: torque, mass: {}}}\noutputs:\n", mass_name(0));
  for (const DriveOutput& output : outputs_) {
    text += fmt::format("  - {{name: {}, mass: {}, quantity: {}}}\n", output.name,
                        mass_name(output.mass), output.is_velocity ? "velocity" : "position");
  }
  text += "noise:\n";
  for (const DriveOutput& output : outputs_) {
    text += fmt::format("  {}: {:.4e}\n", output.name, output.deviation());
  }
  return text;
}

}  // namespace graybox::bench
