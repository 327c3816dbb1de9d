// A robot with the log of its joints: which columns are whose, the chain of joints that move and
// are logged, and what the URDF's limits and masses say of the columns' units.
//
//   LoggedRobot robot("arm.urdf", "", "", log);
//   robot.set_columns(&positions, &forces);  // of column_families(log, robot.joints())
//   robot.choose_chain();
//   robot.fits_limits({"deg", 0.01745, 0.0});
//   robot.lock_others({"deg", 0.01745, 0.0});
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/log_columns/joint_columns.hpp"
#include "diagnosis/log_columns/log_recordings.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {

// How recorded positions of joints that turn become radians.
struct AngleUnit {
  std::string name = "rad";
  double factor = 1.0;  // rad
  double centre = 0.0;  // recorded; subtracted before
};

// "a to b", or one of them where they are the same.
[[nodiscard]] std::string from_to(const std::string& first, const std::string& last);

class LoggedRobot {
 public:
  // `base` and `tip`: links, or empty. The log and the families must outlive the robot.
  LoggedRobot(std::filesystem::path urdf, std::string base, std::string tip,
              const LogRecording& log);

  [[nodiscard]] const std::vector<UrdfJoint>& joints() const { return joints_; }
  [[nodiscard]] const std::vector<std::size_t>& chain() const { return chain_; }
  [[nodiscard]] std::string urdf_name() const { return urdf_.string(); }
  [[nodiscard]] std::string base() const;
  [[nodiscard]] std::string tip() const { return joints_[chain_.back()].child; }

  void set_columns(const ColumnFamily* positions, const ColumnFamily* forces) {
    positions_ = positions;
    forces_ = forces;
  }
  [[nodiscard]] const LogColumn& position(std::size_t joint) const {
    return *positions_->columns.at(joint);
  }
  [[nodiscard]] const LogColumn& force(std::size_t joint) const {
    return *forces_->columns.at(joint);
  }
  [[nodiscard]] const ColumnFamily& forces() const { return *forces_; }
  // Whether its logged position moves by no more than an encoder trembles: by 1/200 of what the
  // joint does that moves farthest.
  [[nodiscard]] bool stands_still(std::size_t joint) const;
  // Whether it moves though its force is zero throughout, as without a drive. Of logged joints.
  [[nodiscard]] bool is_passive(std::size_t joint) const;
  // "'tau_1' to 'tau_6'", of the joints in the chain.
  [[nodiscard]] std::string range_of(const ColumnFamily& family) const;

  // Sets the chain; joints that are logged and not in it. Throws InputError where there is none.
  std::vector<std::size_t> choose_chain();

  // Where a position lies beyond its limits if all are in that unit.
  [[nodiscard]] std::vector<Eigen::Index> rows_beyond_limits(const AngleUnit& unit) const;

  // Holds every other joint of the URDF where the log has it on average, within its limits; joints
  // that the log does not have stay at zero.
  void lock_others(const AngleUnit& unit);
  // Those of the chain's links that stand elsewhere than at zero, rad or m by name.
  [[nodiscard]] LockedJoints locked() const;
  // Where a joint stands that is not in the chain.
  [[nodiscard]] double place_of(std::size_t joint) const;

  // Whether all positions lie within them, but for as few rows as a dropout leaves: one of a
  // hundred, or one in two hundred of many.
  [[nodiscard]] bool fits_limits(const AngleUnit& unit) const;

  // The recorded torque over the links' weight, of the joint that carries most; 0 if it can't be
  // told.
  [[nodiscard]] double share_of_weight(const AngleUnit& angle_unit) const;

  // Whether all joints that turn are logged in whole numbers, as an encoder's counts.
  [[nodiscard]] bool holds_counts() const;

  // Whether a title or the user says counts.
  [[nodiscard]] bool is_in_counts() const;

  // m/s^2, in the base link's axes.
  [[nodiscard]] Eigen::Vector3d gravity() const;

 private:
  // Radians, or metres along a prismatic joint.
  [[nodiscard]] Eigen::VectorXd places(std::size_t joint, const AngleUnit& unit) const;
  [[nodiscard]] bool is_moved(std::size_t joint) const;  // of joints whose position is logged

  [[nodiscard]] bool is_usable(std::size_t joint) const;

  // Joints from the root to this one.
  [[nodiscard]] std::vector<std::size_t> path_to(std::size_t joint) const;

  [[nodiscard]] std::string gap_words(std::size_t joint) const;

  void take_chain(const std::vector<std::size_t>& path);

  void require_masses() const;

  std::filesystem::path urdf_;
  std::string asked_base_, asked_tip_;  // links; empty: from the joints that are logged
  const LogRecording& log_;
  std::vector<UrdfJoint> joints_;
  const ColumnFamily* positions_ = nullptr;
  const ColumnFamily* forces_ = nullptr;
  std::vector<std::size_t> chain_;  // joints that move and are logged, from the base on
  std::size_t first_ = 0;           // the joint whose parent link is the base
  LockedJoints locked_;             // all that do not stand at zero
};

}  // namespace graybox
