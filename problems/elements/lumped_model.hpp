// LumpedModel: named masses that move along one line or about one axis each, with elements between
// them: single-axis drives, oscillators.
//
//   M q'' + C q' + K q = B u + f(elements),   y = S_0 q + S_1 q'
//
// Read from a graybox-lumped/1 file:
//
//   format: graybox-lumped/1
//   sample_time: 0.001                       # s
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
//   controller: {kind: pi, proportional: [0.2], integral_time: [0.05]}    # u from r - y; if absent,
//                                            # the excitation is the input itself
// Further places: {kind: element, deflection: {motor: 1, load: -50}} for z = motor - 50 load, a
// `driven_by` with one of these three ways, {kind: actuator, input: torque}, {kind: sensor, output:
// speed}. Everything starts at q = 0, at rest.
//
// Elements stiffness, viscous and inertia go into K, C and M; the others stay elements.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "graybox/problems/elements/element.hpp"
#include "graybox/problems/robot_model.hpp"

namespace graybox {

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
};

// `physics`: a graybox-physics/1 file with further elements. Throws InputError of one line for
// whatever is wrong with a file.
[[nodiscard]] LumpedModel load_lumped_model(
    const std::filesystem::path& file, const std::optional<std::filesystem::path>& physics = {});

}  // namespace graybox
