// Mechanism: equations of motion q'' = a(q, q', u, f) with inputs u, further generalised forces f
// and measured outputs, for the integrator of plant.hpp.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

class Mechanism {
 public:
  virtual ~Mechanism() = default;
  [[nodiscard]] virtual Eigen::Index coordinate_count() const = 0;
  [[nodiscard]] virtual Eigen::Index input_count() const = 0;
  [[nodiscard]] virtual Eigen::Index output_count() const = 0;
  // No allocation; the last argument has its size.
  virtual void accelerate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                          const Eigen::VectorXd& input, const Eigen::VectorXd& force,
                          Eigen::VectorXd& acceleration) = 0;
  virtual void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                       Eigen::VectorXd& output) const = 0;
};

// M q'' + C q' + K (q - q_0) = B (u - u_0) + f - f_0,  y = S_0 (q - q_0) + S_1 q'.
struct LinearMotion {
  Eigen::MatrixXd mass, damping, stiffness, input, position_output, velocity_output;
  Eigen::VectorXd rest;        // q_0
  Eigen::VectorXd rest_input;  // u_0
  Eigen::VectorXd rest_force;  // f_0
};
[[nodiscard]] std::unique_ptr<Mechanism> linear_mechanism(const LinearMotion& motion);

// The local model about its own rest, q_0 = its position: with u_0 = 0 and f_0 = 0.
[[nodiscard]] LinearMotion linear_motion(const LocalModel& model);

// The non-linear robot (robot_dynamics.hpp); keeps a reference.
[[nodiscard]] std::unique_ptr<Mechanism> robot_mechanism(const RobotModel& robot);

}  // namespace graybox
