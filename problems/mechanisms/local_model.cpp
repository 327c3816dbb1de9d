#include "problems/mechanisms/local_model.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr int kMaxNewtonSteps = 30;
constexpr double kEquilibriumTolerance = 1e-13;  // rad, of the last Newton step

void add_elements(const RobotModel& robot, LocalModel& model) {
  const Eigen::Index arm = robot.arm_size();
  for (const auto kind : {LinearElement::Kind::kSpring, LinearElement::Kind::kDamper}) {
    for (std::size_t s = 0; s < robot.springs.size(); ++s) {
      const ArmSpring& spring = robot.springs[s];
      LinearElement element{
          spring.name, kind,
          Eigen::VectorXd::Unit(model.degrees_of_freedom(), static_cast<Eigen::Index>(s)),
          kind == LinearElement::Kind::kSpring ? spring.stiffness : spring.damping};
      if (spring.is_gearbox) element.location(arm + static_cast<Eigen::Index>(spring.joint)) = -1.0;
      Eigen::MatrixXd& matrix =
          kind == LinearElement::Kind::kSpring ? model.stiffness : model.damping;
      matrix += element.value * element.location * element.location.transpose();
      model.elements.push_back(std::move(element));
    }
  }
}

}  // namespace

LocalModel LocalModel::with_parameters(const Eigen::VectorXd& theta) const {
  if (theta.size() != static_cast<Eigen::Index>(parameters.size())) {
    throw InputError(fmt::format("local model: {} parameters given, the model has {}", theta.size(),
                                 parameters.size()));
  }
  LocalModel result = *this;
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    LinearElement& element = result.elements[parameters[p]];
    const double change = element.value * (theta(static_cast<Eigen::Index>(p)) - 1.0);
    Eigen::MatrixXd& matrix =
        element.kind == LinearElement::Kind::kSpring ? result.stiffness : result.damping;
    matrix += change * element.location * element.location.transpose();
    element.value += change;
  }
  return result;
}

LocalModelBuilder::LocalModelBuilder(const RobotModel& robot, const LinearisationOptions& options)
    : robot_(&robot),
      options_(options),
      evaluator_(robot.chain),
      gearboxes_(robot.gearbox_rotations()),
      spring_stiffness_(robot.arm_size()),
      commanded_(Eigen::VectorXd::Zero(robot.arm_size())) {
  for (Eigen::Index i = 0; i < robot.arm_size(); ++i) {
    spring_stiffness_(i) = robot.springs[static_cast<std::size_t>(i)].stiffness;
  }
}

// Newton's method on k (q - q0) + g(q) = 0; its matrix, diag(k) + dg/dq, must be positive definite
// at the solution, else the equilibrium is none that lasts.
void LocalModelBuilder::solve_equilibrium(const Eigen::VectorXd& commanded) {
  arm_.rotations = commanded;
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    const Eigen::VectorXd residual = spring_stiffness_.cwiseProduct(arm_.rotations - commanded) +
                                     evaluator_.gravity_torque(arm_.rotations);
    Eigen::MatrixXd jacobian = evaluator_.gravity_stiffness(arm_.rotations);
    jacobian.diagonal() += spring_stiffness_;
    const Eigen::LLT<Eigen::MatrixXd> factor(jacobian);
    if (factor.info() != Eigen::Success) break;
    const Eigen::VectorXd change = factor.solve(residual);
    arm_.rotations -= change;
    if (change.lpNorm<Eigen::Infinity>() <= kEquilibriumTolerance) return;
  }
  throw InputError(fmt::format(
      "robot {}: the arm finds no stable static equilibrium at this position: the springs are too "
      "soft; look at 'stiffness' of its joints",
      robot_->name));
}

const ArmLinearisation& LocalModelBuilder::at_rotations(const Eigen::VectorXd& rotations) {
  arm_.rotations = rotations;
  arm_.mass = evaluator_.mass_matrix(arm_.rotations);
  arm_.gravity_stiffness = evaluator_.gravity_stiffness(arm_.rotations);
  return arm_;
}

const ArmLinearisation& LocalModelBuilder::linearise(const Eigen::VectorXd& joint_angles) {
  if (joint_angles.size() != robot_->motor_count()) {
    throw InputError(fmt::format("{}: a position has {} joint angles, {} given", robot_->name,
                                 robot_->motor_count(), joint_angles.size()));
  }
  for (std::size_t j = 0; j < gearboxes_.size(); ++j) {
    commanded_(gearboxes_[j]) = joint_angles(static_cast<Eigen::Index>(j));
  }
  if (!options_.gravity_deflection) return at_rotations(commanded_);
  solve_equilibrium(commanded_);
  return at_rotations(Eigen::VectorXd(arm_.rotations));
}

LocalModel LocalModelBuilder::build(const Eigen::VectorXd& joint_angles) {
  return model_of(linearise(joint_angles), joint_angles);
}

LocalModel LocalModelBuilder::build_at(const Eigen::VectorXd& rotations,
                                       const Eigen::VectorXd& joint_angles) {
  return model_of(at_rotations(rotations), joint_angles);
}

LocalModel LocalModelBuilder::model_of(const ArmLinearisation& arm,
                                       const Eigen::VectorXd& joint_angles) const {
  const RobotModel& robot = *robot_;
  const Eigen::Index n_arm = robot.arm_size(), n_motor = robot.motor_count();
  const Eigen::Index n = n_arm + n_motor;
  const Eigen::MatrixXd& transmission = robot.transmission;

  LocalModel model;
  model.position.resize(n);
  model.position << arm.rotations, joint_angles;
  model.mass = Eigen::MatrixXd::Zero(n, n);
  model.mass.topLeftCorner(n_arm, n_arm) = arm.mass;
  model.mass.bottomRightCorner(n_motor, n_motor) =
      transmission.transpose() * robot.motor_inertia.asDiagonal() * transmission;
  model.damping = Eigen::MatrixXd::Zero(n, n);
  model.damping.bottomRightCorner(n_motor, n_motor) =
      transmission.transpose() * robot.motor_friction.asDiagonal() * transmission;
  model.stiffness = Eigen::MatrixXd::Zero(n, n);
  model.stiffness.topLeftCorner(n_arm, n_arm) = arm.gravity_stiffness;
  model.output = Eigen::MatrixXd::Zero(n_motor, n);
  model.output.rightCols(n_motor) = transmission;
  model.input = model.output.transpose();
  add_elements(robot, model);
  model.parameters = robot.parameters;  // springs are the first elements, in the same order
  return model;
}

}  // namespace graybox
