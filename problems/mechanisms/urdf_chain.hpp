// The moving joints and bodies between two links of a URDF file, read with urdfdom.
//
// Fixed joints are folded away: a link that hangs rigidly on another adds its mass and inertia to
// it. What is fixed to the base link does not move and is left out.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox {

// Where joints stand that the model holds still, by name: rad, or m along a prismatic joint.
using LockedJoints = std::map<std::string, double>;

struct UrdfChain {
  // One for each joint that moves, named like it. A prismatic joint's `axis` is that along which it
  // moves, its limits are in m.
  std::vector<ChainRotation> joints;
  std::vector<bool> is_prismatic;  // of each
};

// The chain from `base` to `tip`. `locked` joints, in it or beside it, count as fixed where they
// stand, and joints that mimic them stand accordingly. Other joints beside the chain are locked at
// zero. Throws InputError for a missing or broken file, an unknown link and a tip that is not
// beyond the base. It also does for joints of the chain that are neither revolute, continuous,
// prismatic nor fixed, mimic joints in it, and masses or inertias that no body has. Locked joints
// must be in the file, move by themselves and stand within their limits, else it throws, too.
[[nodiscard]] UrdfChain read_urdf_joints(const std::filesystem::path& file, const std::string& base,
                                         const std::string& tip, const LockedJoints& locked = {});

// A joint of the whole tree, with how it hangs where all but locked joints stand at zero.
struct UrdfJoint {
  std::string name, parent, child;  // links
  bool moves = false;               // revolute, continuous or prismatic, and no mimic
  bool is_prismatic = false;
  double lower = 0.0, upper = 0.0;  // limits, rad or m; equal where there are none
  double child_mass = 0.0;          // kg, of the child link alone
  double damping = 0.0;             // <dynamics>, N m s/rad or N s/m
  double friction = 0.0;            // <dynamics>, N m or N
  Eigen::Matrix3d parent_rotation =
      Eigen::Matrix3d::Identity();  // parent link's axes in the root's
};

// All joints, parents before children. Throws InputError for a missing or broken file.
[[nodiscard]] std::vector<UrdfJoint> read_urdf_tree(const std::filesystem::path& file,
                                                    const LockedJoints& locked = {});

// The body of one link alone, in its frame; mass 0 where it has none. Throws InputError for a
// missing or broken file, an unknown link, and a body that can't be.
[[nodiscard]] RigidBody read_urdf_body(const std::filesystem::path& file, const std::string& link);

// read_urdf_joints for robots of rotations alone: InputError for a prismatic joint.
[[nodiscard]] std::vector<ChainRotation> read_urdf_chain(const std::filesystem::path& file,
                                                         const std::string& base,
                                                         const std::string& tip);

// The body seen from another frame: `pose` is the body's frame in that frame.
[[nodiscard]] RigidBody moved(const RigidBody& body, const Eigen::Isometry3d& pose);

// Two bodies given in the same frame as one (parallel-axis theorem).
[[nodiscard]] RigidBody joined(const RigidBody& a, const RigidBody& b);

}  // namespace graybox
