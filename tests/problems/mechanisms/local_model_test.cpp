#include "problems/mechanisms/local_model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "problems/base/error.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Undamped natural frequencies, Hz, increasing.
VectorXd natural_frequencies(const MatrixXd& stiffness, const MatrixXd& mass) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(stiffness, mass,
                                                                  Eigen::EigenvaluesOnly);
  return solver.eigenvalues().cwiseMax(0.0).cwiseSqrt() / (2.0 * std::numbers::pi);
}

TEST(LocalModel, HasEighteenDegreesOfFreedomAndSymmetricMatrices) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  for (const VectorXd& position : robot_test::some_positions()) {
    const LocalModel model = builder.build(position);
    EXPECT_EQ(model.degrees_of_freedom(), 18);
    EXPECT_EQ(model.state_count(), 36);
    EXPECT_EQ(model.elements.size(), 24U);
    EXPECT_EQ((model.mass - model.mass.transpose()).norm(), 0.0);
    EXPECT_EQ((model.stiffness - model.stiffness.transpose()).norm(), 0.0);
    EXPECT_EQ((model.damping - model.damping.transpose()).norm(), 0.0);
    EXPECT_EQ(Eigen::LLT<MatrixXd>(model.mass).info(), Eigen::Success);
    EXPECT_EQ((model.input - model.output.transpose()).norm(), 0.0);
    // With the motors held, the arm stands stably on its springs.
    EXPECT_EQ(Eigen::LLT<MatrixXd>(model.stiffness.topLeftCorner(12, 12)).info(), Eigen::Success);
  }
}

TEST(LocalModel, StiffnessAndDampingAreTheElementsAndGravity) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(robot_test::some_positions()[4]);
  RigidChainEvaluator evaluator(robot.chain);
  MatrixXd stiffness = MatrixXd::Zero(18, 18), damping = stiffness;
  stiffness.topLeftCorner(12, 12) = evaluator.gravity_stiffness(model.position.head(12));
  for (const LinearElement& element : model.elements) {
    (element.kind == LinearElement::Kind::kSpring ? stiffness : damping) +=
        element.value * element.location * element.location.transpose();
  }
  EXPECT_LT((stiffness - model.stiffness).norm(), 1e-15 * stiffness.norm());
  EXPECT_LT((damping - model.damping).norm(), 1e-15 * damping.norm());
}

// Springs are at rest where arm and motor (in joint angles) agree: their torque holds the weight.
TEST(LocalModel, TheArmRestsInStaticEquilibriumBelowTheMotors) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  RigidChainEvaluator evaluator(robot.chain);
  for (const VectorXd& position : robot_test::some_positions()) {
    const LocalModel model = builder.build(position);
    VectorXd spring_torque = VectorXd::Zero(18);
    for (const LinearElement& element : model.elements) {
      if (element.kind == LinearElement::Kind::kSpring) {
        spring_torque += element.value * element.location * element.location.dot(model.position);
      }
    }
    const VectorXd arm = model.position.head(12);
    const VectorXd weight = evaluator.gravity_torque(arm);
    EXPECT_LT((spring_torque.head(12) + weight).norm(), 1e-9 * weight.norm());
    EXPECT_EQ(model.position.tail(6), position);

    // The total energy is a minimum there: lower than at the commanded position.
    VectorXd commanded = VectorXd::Zero(12);
    const auto gearboxes = robot.gearbox_rotations();
    for (std::size_t j = 0; j < 6; ++j) {
      commanded(gearboxes[j]) = position(static_cast<Eigen::Index>(j));
    }
    EXPECT_LT(evaluator.potential_energy(arm), evaluator.potential_energy(commanded));
  }
}

TEST(LocalModel, WithoutGravityOrWithoutDeflectionTheArmStandsAtTheCommand) {
  RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[4];
  LocalModelBuilder at_command(robot, {.gravity_deflection = false});
  const LocalModel model = at_command.build(position);
  const auto gearboxes = robot.gearbox_rotations();
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(model.position(gearboxes[j]), position(static_cast<Eigen::Index>(j)));
  }
  EXPECT_EQ(model.position(0), 0.0);

  robot.chain = RigidChain(robot.chain.rotations(), Eigen::Vector3d::Zero());
  LocalModelBuilder weightless(robot);
  const LocalModel floating = weightless.build(position);
  EXPECT_EQ(floating.position, model.position);
  EXPECT_EQ((floating.mass - model.mass).norm(), 0.0);
}

// Free motors: without gravity six rigid-body motions remain, the rest are the resonances. Figures
// of an independent prototype at q = 0, printed with one decimal.
TEST(LocalModel, ResonancesAtTheZeroPositionAreThePrototypes) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(VectorXd::Zero(6));
  const VectorXd free = natural_frequencies(model.stiffness, model.mass);
  const VectorXd locked =
      natural_frequencies(model.stiffness.topLeftCorner(12, 12), model.mass.topLeftCorner(12, 12));
  const double expected_free[] = {9.4, 13.3, 17.9, 19.6, 33.7, 41.1, 44.2, 46.8, 58.6};
  const double expected_locked[] = {5.6, 5.7, 14.5, 15.4, 29.3, 39.1};
  for (Eigen::Index k = 0; k < 6; ++k) EXPECT_LT(free(k), 1.0);
  for (Eigen::Index k = 0; k < 9; ++k) EXPECT_NEAR(free(k + 6) / expected_free[k], 1.0, 0.02);
  for (Eigen::Index k = 0; k < 6; ++k) EXPECT_NEAR(locked(k) / expected_locked[k], 1.0, 0.02);
}

TEST(LocalModel, ParametersScaleTheirSpringsAlone) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(robot_test::some_positions()[1]);
  VectorXd theta = VectorXd::Ones(12);
  theta(7) = 1.25;  // joint_1.bearing_y
  const LocalModel stiffer = model.with_parameters(theta);
  MatrixXd change = stiffer.stiffness - model.stiffness;
  EXPECT_NEAR(change(1, 1), 0.25 * 6.56e6, 1e-6);
  change(1, 1) = 0.0;
  EXPECT_EQ(change.norm(), 0.0);
  EXPECT_EQ((stiffer.mass - model.mass).norm(), 0.0);
  EXPECT_THROW((void)model.with_parameters(VectorXd::Ones(3)), InputError);
}

TEST(LocalModel, RefusesWrongPositionsAndSpringsTooSoftToStand) {
  RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  EXPECT_THROW((void)builder.build(VectorXd::Zero(5)), InputError);
  for (ArmSpring& spring : robot.springs) spring.stiffness = 10.0;
  LocalModelBuilder soft(robot);
  EXPECT_THROW((void)soft.build(VectorXd::Zero(6)), InputError);
}

}  // namespace
}  // namespace graybox
