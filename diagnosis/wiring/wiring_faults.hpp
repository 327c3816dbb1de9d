// Faults of wiring, sign and unit in the recordings of a rigid robot, whose masses the recordings
// themselves must tell (channel_faults.hpp has those of flexible models, whose responses are
// known). Five questions:
//
//   0. Do positions or velocities jump as counters do that wrap (wrap_faults.hpp)? Then only that
//      is said.
//   1. Are recorded velocities and accelerations those of the recorded positions (rate_faults.hpp)?
//      Where they are not only that is said.
//   2. Would the force balance (wired_balance.hpp) fit if wires were others? Every exchange of two
//      joints' forces or motions or both, every other sign of these, forces in thousandths or on
//      the gear's other side, and angles in degrees or radians are tried. A fault is claimed where
//      undoing it brings the mean relative error of the joints where it shows from 0.1 or more to
//      at most 0.6 of what it was (0.4 where forces and motions are exchanged) and below 0.6, the
//      sum over all joints down, and lets no joint gain energy by friction (3). The best is undone,
//      then the next is looked for; others of its joints that do about as well are named with it:
//      "one of". With a factor of a force the error of some joint must be half of that with factors
//      30 times larger and smaller: a force that outweighs all others keeps the masses that they
//      share to itself. Angles that turn more than twice may be degrees, and others radians where
//      degrees are stated.
//   3. Does a joint move against the force that drives it? Then what friction takes, by that fit,
//      is negative, by more than 3 jackknife errors (tenths of the recordings left out), and so is
//      its inertia, or the other sign makes the error a fifth smaller. A missing spring may make
//      the inertia negative, a late force the friction; a stiff spring and a late force together
//      may look like a wrong sign. Joints that share motors are passed over, and those that go one
//      way only: a load, as a weight, does the same there.
//   4. Where wires are found, or a mean error of 0.25 or more: does gravity point elsewhere
//      (gravity_fault.hpp)? Then no wire may look wrong with gravity there: friction tells the sign
//      of a drive whatever gravity does. It stands in the place of wires unless these leave a fifth
//      less, or the drives' gains are not known, and then beside a single one.
// A motion that is turned alone must take three fifths of the error; other faults two fifths.
//
// Masses that are not known take what they can of a fault. What changes no more than their values
// can't be found: a unit of all forces, or the mirror image of an upright axis. With one joint the
// first and third question are all, but for angles in degrees.
//
// Calibration (tests/diagnosis/force_balance/wiring_faults_test.cpp has a part of it): no alarm in
// 1400 draws of a simulated arm with springs, ripples, friction and couplings missing that are as
// large as gravity, masses known and unknown, motions large and small. Without the condition on
// friction 1.2 % of them raised one.
//
// Cost: some 10 n + 2 n^2 fits, and sums for n^2 / 2 + 4 n motions.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// `pieces`: of the estimation recordings, every sample. At most four faults of the second and third
// question. `keep_going`, if any, returning false: those found so far.
[[nodiscard]] std::vector<ChannelFault> find_wiring_faults(
    const RigidRobotModel& robot, std::span<const Motion> pieces,
    const std::function<bool()>& keep_going = {});

}  // namespace graybox
