#include "diagnosis/simulation/mechanism.hpp"

#include <Eigen/Cholesky>

#include "problems/mechanisms/robot_dynamics.hpp"

namespace graybox {
namespace {

class LinearMechanism : public Mechanism {
 public:
  explicit LinearMechanism(const LinearMotion& motion) : motion_(motion), factor_(motion.mass) {}

  [[nodiscard]] Eigen::Index coordinate_count() const override { return motion_.mass.rows(); }
  [[nodiscard]] Eigen::Index input_count() const override { return motion_.input.cols(); }
  [[nodiscard]] Eigen::Index output_count() const override {
    return motion_.velocity_output.rows();
  }

  void accelerate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                  const Eigen::VectorXd& input, const Eigen::VectorXd& force,
                  Eigen::VectorXd& acceleration) override {
    from_rest_ = q - motion_.rest;
    extra_input_ = input - motion_.rest_input;
    acceleration = force - motion_.rest_force;
    acceleration.noalias() -= motion_.damping * velocity;
    acceleration.noalias() -= motion_.stiffness * from_rest_;
    acceleration.noalias() += motion_.input * extra_input_;
    factor_.solveInPlace(acceleration);
  }

  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
               Eigen::VectorXd& output) const override {
    output.noalias() = motion_.velocity_output * velocity;
    output.noalias() += motion_.position_output * (q - motion_.rest);
  }

 private:
  LinearMotion motion_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd from_rest_, extra_input_;
};

class RobotMechanism : public Mechanism {
 public:
  explicit RobotMechanism(const RobotModel& robot)
      : transmission_(robot.transmission), dynamics_(robot) {}

  [[nodiscard]] Eigen::Index coordinate_count() const override {
    return dynamics_.degrees_of_freedom();
  }
  [[nodiscard]] Eigen::Index input_count() const override { return transmission_.rows(); }
  [[nodiscard]] Eigen::Index output_count() const override { return transmission_.rows(); }

  void accelerate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                  const Eigen::VectorXd& input, const Eigen::VectorXd& force,
                  Eigen::VectorXd& acceleration) override {
    dynamics_.accelerate(q, velocity, input, force, acceleration);
  }
  void measure(const Eigen::VectorXd& /*q*/, const Eigen::VectorXd& velocity,
               Eigen::VectorXd& output) const override {
    output.noalias() = transmission_ * velocity.tail(transmission_.cols());
  }

 private:
  Eigen::MatrixXd transmission_;
  RobotDynamics dynamics_;
};

}  // namespace

std::unique_ptr<Mechanism> linear_mechanism(const LinearMotion& motion) {
  return std::make_unique<LinearMechanism>(motion);
}

LinearMotion linear_motion(const LocalModel& model) {
  const Eigen::Index n = model.degrees_of_freedom();
  return {model.mass,
          model.damping,
          model.stiffness,
          model.input,
          Eigen::MatrixXd::Zero(model.output.rows(), n),
          model.output,
          model.position.size() == n ? model.position : Eigen::VectorXd::Zero(n),
          Eigen::VectorXd::Zero(model.input.cols()),
          Eigen::VectorXd::Zero(n)};
}

std::unique_ptr<Mechanism> robot_mechanism(const RobotModel& robot) {
  return std::make_unique<RobotMechanism>(robot);
}

}  // namespace graybox
