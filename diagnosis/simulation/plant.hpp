// Plant: what a sampled controller drives. Its state runs in continuous time; its input is held
// between samples.
//
//   auto plant = local_plant(model, robot.sample_time);   // or robot_plant(robot, position)
//   for (...) { y = plant->output(); plant->advance(u); } // one sample of T_s
//
// Inputs u and outputs y are motor-side torques (N m) and velocities (rad/s). All plants start at
// rest; u counts from the torque that holds the robot there, so that rest is u = 0, y = 0.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <vector>

#include "graybox/problems/local_model.hpp"
#include "graybox/problems/robot_model.hpp"

namespace graybox {

class Plant {
 public:
  virtual ~Plant() = default;
  [[nodiscard]] virtual Eigen::Index input_count() const = 0;
  [[nodiscard]] virtual Eigen::Index output_count() const = 0;
  virtual void restart() = 0;  // back to rest
  [[nodiscard]] virtual Eigen::VectorXd output() const = 0;
  // Holds u for one sample. Throws std::runtime_error where the integrator gives up (a state that
  // is not finite, a step that underflows).
  virtual void advance(const Eigen::VectorXd& input) = 0;
};

// The local model, by its exact solution with a held input: x' = A x + B u over T_s is the matrix
// exponential of [A B; 0 0] T_s (Van Loan 1978). Cost O(n^2) a sample.
[[nodiscard]] std::unique_ptr<Plant> local_plant(const LocalModel& model, double sample_time);

// The non-linear robot (robot_dynamics.hpp) at commanded joint angles (rad), integrated sample by
// sample with SUNDIALS ARKODE: Dormand and Prince's embedded pair of orders 5 and 4, steps chosen
// to the tolerance and never across a sample, where the input jumps.
struct IntegratorOptions {
  double relative_tolerance = 1e-7;
  double absolute_tolerance = 1e-10;  // rad and rad/s
};
[[nodiscard]] std::unique_ptr<Plant> robot_plant(const RobotModel& robot,
                                                 const Eigen::VectorXd& joint_angles,
                                                 const IntegratorOptions& options = {});

}  // namespace graybox
