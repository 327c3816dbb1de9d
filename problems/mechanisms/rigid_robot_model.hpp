// RigidRobotModel: a robot of rigid bodies with drives, for large motions,
//
//   N^T u = M(q) q'' + c(q, q') + g(q) + N^T J N q'' + f(elements),    q_m = N q,
//
// q the joint coordinates (rad, or m where prismatic), q_m and u the motors' angles and torques, N
// the transmission, J the rotor inertias. Read from a graybox-rigid-robot/1 file
// (docs/how_to/rigid_robots.md has every field):
//
//   format: graybox-rigid-robot/1
//   gravity: [0, 0, -9.81]                   # m/s^2, in the base frame
//   denavit_hartenberg: modified             # or standard; lengths in m, angles in degrees
//   joints:                                  # in chain order
//     - {name: shoulder, a: 0, alpha: 0, d: 0.3, theta: 0, gear_ratio: 100, rotor_inertia: 1e-4}
//     - {name: elbow, a: 0, alpha: -90, d: 0, theta: 0, gear_ratio: -80, rotor_inertia: unknown}
//
// or, with bodies and places from a URDF, the keys urdf, base, tip instead of denavit_hartenberg
// and the rows. What the file leaves out is what recordings must tell. This is the body of a link
// without `body` (or with `body: unknown`) and a rotor inertia that is `unknown`. It is also every
// parameter of the elements in which their force is linear (LawParameter::is_linear), except those
// listed under `known`. The other parameters of elements keep the value in the file unless they are
// listed under `refine`. `body_uncertainty` is how well stated bodies are known: 0.1 for a standard
// deviation of 10 % of their masses; 0, if not stated: exactly.
//
// Denavit-Hartenberg rows: modified (Craig 1986, Khalil and Kleinfinger 1986) turns and shifts
// before the joint, Rot_x(alpha) Trans_x(a) Trans_z(d) Rot_z(theta + q); standard (Denavit and
// Hartenberg 1955) after it, Rot_z(theta + q) Trans_z(d) Trans_x(a) Rot_x(alpha). A prismatic joint
// adds q to d.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "problems/elements/element.hpp"
#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox {

// A joint and the link that it moves. The link's frame is the joint's: its origin on the joint's
// axis, at q = 0 standing at `origin` in the frame of the joint before. Standard rows are turned
// into such frames, too.
struct RobotJoint {
  std::string name;
  Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // length 1
  bool is_prismatic = false;
  std::optional<RigidBody> body;        // in the link's frame; none: unknown
  std::optional<double> rotor_inertia;  // of the motor in the same place, motor side; none: unknown
};

// One parameter of one element.
struct ElementParameter {
  std::size_t element;
  std::size_t parameter;
};

// The signals of a campaign, one a joint, in joint order. Empty velocity or acceleration: the
// position is differentiated. Empty position: the velocity is integrated.
struct RobotChannels {
  std::vector<std::string> torque, position, velocity, acceleration;
  bool motor_torque = false;    // u and not N^T u
  bool motor_position = false;  // q_m and not q; so are velocity and acceleration
  // The torques may be commands, which a drive holds until the next sample.
  bool commanded_torque = false;
  // Each drive reports its torque in a unit of its own: u_j = gain_j times what is recorded. Then N
  // is diagonal, and no element but a payload acts on two joints. A payload's mass is refined.
  bool unknown_drive_gains = false;
};

struct RigidRobotModel {
  std::string name;  // of the file, without folder and ending
  std::vector<RobotJoint> joints;
  Eigen::Isometry3d flange = Eigen::Isometry3d::Identity();  // in the last link's frame
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  Eigen::MatrixXd transmission;  // N, motors by joints
  std::vector<Element> elements;
  std::vector<ElementParameter> known, refined;
  RobotChannels channels;  // empty lists if the file has none
  // How well bodies that are stated are known: standard deviation over the value. A diagnosis frees
  // them by that much; 0: they are exact.
  double body_uncertainty = 0.0;

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(joints.size()); }
};

// `physics`: graybox-physics/1 files with further elements; `refine`: further parameters,
// "element.parameter", to refine. Places of elements:
//   {kind: element, joint: J, axis: arm}              z = q_J, arm side
//   {kind: element, joint: J, axis: motor}            z = row J of N q, motor side
//   {kind: element, deflection: {J: 1, K: 1}}         z = q_J + q_K, all of one kind
//   {kind: element, axis: flange}                     payloads: x, y, z in the flange's frame: the
//                                                     last row's, or the last link's of a URDF
//   {kind: element, axis: flange, load: L}            in the recordings with load L alone
// each but the last with `driven_by` of one of the first three kinds. Laws with inner states and
// signal laws are refused: they are for simulation. Throws InputError of one line for whatever is
// wrong.
[[nodiscard]] RigidRobotModel load_rigid_robot(
    const std::filesystem::path& file, const std::vector<std::filesystem::path>& physics = {},
    const std::vector<std::string>& refine = {});

// How the model names its places; keeps a reference to it.
[[nodiscard]] std::unique_ptr<Places> rigid_robot_places(const RigidRobotModel& model);

}  // namespace graybox
