// The commanded joint angles of a robot as a continuum of candidates, in degrees like the
// coordinates of robot_information_set().
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "problems/information/candidate_space.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "problems/robot_information/robot_information.hpp"

namespace graybox {

// The limits of the robot's joints in its URDF, degrees; infinite where the URDF gives none.
[[nodiscard]] std::vector<JointRange> urdf_ranges(const RobotModel& robot);

class RobotSpace : public CandidateSpace {
 public:
  // One range a joint, degrees, the robot's own limits respected; from = to fixes a joint. Keeps a
  // reference to the robot. Throws InputError naming the joint for another number of ranges, a
  // range that is reversed, infinite, or goes beyond the limits of the URDF.
  RobotSpace(const RobotModel& robot, const std::vector<JointRange>& ranges,
             const RobotInformationOptions& options = {});

  [[nodiscard]] std::size_t dimension() const override { return robot_.parameters.size(); }
  [[nodiscard]] std::span<const double> lower() const override { return lower_; }
  [[nodiscard]] std::span<const double> upper() const override { return upper_; }
  [[nodiscard]] std::unique_ptr<InformationEvaluator> evaluator() const override;

  // The positions of a table that lie in the box. Throws InputError if there is none.
  [[nodiscard]] PositionTable inside(const PositionTable& positions) const;

 private:
  const RobotModel& robot_;
  RobotInformationOptions options_;
  std::vector<double> lower_, upper_;
};

}  // namespace graybox
