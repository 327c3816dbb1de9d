// LumpedModel: named masses that move along one line or about one axis each, with elements between
// them: single-axis drives, oscillators.
//
//   M q'' + C q' + K q = B u + f(elements),   y = S_0 q + S_1 q'
//
// Read from a graybox-lumped/1 file:
//
//   format: graybox-lumped/1
//   sample_time: 0.001                       # s; unknown: a sample counts as 1 s
//   motion: rotation                         # rad, N m, kg m^2 | translation: m, N, kg
//   masses: {motor: 0.0021, load: 0.035}
//   elements:                                # laws and fields: element.hpp
//     - name: shaft
//       location: {kind: element, between: [motor, load]}       # z = motor - load
//       law: stiffness
//       parameters: {stiffness: {value: 45, unit: N m/rad}}
//     - name: bearing
//       location: {kind: element, mass: load}                   # z = load, against the ground
//       law: viscous
//       parameters: {damping: {value: 0.01, unit: N m s/rad}}
//   inputs:
//     - {name: torque, mass: motor}
//   outputs:
//     - {name: speed, mass: motor, quantity: velocity}          # velocity | position
//   noise: {speed: 0.002}                    # standard deviation, white; none if absent
//   controller: {kind: pi, proportional: [0.2], integral_time: [0.05]}  # u from r - y; if absent,
//                                            # the excitation is the input itself
// Further places: {kind: element, deflection: {motor: 1, load: -50}} for z = motor - 50 load; a
// `driven_by` with one of these three ways or {input: torque}; {kind: actuator, input: torque};
// {kind: sensor, output: speed}. Simulations start at q = 0, at rest.
//
// Further outputs: {name: a, mass: load, quantity: acceleration}, {name: f, element: shaft,
// quantity: force} (the force f of that element's law).
//
// Imposed motion: an input with a `quantity` prescribes how a mass moves, and the force that this
// takes, (M q'' + C q' + K q - f) in its row, can be an output. Such a mass may be 0:
//   inputs:
//     - {name: displacement, mass: rod, quantity: position}
//     - {name: rate, mass: rod, quantity: velocity}             # else the slope of the position
//     - {name: a, mass: rod, quantity: acceleration}            # needed where M has entries for it
//   outputs:
//     - {name: force, mass: rod, quantity: force}
//
// An input with `quantity: signal` acts on no mass; laws at actuators and sensors may be driven by
// it (element.hpp):
//   inputs:
//     - {name: torque, quantity: signal, unit: N m}
//
// Elements stiffness, viscous and inertia go into K, C and M; the others stay elements.
//
// Parameters: each mass ("motor.inertia" or "carriage.mass") and each parameter of an element
// ("shaft.stiffness", by the element's name). A fit estimates all of them but those stated as
// `fixed: true`, or just those of a list:
//   masses: {motor: {value: 0.0021, fixed: true}, load: 0.035}
//   parameters: [load.inertia, shaft.stiffness]                 # the others are known
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "problems/elements/element.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

struct LumpedInput {
  enum class Kind : std::int8_t { kForce, kPosition, kVelocity, kAcceleration, kSignal };
  Kind kind = Kind::kForce;
  Eigen::Index mass = 0;  // of kSignal none
};

struct LumpedOutput {
  enum class Quantity : std::int8_t { kPosition, kVelocity, kAcceleration, kForce, kElementForce };
  Quantity quantity = Quantity::kPosition;
  Eigen::Index mass = 0;
  std::size_t part = 0;  // of kElementForce
};

struct LumpedParameter {
  std::string name;
  std::string unit;
  double value = 0.0;
  ParameterRange range = ParameterRange::kAny;
  bool fixed = false;
};

struct LumpedModel {
  std::string name;  // of the file, without folder and ending
  double sample_time = 0.0;
  std::vector<std::string> mass_names;
  Eigen::MatrixXd mass, damping, stiffness;  // M, C, K
  Eigen::MatrixXd input;                     // B
  Eigen::MatrixXd position_output;           // S_0
  Eigen::MatrixXd velocity_output;           // S_1
  std::vector<std::string> input_names, output_names;
  std::vector<std::string> input_units, output_units;
  Eigen::VectorXd noise;                   // standard deviation of each output
  std::optional<PiController> controller;  // as many inputs as outputs
  std::vector<Element> elements;           // those that are not in M, C, K

  std::vector<LumpedInput> inputs;
  std::vector<LumpedOutput> outputs;
  std::vector<bool> imposed;                // of each mass
  Eigen::VectorXd masses;                   // without elements
  std::vector<Element> parts;               // all elements in the order of the files
  std::vector<LumpedParameter> parameters;  // masses that are not 0, then those of each part

  [[nodiscard]] bool has_imposed_motion() const;
  // No imposed motion, no other signals: what simulations and diagnoses of drives take.
  [[nodiscard]] bool is_driven_by_forces_alone() const;
};

// How the model names its places; keeps a reference to it.
[[nodiscard]] std::unique_ptr<Places> lumped_places(const LumpedModel& model, PlaceUnits units);

// The same model with other values of `parameters`, one for each. Throws InputError for a value out
// of its range.
[[nodiscard]] LumpedModel with_parameters(const LumpedModel& model, std::span<const double> values);

// `physics`: a graybox-physics/1 file with further elements. Throws InputError of one line for
// whatever is wrong with a file.
[[nodiscard]] LumpedModel load_lumped_model(
    const std::filesystem::path& file, const std::optional<std::filesystem::path>& physics = {});

}  // namespace graybox
