#include "diagnosis/simulation/exact_plant.hpp"

#include <Eigen/Cholesky>
#include <unsupported/Eigen/MatrixFunctions>

namespace graybox {
namespace {

// The state counts from rest: (q - q_0, q').
class ExactPlant : public Plant {
 public:
  ExactPlant(const LinearMotion& motion, double sample_time)
      : output_(motion.velocity_output.rows(), 2 * motion.mass.rows()),
        state_(Eigen::VectorXd::Zero(2 * motion.mass.rows())),
        next_(state_) {
    const Eigen::Index n = motion.mass.rows(), m = motion.input.cols();
    output_ << motion.position_output, motion.velocity_output;
    const auto mass = motion.mass.llt();
    Eigen::MatrixXd augmented = Eigen::MatrixXd::Zero(2 * n + m, 2 * n + m);
    augmented.block(0, n, n, n).setIdentity();
    augmented.block(n, 0, n, n) = mass.solve(-motion.stiffness);
    augmented.block(n, n, n, n) = mass.solve(-motion.damping);
    augmented.block(n, 2 * n, n, m) = mass.solve(motion.input);
    const Eigen::MatrixXd exponential = (augmented * sample_time).exp();
    transition_ = exponential.topLeftCorner(2 * n, 2 * n);
    input_ = exponential.topRightCorner(2 * n, m);
  }

  [[nodiscard]] Eigen::Index input_count() const override { return input_.cols(); }
  [[nodiscard]] Eigen::Index output_count() const override { return output_.rows(); }
  void restart() override { state_.setZero(); }
  [[nodiscard]] Eigen::VectorXd output() const override { return output_ * state_; }
  void advance(const Eigen::VectorXd& input) override {
    next_.noalias() = transition_ * state_;
    next_.noalias() += input_ * input;
    state_.swap(next_);
  }

 private:
  Eigen::MatrixXd output_, transition_, input_;
  Eigen::VectorXd state_, next_;
};

}  // namespace

std::unique_ptr<Plant> exact_plant(const LinearMotion& motion, double sample_time) {
  return std::make_unique<ExactPlant>(motion, sample_time);
}

}  // namespace graybox
