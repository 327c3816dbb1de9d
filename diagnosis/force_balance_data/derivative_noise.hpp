// The low-pass under which a motion can be differentiated: positions twice, velocities once.
//
// White noise of variance s^2, sampled f_s times a second, leaves after a low-pass at f and m
// derivatives an acceleration of the variance
//
//     2 s^2 / f_s  integral from 0 to f of (2 pi x)^(2 m) dx
//         =  2 s^2 (2 pi)^(2 m) f^(2 m + 1) / ((2 m + 1) f_s).
//
// s^2 is what white noise makes of third differences, a twentieth of their variance. Stamps that
// jitter are such noise, too: an error of the time is one of the motion.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "diagnosis/recordings/campaign.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// One recording's positions or velocities, evenly sampled.
struct MotionSamples {
  Eigen::VectorXd values;
  double sample_time = 0.0;  // s
  int derivatives = 2;       // to the acceleration: 2 of a position, 1 of a velocity
};

// The highest frequency, Hz, of a ladder below the Nyquist frequency that passes little noise: at
// most 1 % of the acceleration's variance, and at most half of what the last step of the ladder
// lets through. From 0.05 % on the half is not asked. There is none where even unfiltered motions
// allow for 1 %, or where no frequency does that lets ten waves into the longest recording.
[[nodiscard]] std::optional<double> low_pass_for_acceleration(
    std::span<const MotionSamples> records);

// The low-pass that a drive of one joint and its recordings need; none where accelerations are
// recorded, the campaign has filtered already, or its samples are uneven.
[[nodiscard]] std::optional<LowPass> missing_low_pass(const RigidRobotModel& drive,
                                                      const Campaign& campaign);

}  // namespace graybox
