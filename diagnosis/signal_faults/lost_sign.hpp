// A drive whose sign was lost: a duty cycle beside a direction that was not logged, a load as
// magnitude. It is never negative (or never positive) while the axis moves both ways, and its size
// follows the motion of either way.
//
// Rule: a tenth or more of the samples that move (above a twentieth of the largest speed), and ten
// or more, move either way. The drive comes below a tenth of what 95 % of its sizes keep below, as
// it must where it turns. Its sizes, with signs that the motion gives them, are explained by least
// squares on speed, its change over five samples and its sign. That leaves less than 60 % of what
// the same leaves of the drive as it is, with a constant. (The signs are those of the last fit, six
// times over.) A drive that bears a weight is of one sign, too, and is explained as it is. At least
// 50 samples. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct LostSign {
  double left;       // of what the signed motion leaves
  double strength;   // its threshold over it
  bool is_negative;  // never positive
};

// `rate`: the motion's velocity, of any scale, at the samples of the drive.
[[nodiscard]] std::optional<LostSign> find_lost_sign(const Eigen::Ref<const Eigen::VectorXd>& drive,
                                                     const Eigen::Ref<const Eigen::VectorXd>& rate);

// The change of a position over the samples beside each: its rate, of any scale.
[[nodiscard]] Eigen::VectorXd central_steps(const Eigen::Ref<const Eigen::VectorXd>& position);

// Whether a tenth or more of the samples that move, and ten or more, move either way.
[[nodiscard]] bool moves_both_ways(const Eigen::Ref<const Eigen::VectorXd>& rate);

}  // namespace graybox
