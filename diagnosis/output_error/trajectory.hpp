// The simulated outputs of one stretch of samples, with their derivatives: the system of
// lumped_system.hpp through the steps of exponential_operators.hpp. At uneven times, and where no
// coordinate is free, A is part of N and the method is that of Runge and Kutta.
#pragma once

#include <Eigen/Core>

#include "diagnosis/output_error/exponential_operators.hpp"
#include "diagnosis/output_error/lumped_system.hpp"
#include "diagnosis/output_error/node_inputs.hpp"

namespace graybox {

struct Stretch {
  Eigen::Index first = 0;  // sample
  Eigen::Index count = 0;
};

class TrajectoryIntegrator {
 public:
  // `operators`: for the step in use; null at uneven times. Both are kept by reference, and the
  // system's workspace is used.
  TrajectoryIntegrator(LumpedSystem& system, const ExponentialOperators* operators);

  // Rows of `outputs`: sample by sample, the outputs of each, [value, parameters, initial state].
  // `initial`: q and q' of the free coordinates; empty: zero. Columns behind the parameters, if the
  // system has any, are the derivatives by it. False where the motion leaves all bounds.
  bool run(const NodeInputs& inputs, const Eigen::VectorXd& time, const Stretch& stretch,
           const Eigen::VectorXd& initial, Rows& outputs);

 private:
  void start(const NodeInputs& inputs, const Stretch& stretch, const Eigen::VectorXd& initial);
  void exponential_step(const NodeInputs& inputs, Eigen::Index node);
  void runge_kutta_step(const NodeInputs& inputs, Eigen::Index node, double step);
  void add(const ExponentialOperator& op, const Rows& in, Rows& out) const;
  void rates(const Rows& state, const NodeInputs& inputs, Eigen::Index node, bool whole, Rows& out);

  LumpedSystem& system_;
  const ExponentialOperators* operators_;
  double step_ = 0.0;
  Rows state_, stage_, flow_, next_, sampled_;
  Rows rate_0_, rate_1_, rate_2_, rate_3_;
};

}  // namespace graybox
