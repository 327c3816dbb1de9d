#include "problems/mechanisms/robot_rest.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/mechanisms/local_model.hpp"

namespace graybox {
namespace {

constexpr int kMaxSteps = 200;
constexpr double kTolerance = 1e-13;  // rad: torque left over, by the spring that would carry it

// Torques on all coordinates at rest, less what holds the motors, and their slope.
class Balance {
 public:
  Balance(const RobotModel& robot, const ElementDynamics& elements, const Eigen::VectorXd& angles)
      : evaluator_(robot.chain),
        elements_(&elements),
        gearboxes_(robot.gearbox_rotations()),
        arm_(robot.arm_size()),
        stiffness_(arm_),
        commanded_(Eigen::VectorXd::Zero(arm_)),
        coordinates_(arm_ + angles.size()) {
    for (Eigen::Index i = 0; i < arm_; ++i) {
      stiffness_(i) = robot.springs[static_cast<std::size_t>(i)].stiffness;
    }
    for (std::size_t j = 0; j < gearboxes_.size(); ++j) {
      commanded_(gearboxes_[j]) = angles(static_cast<Eigen::Index>(j));
    }
    coordinates_.tail(angles.size()) = angles;
  }

  void move_to(const Eigen::VectorXd& rotations) {
    coordinates_.head(arm_) = rotations;
    const Eigen::Index size = coordinates_.size();
    element_force_ = Eigen::VectorXd::Zero(size);
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(size, size);
    elements_->add_static_force(coordinates_, element_force_, slope);
    spring_torque_ = stiffness_.cwiseProduct(rotations - commanded_);
    left_over_ = spring_torque_ + evaluator_.gravity_torque(rotations) - element_force_.head(arm_);
    slope_ = evaluator_.gravity_stiffness(rotations) - slope.topLeftCorner(arm_, arm_);
    slope_.diagonal() += stiffness_;
  }

  [[nodiscard]] double error() const {  // rad
    return left_over_.cwiseQuotient(stiffness_).lpNorm<Eigen::Infinity>();
  }
  [[nodiscard]] Eigen::VectorXd newton_step(double damping) const {
    Eigen::MatrixXd matrix = slope_;
    matrix.diagonal() += damping * stiffness_;
    return matrix.partialPivLu().solve(-left_over_);
  }
  [[nodiscard]] Eigen::VectorXd rotations() const { return coordinates_.head(arm_); }
  [[nodiscard]] const Eigen::VectorXd& coordinates() const { return coordinates_; }
  // The torque of elements and gearboxes on the motors, in joint angles.
  [[nodiscard]] Eigen::VectorXd pull_on_motors() const {
    Eigen::VectorXd pull = element_force_.tail(coordinates_.size() - arm_);
    for (std::size_t j = 0; j < gearboxes_.size(); ++j) {
      pull(static_cast<Eigen::Index>(j)) += spring_torque_(gearboxes_[j]);
    }
    return pull;
  }

 private:
  RigidChainEvaluator evaluator_;
  const ElementDynamics* elements_;
  std::vector<Eigen::Index> gearboxes_;
  Eigen::Index arm_;
  Eigen::VectorXd stiffness_, commanded_, coordinates_;
  Eigen::VectorXd element_force_, spring_torque_, left_over_;
  Eigen::MatrixXd slope_;
};

}  // namespace

RobotRest robot_rest(const RobotModel& robot, const ElementDynamics& elements,
                     const Eigen::VectorXd& joint_angles) {
  Balance balance(robot, elements, joint_angles);
  balance.move_to(LocalModelBuilder(robot).linearise(joint_angles).rotations);
  double damping = 0.0, error = balance.error();
  for (int step = 0; step < kMaxSteps && error > kTolerance; ++step) {
    const Eigen::VectorXd here = balance.rotations(), change = balance.newton_step(damping);
    balance.move_to(here + change);
    if (balance.error() < error) {
      error = balance.error();
      damping *= 0.25;
      if (damping < 1e-3) damping = 0.0;
      continue;
    }
    // The last digits: rounding keeps the error from falling further.
    if (change.lpNorm<Eigen::Infinity>() < kTolerance) {
      balance.move_to(here);
      error = 0.0;
      break;
    }
    balance.move_to(here);
    damping = std::max(4.0 * damping, 1e-3);
  }
  if (!(error <= kTolerance)) {
    throw InputError(fmt::format(
        "{}: the arm finds no static equilibrium with its elements at this position", robot.name));
  }
  return {balance.coordinates(),
          -robot.transmission.transpose().partialPivLu().solve(balance.pull_on_motors())};
}

}  // namespace graybox
