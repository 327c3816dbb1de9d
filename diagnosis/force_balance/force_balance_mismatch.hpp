// Large motions of a rigid robot (graybox-rigid-robot/1), or of any drive whose motion and force
// are both measured, as the search for missing physics sees them (mismatch_problem.hpp):
//
//   N^T u = known(q, q', q'') + W(q, q', q'') p + sum of b_out f(z, z', x; parameters),
//   z = b_in^T q
//
// The force of each place is balanced directly, so a hypothesis is more columns beside W. There is
// no simulation and there are no start values. The picture of a law is the residual at its place.
//
// Fit. Parameters in which the force is linear by weighted least squares on compressed columns
// (balance_regression.hpp), the others of the laws by variable projection (shape_refinement.hpp).
// Standard errors and Wald statistics allow for residuals that are correlated in time; standard
// errors are at least as wide as the spread between recordings (recording_spread.hpp).
//
// Noise is not known. Its deviation s_j at each joint is that of the residuals. Its memory is that
// of an autoregressive model of what the first fit leaves, less what of that depends on the motion
// (coloured_noise.hpp, remaining_structure.hpp). With n_j effective samples deviance = sum n_j ln
// s_j^2. A law has to pay in a cross-validation, too: ten contiguous blocks of the recordings, each
// predicted by linear parameters from the others (ExtendedFit::held_out).
//
//
// What is left. Noise being unknown, no chi-square can say whether the rest is noise. Instead:
// does it still depend on the motion? The share of its variance that a cross-validated regression
// on steps in z and z' of every joint predicts (remaining_structure).
//
// Places: the axis of each joint, each motor whose transmission couples joints, and the sum and
// difference of neighbouring joints.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct ForceBalanceOptions {
  int threads = 1;                                   // results do not depend on it
  std::function<bool()> keep_going;                  // asked now and then; false: fits end unusable
  std::vector<std::filesystem::path> place_files{};  // graybox-places/1 (place_file.hpp)
  std::vector<std::size_t> without_rotors{};  // joints whose unknown rotor inertia is left out
};

// Throws InputError of one line for a model or campaign that can't be used (motion_record.hpp), and
// for fewer than 50 samples.
[[nodiscard]] std::unique_ptr<MismatchProblem> force_balance_problem(
    const std::filesystem::path& model, const Campaign& campaign,
    const ForceBalanceOptions& options = {});

// A lumped drive that is measured as a whole (measured_drive.hpp), in the same way; no place files.
// Throws InputError for a drive that is constant, too: a friction of its size would foretell it.
[[nodiscard]] std::unique_ptr<MismatchProblem> drive_balance_problem(
    const RigidRobotModel& drive, const Campaign& campaign,
    const ForceBalanceOptions& options = {});

}  // namespace graybox
