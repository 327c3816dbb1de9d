// The motion of a rigid robot and the torques that made it, from the recordings of a campaign, in
// joint coordinates: the input of inverse dynamics.
//
//   const RigidRobotModel robot = load_rigid_robot("robot.yaml");
//   const auto records = read_motion_records(robot, read_campaign("campaign"));
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/preprocess.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// Consecutive samples. Matrices are samples x joints; rad, N m (m, N where prismatic), s.
struct Motion {
  Eigen::VectorXd time;
  Eigen::MatrixXd position, velocity, acceleration;
  Eigen::MatrixXd torque;  // N^T u
  // That the torques went through; where they differ, those of the least filtered one.
  std::vector<FilterPass> filters = {};
  // False: it is the integral of the velocity, from zero at the first sample on.
  bool position_is_recorded = true;
  std::string load = {};  // of the recording (campaign.hpp); empty: none stated
  // Samples x joints: where a joint stands still, or its force was clipped; empty: nowhere.
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> stands = {};

  [[nodiscard]] Eigen::Index samples() const { return time.size(); }
  // Mean time between samples; 0 of one alone.
  [[nodiscard]] double sample_time() const {
    const Eigen::Index last = samples() - 1;
    return last > 0 ? (time(last) - time(0)) / static_cast<double>(last) : 0.0;
  }
};

// So many samples from `first` on.
[[nodiscard]] Motion samples_of(const Motion& motion, Eigen::Index first, Eigen::Index count);

struct MotionRecord {
  std::string name;  // of the experiment
  ExperimentRole role = ExperimentRole::kEstimation;
  std::vector<Motion> pieces;
  std::vector<std::string> remarks = {};  // what was changed in the recording
};

// Periods of a low-pass that its guess beyond the ends of a recording shows inside.
inline constexpr double kFilterReach = 2.0;

// The signals that the robot's `channels` name, after the campaign's preprocessing. The ends of
// each piece are left out as far as its low-pass reaches (kFilterReach), where no more than half of
// the piece goes by that. Motors' signals
// go through the transmission; velocities and accelerations that are not named are parabolas'
// slopes (time_derivative in preprocess.hpp). Throws InputError for recordings with errors, a robot
// without channels, a channel that is not there or in a wrong unit, a payload's load that no
// recording carries, and a campaign without estimation data. Where only velocities are named,
// positions are their integrals from zero on: refused if the torques depend on positions.
[[nodiscard]] std::vector<MotionRecord> read_motion_records(const RigidRobotModel& robot,
                                                            const Campaign& campaign);

// Whether the torques of the model depend on positions: by gravity, by an element, by other joints.
[[nodiscard]] bool needs_position(const RigidRobotModel& robot);

}  // namespace graybox
