#include "bench/any_motion_challenge/any_motion_set.hpp"

#include "bench/any_motion_challenge/any_motion_case.hpp"
#include "bench/any_motion_challenge/any_motion_draw.hpp"

namespace graybox::bench {

const ChallengeSet& any_motion_set() {
  static const ChallengeSet set{
      .name = std::string(kAnyMotionSet),
      .all_cases = 240,
      .quick_cases = 24,
      .families = {Family::kAxisEncoder, Family::kAxisTachometer, Family::kDriveEncoders,
                   Family::kDriveMotorEncoder, Family::kDriveTachometer},
      .compose = compose_any_motion,
      .draw = draw_any_motion_case,
      .write = write_any_motion_case};
  return set;
}

}  // namespace graybox::bench
