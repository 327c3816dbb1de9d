// The force of laws along a motion whose torques went through low-pass filters before they were
// sampled.
//
// The recorded torque is F(tau), so a law adds F(f(z, z')) to it and not f(F z, F z'): a friction
// that jumps is a ramp there. The motion is interpolated between samples (cubic Hermite) until the
// filter's shortest wave spans kSamplesAWave of them, the law's force is taken along that and goes
// through F. What of the force follows the motion linearly has passed F with the motion: the part
// that least squares on z, z' and z'' explain is left as it is. So linear laws are exact.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/inverse_dynamics/law_force.hpp"
#include "diagnosis/inverse_dynamics/motion_record.hpp"

namespace graybox {

class FilteredMotion {
 public:
  explicit FilteredMotion(const Motion& piece);

  // Whether any filter is to be passed.
  [[nodiscard]] bool is_filtered() const { return !filters_.empty(); }
  // At every sample of the piece, for z = input^T q.
  [[nodiscard]] Eigen::VectorXd force(const Law& law, const Eigen::VectorXd& input) const;
  // What force() needs of the motion there is kept for later calls.
  void prepare(const Eigen::VectorXd& input);

 private:
  struct Prepared {
    Eigen::VectorXd input;
    RecordedPlaceMotion motion;
    Eigen::MatrixXd linear;   // z, z', z'', each of length one
    Eigen::MatrixXd inverse;  // of their Gram matrix
  };
  [[nodiscard]] Prepared prepared(const Eigen::VectorXd& input) const;
  [[nodiscard]] Eigen::VectorXd force(const Law& law, const Prepared& place) const;
  [[nodiscard]] Eigen::VectorXd filtered(const Eigen::VectorXd& force, const Prepared& place) const;

  std::vector<Prepared> prepared_;
  std::vector<FilterPass> filters_;
  Motion motion_;           // interpolated
  Eigen::Index steps_ = 1;  // of it in a sample
  double step_ = 0.0;       // s
};

}  // namespace graybox
