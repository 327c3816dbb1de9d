// The matrix of the cross product: cross_matrix(v) * w = v x w.
#pragma once

#include <Eigen/Core>

namespace graybox {

[[nodiscard]] inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

}  // namespace graybox
