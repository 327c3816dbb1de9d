// The URDF of a robot's model with what was found written into it. What a URDF can say:
//
//   viscous friction   <dynamics damping>    N m s/rad or N s/m, joint side
//   Coulomb friction   <dynamics friction>   N m or N, joint side (there is no transition velocity)
//   payload            <inertial> of the last moving link: mass, centre of mass and inertia
//   inertia            <inertial> of the first joint's link, about the joint's axis
//
// Friction of a motor is seen through its gear: damping times n^2, level times n. Everything else
// in the file (meshes, limits, comments) stays as it is.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/export/exported_model.hpp"

namespace graybox {

struct UrdfExport {
  std::string text;
  std::vector<std::string> notes;  // one line each: what the URDF does not hold, or held before
};

// Throws InputError for a model without a URDF, bodies that are not those of the URDF, and elements
// that a URDF has no place for: one line with their names and what could be done instead.
[[nodiscard]] UrdfExport urdf_with_findings(const ExportedModel& model);

}  // namespace graybox
