// RobotModel: a flexible robot read from a graybox-robot/1 file (YAML) and the URDF it names.
//
// The arm is a chain of rotations, each held by one spring and damper: for every joint first its
// bearings (in the joint's frame at q = 0, on the parent's side), then its gearbox. A motor hangs
// on each gearbox and on nothing else. With n_a arm rotations and n_m motors the model has n_a +
// n_m degrees of freedom (paper, Section VI-A: 12 + 6 = 18, 36 states).
//
// Units: SI, radians. Motor inertia, friction and controller are motor-side; stiffness and damping
// are arm-side. The `transmission` N links them: motor angles = N * joint angles. N is the diagonal
// of the gear ratios (of either sign) unless the file gives a full matrix for coupled axes.
//
//   const graybox::RobotModel robot = graybox::load_robot_model("irb6600_like.yaml");
//
// The file:
//   format: graybox-robot/1
//   urdf: irb6600_like.urdf               # beside this file
//   base: base_link
//   tip: flange
//   gravity: [0, 0, -9.81]
//   sample_time: 0.0005
//   joints:
//     joint_1:                            # every moving joint between base and tip
//       gear_ratio: 220                   # not zero; absent where a transmission is given
//       motor_inertia: 0.00515
//       motor_friction: 0.0               # 0 if absent
//       gearbox: {stiffness: 2.12e6, damping: 218}
//       bearings:                         # none if absent
//         - {name: bearing_x, axis: [1, 0, 0], stiffness: 2.88e6, damping: 153}
//   transmission: [[...], ...]            # instead of the gear ratios
//   controller: {kind: pi, proportional: [...], integral_time: [...]}
//   noise: {velocity_psd_slope: 0.0827}   # C_v of Phi_v = C_v w^2 I
//   parameters: all_stiffness             # or a list of springs: [joint_1.gearbox, ...]
//   excitation: {frequencies: {from: 1, to: 60, count: 50, spacing: log}, reference_psd: 1.0}
//   elements: [...]                       # further physics (elements/element.hpp); none if absent
// Frequencies (Hz) may also be a list; spacing is log or linear.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox {

class YamlField;

// The spring and damper about one rotation of the arm.
struct ArmSpring {
  std::string name;         // "joint_1.gearbox", "joint_1.bearing_x"
  double stiffness = 0.0;   // N m/rad
  double damping = 0.0;     // N m s/rad
  std::size_t joint = 0;    // the joint it belongs to
  bool is_gearbox = false;  // gearboxes act between arm and motor, bearings between arm and parent
};

// Diagonal PI controller on the motor velocities: F(z) = K_p (1 + (T_s/T_i) / (1 - z^-1)).
struct PiController {
  Eigen::VectorXd proportional;   // K_p, N m s/rad
  Eigen::VectorXd integral_time;  // T_i, s
};

// {kind: pi, proportional: [...], integral_time: [...]}, of positive numbers, one for each motor.
[[nodiscard]] PiController read_pi_controller(const YamlField& field, std::size_t motors);

struct RobotModel {
  std::string name;                      // of the file, without folder and ending
  RigidChain chain;                      // n_a rotations
  std::vector<ArmSpring> springs;        // n_a, one for each rotation of the chain
  std::vector<std::string> joint_names;  // n_m
  Eigen::MatrixXd transmission;          // N, n_m x n_m, invertible
  Eigen::VectorXd motor_inertia;         // n_m, kg m^2
  Eigen::VectorXd motor_friction;        // n_m, N m s/rad
  double sample_time = 0.0;              // T_s, s
  PiController controller;
  double velocity_psd_slope = 0.0;      // C_v
  double reference_psd = 0.0;           // C_r = Phi_r
  std::vector<double> frequencies;      // n_f, rad/s, increasing
  std::vector<std::size_t> parameters;  // the spring that each parameter scales; theta_0 = 1

  [[nodiscard]] Eigen::Index arm_size() const { return chain.size(); }
  [[nodiscard]] Eigen::Index motor_count() const { return motor_inertia.size(); }
  [[nodiscard]] std::vector<std::string> parameter_names() const;
  // The rotation of the arm that the gearbox of each joint turns.
  [[nodiscard]] std::vector<Eigen::Index> gearbox_rotations() const;
};

// Throws InputError of one line for whatever is wrong with the file or its URDF, and for a file
// with elements, which load_linear_robot() reads (robot_elements.hpp).
[[nodiscard]] RobotModel load_robot_model(const std::filesystem::path& file);

// This reads the same file and leaves its elements to the caller (robot_elements.hpp).
[[nodiscard]] RobotModel load_robot_without_elements(const std::filesystem::path& file);

// The same robot with the stiffness of parameter p multiplied by theta_p: the robot one would have
// if theta were true, with theta_0 = 1 again (so information about theta relative to it). Gravity
// deflection follows the new springs. Throws InputError unless theta has one positive number for
// each parameter.
[[nodiscard]] RobotModel with_stiffness_factors(const RobotModel& robot,
                                                const Eigen::VectorXd& theta);

// The IRB 6600-like robot that comes with graybox: irb6600_like.yaml in $GRAYBOX_ROBOT_DIR, beside
// the installed program (../share/graybox/robot), or in the source tree it was built from. Throws
// InputError where none of them has it.
[[nodiscard]] std::filesystem::path default_robot_file();

}  // namespace graybox
