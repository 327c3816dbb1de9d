// Joints that stand still. Dry friction then takes whatever the drive gives, up to its level. The
// balance of forces says nothing there, and a law fitted to it learns what friction happened to
// hold. The force of a joint is left out where it stands, and so are samples at which no joint
// moves and all forces of a joint that never moves.
//
// A joint stands where it gets less far in kStandingTime than kStandingSpeed of the root mean
// square of its speeds over all recordings would take it. Where its encoder flickers, it may get up
// to five times as far. What was held shows beside these samples, too, as far as the low-pass
// filter reaches that the force went through. A joint never moves where its range is below
// kIdleRange of the largest range among joints of its kind, or where no joint of its kind moves and
// another does.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "diagnosis/signals/standing_drive.hpp"

namespace graybox {

inline constexpr double kStandingSpeed = 0.002;
inline constexpr double kStandingTime = 0.2;  // s: shorter, it turns round or sticks as it slides
inline constexpr double kIdleRange = 1e-3;

// `is_prismatic`: of each joint.
[[nodiscard]] std::vector<bool> idle_joints(std::span<const Motion> pieces,
                                            const std::vector<bool>& is_prismatic);

// Where a joint stands, without what the filter adds beside it. `speed`: root mean square.
[[nodiscard]] std::vector<Stay> joint_stays(const Motion& piece, Eigen::Index joint, double speed);
// Sets Motion::stands. `speeds`: root mean squares of the joints' speeds.
void mark_standstill(Motion& piece, const Eigen::VectorXd& speeds);
// A piece without the samples at which all joints stand, cut there; parts of fewer than 20 samples
// are left out, too.
[[nodiscard]] std::vector<Motion> moving_parts(const Motion& piece);
[[nodiscard]] Eigen::VectorXd root_mean_square_speeds(std::span<const Motion> pieces);

}  // namespace graybox
