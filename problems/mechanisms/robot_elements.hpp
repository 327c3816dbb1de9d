// Elements on a robot: its places, and the file that lists them.
//
// Places (`location` of element.hpp), coordinates q = (n_a arm rotations, n_m motors in joint
// angles):
//   {kind: element, joint: J, axis: gearbox}       z = arm angle - motor angle, arm-side
//   {kind: element, joint: J, axis: bearing_x}     z = the rotation of that bearing
//   {kind: element, joint: J, axis: motor}         z = motor angle, motor-side (row of N)
//   {kind: element, joint: J, axis: arm}           z = angle of the arm at that joint
//   {kind: element, axis: flange}                  payloads: x, y, z in the frame of the last joint
//   {kind: actuator, joint: J}, {kind: sensor, joint: J}     motor torque, motor velocity
// Deflections are absolute: a gearbox's counts from the unloaded gear, so that gravity sets the
// point at which a non-linear law works.
//
// `inertia` at a motor adds to the motor's inertia (motor-side); at an arm axis to the moment of
// inertia of the link about that axis.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "problems/elements/element.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

class RobotPlaces : public Places {
 public:
  explicit RobotPlaces(const RobotModel& robot) : robot_(&robot) {}  // keeps a reference
  [[nodiscard]] Location resolve(const YamlField& location) const override;

 private:
  [[nodiscard]] Eigen::VectorXd coordinate(const YamlField& location, Location& result) const;

  const RobotModel* robot_;
};

// Builds an inertia or payload element into the robot. Its parameters are added to a motor's
// inertia, a link's moment of inertia or the last link.
void build_in_inertia(RobotModel& robot, const Element& element);

struct ExtendedRobot {
  RobotModel robot;               // with the inertia and payload elements built in
  std::vector<Element> elements;  // all of them
};

// A graybox-robot/1 file with its key `elements`, and the elements of a graybox-physics/1 file.
// Throws InputError, also where inertia elements leave no inertia.
[[nodiscard]] ExtendedRobot load_extended_robot(
    const std::filesystem::path& file, const std::optional<std::filesystem::path>& physics = {});

// What springs, dampers and masses alone can hold of a robot: all that local models, information
// matrices and fits of responses know.
struct LinearRobot {
  RobotModel robot;
  std::vector<std::string>
      left_out;  // elements that they can't hold: "'grease' (coulomb at joint_1.motor)"
};

// Inertia and payload, stiffness and viscous friction at gearboxes and bearings, and viscous
// friction at motors are added to the robot's own parts. Other elements are left out: what such a
// model says is about a motion in which these are no more than a disturbance. Throws InputError,
// also where a spring or damper in sum is negative.
[[nodiscard]] LinearRobot load_linear_robot(const std::filesystem::path& file);

}  // namespace graybox
