#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

#include "graybox/diagnosis/simulation/plant.hpp"

namespace graybox {
namespace {

class LocalPlant : public Plant {
 public:
  LocalPlant(const LocalModel& model, double sample_time)
      : output_(model.output), state_(Eigen::VectorXd::Zero(model.state_count())), next_(state_) {
    const Eigen::Index n = model.degrees_of_freedom(), m = model.input.cols();
    const auto mass = model.mass.llt();
    Eigen::MatrixXd augmented = Eigen::MatrixXd::Zero(2 * n + m, 2 * n + m);
    augmented.block(0, n, n, n).setIdentity();
    augmented.block(n, 0, n, n) = mass.solve(-model.stiffness);
    augmented.block(n, n, n, n) = mass.solve(-model.damping);
    augmented.block(n, 2 * n, n, m) = mass.solve(model.input);
    const Eigen::MatrixXd exponential = (augmented * sample_time).exp();
    transition_ = exponential.topLeftCorner(2 * n, 2 * n);
    input_ = exponential.topRightCorner(2 * n, m);
  }

  [[nodiscard]] Eigen::Index input_count() const override { return input_.cols(); }
  [[nodiscard]] Eigen::Index output_count() const override { return output_.rows(); }
  void restart() override { state_.setZero(); }
  [[nodiscard]] Eigen::VectorXd output() const override {
    return output_ * state_.tail(output_.cols());
  }
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

std::unique_ptr<Plant> local_plant(const LocalModel& model, double sample_time) {
  return std::make_unique<LocalPlant>(model, sample_time);
}

}  // namespace graybox
