// Plant: what a sampled controller drives. Its state runs in continuous time; its input is held
// between samples.
//
//   auto plant = robot_plant(robot, elements, position);
//   for (...) { y = plant->output(); plant->advance(u); }     // one sample of T_s
//
// Robots: inputs u and outputs y are motor-side torques (N m) and velocities (rad/s). They start at
// rest, and u counts from the commands that hold them there: rest is u = 0, y = 0. Lumped models
// start at q = 0, and u is the input itself.
//
// Without elements a linear plant is solved exactly: x' = A x + B u over T_s with u held is the
// matrix exponential of [A B; 0 0] T_s (Van Loan 1978). Everything else is integrated sample by
// sample with SUNDIALS ARKODE: Dormand and Prince's embedded pair of orders 5 and 4, steps chosen
// to the tolerance and never across a jump of the input. A delayed actuator's input jumps within
// the sample, and a delayed sensor looks at the plant there: the integrator stops at just those
// times.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <stdexcept>
#include <vector>

#include "problems/elements/element.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// A motion that grows without bound, or too fast for the integrator to follow.
class UnstableMotion : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Plant {
 public:
  virtual ~Plant() = default;
  [[nodiscard]] virtual Eigen::Index input_count() const = 0;
  [[nodiscard]] virtual Eigen::Index output_count() const = 0;
  virtual void restart() = 0;  // back to the start
  [[nodiscard]] virtual Eigen::VectorXd output() const = 0;
  // Holds u for one sample. Throws UnstableMotion where the integrator gives up.
  virtual void advance(const Eigen::VectorXd& input) = 0;
};

struct IntegratorOptions {
  double relative_tolerance = 1e-7;
  double absolute_tolerance = 1e-10;  // rad, rad/s, m, m/s
};

// The local model as it is.
[[nodiscard]] std::unique_ptr<Plant> local_plant(const LocalModel& model, double sample_time);

// The robot at commanded joint angles (rad), with elements whose inertia and payload are in the
// model already (load_extended_robot): its local model about rest, or all of its equations. Both
// throw InputError where there is no rest.
[[nodiscard]] std::unique_ptr<Plant> local_robot_plant(const RobotModel& robot,
                                                       const std::vector<Element>& elements,
                                                       const Eigen::VectorXd& joint_angles,
                                                       const IntegratorOptions& options = {});
[[nodiscard]] std::unique_ptr<Plant> robot_plant(const RobotModel& robot,
                                                 const std::vector<Element>& elements,
                                                 const Eigen::VectorXd& joint_angles,
                                                 const IntegratorOptions& options = {});

[[nodiscard]] std::unique_ptr<Plant> lumped_plant(const LumpedModel& model,
                                                  const IntegratorOptions& options = {});

}  // namespace graybox
