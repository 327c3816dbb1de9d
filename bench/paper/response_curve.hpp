// Figure 2 of the paper: singular values of the frequency response G (11) at one position, and of
// the inverse controller F^-1, against frequency.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "problems/mechanisms/robot_model.hpp"

namespace graybox::bench {

struct ResponsePoint {
  double frequency = 0.0;              // Hz
  Eigen::VectorXd response;            // singular values of G, rad/s per N m, descending
  Eigen::VectorXd inverse_controller;  // of F^-1, rad/s per N m, descending
};

// `frequencies` in Hz, `joint_angles` (commanded) in rad. Throws InputError for a wrong number of
// joints, or frequencies outside (0, half the sample rate).
[[nodiscard]] std::vector<ResponsePoint> response_curve(const RobotModel& robot,
                                                        const Eigen::VectorXd& joint_angles,
                                                        const std::vector<double>& frequencies);

// Columns: frequency_hz, response_1, ..., inverse_controller_1, ...
[[nodiscard]] std::string to_csv(const std::vector<ResponsePoint>& curve);

}  // namespace graybox::bench
