// Counters that wrap. A position jumps by its whole range between two samples, again and again by
// the same amount, and moves smoothly else. A jump's slope makes forces of any sign, so that this
// has to be asked before anything about signs. A speed is no counter: it turns round at an end stop
// (diagnosis/signal_faults/speed_impact.hpp).
//
// A jump that went through a low-pass is a ramp as long as its filter's step response; changes are
// taken over that time. A wrap is claimed where some changes are larger than kJump of the signal's
// range and of one size within kSameSize. All others must be less than kSmooth of it, and the
// signal must move beside them. Besides, each must go from one end of the range to the other
// (kWhole) and be as steep as the filter lets a jump be (kSlope): a joint that moves a little and
// comes to rest is slower. Beside the jumps the signal must get somewhere (kMoves): noise at rest
// does not.
//
// Monte Carlo, 70 % of it low-passed at any frequency: 8 alarms of 8000 joints at rest (white noise
// and counts), 20 of 8000 that move once and rest, 3 of 12000 that go on moving. All of 7945
// wraps were found as recorded, 67 % of 7948 low-passed.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

[[nodiscard]] std::vector<ChannelFault> find_wraps(const RigidRobotModel& robot,
                                                   std::span<const Motion> pieces);

// Whether a recorded speed jumps by one size again and again, as at an end stop. Nobody recorded
// the force of the blow, so no balance of forces tells signs or units.
[[nodiscard]] bool have_blows(const RigidRobotModel& robot, std::span<const Motion> pieces);

}  // namespace graybox
