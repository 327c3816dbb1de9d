// Columns of a log as signals of a robot's joints.
//
// A title names a joint where the joint's words stand in it ("- arm_1_joint_effort" has those of
// arm_1_joint). Else its number counts the joints from the base, from 0 or 1 on, if as many joints
// are there. Columns that differ by the joint alone are a family: "rec.pos[1]" to "rec.pos[6]",
// "j1 torque [Nm]" and "j2 torque [Nm]"; the unit is no part of a family's name.
// What a title says of its quantity it says beside the joint's name: the effort of a joint that is
// called wrist_angle is no angle.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {

struct ColumnFamily {
  using Columns = std::map<std::size_t, const LogColumn*>;
  std::string pattern;  // a title with the joint replaced by *; of one column its title
  LogQuantity quantity = LogQuantity::kUnknown;
  bool by_number = false;  // not by joints' names
  Columns columns;         // by joint, as in the URDF's list
};

// `joints`: those of the URDF, in its order. Columns that belong to no joint are left out. Throws
// InputError where the user named a joint that is not among them.
[[nodiscard]] std::vector<ColumnFamily> column_families(const LogRecording& recording,
                                                        const std::vector<UrdfJoint>& joints);

// Reads the titles again without the joint that each names. What the user said stays, and so does
// a title that is a joint's name alone, in a file that says nothing either.
void read_beside_joints(const std::vector<UrdfJoint>& joints, LogRecording& recording);

// The family of a quantity (or of any drive) that is measured, raw and has the most joints; several
// if that leaves it open, none if there is none. Columns that the user named for that take the
// place of their joints' others, and are added where a family has none. None if no drive moves.
[[nodiscard]] std::vector<ColumnFamily> families_of_drive(
    const std::vector<ColumnFamily>& families);
[[nodiscard]] std::vector<ColumnFamily> families_of(const std::vector<ColumnFamily>& families,
                                                    LogQuantity quantity);

}  // namespace graybox
