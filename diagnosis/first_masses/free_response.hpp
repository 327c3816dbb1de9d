// The motion of a mass with viscous friction, x' = v, v' = -p v + f, with f held between samples:
//
//   v(k+1) = e v(k) + phi1 h f(k),  x(k+1) = x(k) + phi1 h v(k) + phi2 h^2 f(k),
//   e = exp(-p h), phi1 = (1 - e)/(p h), phi2 = (1 - phi1)/(p h),
//
// and signals without what any start x0, v0 may have added to them in a segment.
#pragma once

#include <Eigen/Core>

namespace graybox {

class FreeResponse {
 public:
  // `pole`: 1/s, not negative; `step`: s; `length`: samples of a segment.
  FreeResponse(double pole, double step, bool is_velocity, Eigen::Index length);

  // Position, or velocity, from rest.
  [[nodiscard]] Eigen::VectorXd of(const Eigen::Ref<const Eigen::VectorXd>& force) const;

  // The columns of one segment, at right angles to the starts.
  [[nodiscard]] Eigen::MatrixXd without_start(
      const Eigen::Ref<const Eigen::MatrixXd>& segment) const;

 private:
  bool is_velocity_;
  double decay_, by_speed_, by_force_, speed_by_force_;
  Eigen::MatrixXd starts_;  // orthonormal
};

}  // namespace graybox
