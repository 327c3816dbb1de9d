// The moving joints and bodies between two links of a URDF file, read with urdfdom.
//
// Fixed joints are folded away: a link that hangs rigidly on another adds its mass and inertia to
// it. What is fixed to the base link does not move and is left out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "graybox/problems/mechanics/rigid_chain.hpp"

namespace graybox {

// The chain from `base` to `tip`, one rotation for each revolute or continuous joint, named like
// it. Throws InputError for a missing or broken file, an unknown link, a tip that is not beyond the
// base, joints that are neither revolute, continuous nor fixed, moving side branches, mimic joints,
// and masses or inertias that no body has.
[[nodiscard]] std::vector<ChainRotation> read_urdf_chain(const std::filesystem::path& file,
                                                         const std::string& base,
                                                         const std::string& tip);

// The body seen from another frame: `pose` is the body's frame in that frame.
[[nodiscard]] RigidBody moved(const RigidBody& body, const Eigen::Isometry3d& pose);

// Two bodies given in the same frame as one (parallel-axis theorem).
[[nodiscard]] RigidBody joined(const RigidBody& a, const RigidBody& b);

}  // namespace graybox
