// The non-linear robot against its linearisation, energy and momentum balances.
#include "problems/mechanisms/robot_dynamics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "problems/base/random.hpp"
#include "problems/mechanisms/chain_dynamics.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_rest.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd random_vector(Random& random, Eigen::Index size, double scale) {
  VectorXd result(size);
  for (double& value : result) value = scale * random.normal();
  return result;
}

VectorXd resting_state(const RobotModel& robot, const VectorXd& position) {
  VectorXd state = VectorXd::Zero(36);
  state.head(18) = robot_rest(robot, {}, position).coordinates;
  return state;
}

// A state far from rest: deflections of a few milliradians, joints turning.
VectorXd moving_state(const RobotModel& robot, const VectorXd& position, std::uint64_t seed) {
  Random random(seed);
  VectorXd state = resting_state(robot, position);
  state.head(18) += random_vector(random, 18, 2e-3);
  state.tail(18) += random_vector(random, 18, 0.5);
  return state;
}

// The recursions of the simulation against Orocos KDL's, and against the positions' derivatives.
TEST(ChainDynamics, AgreesWithKdl) {
  const RobotModel robot = robot_test::paper_robot();
  RigidChainEvaluator kdl(robot.chain);
  ChainDynamics dynamics(robot.chain);
  Random random(5);
  for (int draw = 0; draw < 20; ++draw) {
    const VectorXd q = random_vector(random, 12, 1.0), velocity = random_vector(random, 12, 2.0);
    dynamics.evaluate(q, velocity);
    const MatrixXd mass = kdl.mass_matrix(q);
    EXPECT_LT((dynamics.mass() - mass).norm(), 1e-12 * mass.norm());
    const VectorXd bias = kdl.coriolis_torque(q, velocity) + kdl.gravity_torque(q);
    EXPECT_LT((dynamics.bias() - bias).norm(), 1e-12 * bias.norm());
  }
}

TEST(RobotDynamics, RestsWhereItHangs) {
  const RobotModel robot = robot_test::paper_robot();
  RobotDynamics dynamics(robot);
  VectorXd rate(36);
  for (const VectorXd& position : robot_test::some_positions()) {
    const VectorXd state = resting_state(robot, position);
    dynamics.rate(state, robot_rest(robot, {}, position).holding_torque, VectorXd::Zero(18), rate);
    EXPECT_LT(rate.lpNorm<Eigen::Infinity>(), 1e-7);
    dynamics.rate(state, VectorXd::Zero(6), VectorXd::Zero(18), rate);
    EXPECT_GT(rate.lpNorm<Eigen::Infinity>(), 1e-2);  // let go, it falls
  }
}

// Central differences of the rate about rest give the local model's matrices.
TEST(RobotDynamics, LinearisesToTheLocalModel) {
  const RobotModel robot = robot_test::paper_robot();
  RobotDynamics dynamics(robot);
  LocalModelBuilder builder(robot);
  const VectorXd none = VectorXd::Zero(18);
  for (const VectorXd& position : robot_test::some_positions()) {
    const LocalModel model = builder.build(position);
    const VectorXd rest = resting_state(robot, position);
    const VectorXd hold = robot_rest(robot, {}, position).holding_torque;
    const Eigen::LLT<MatrixXd> mass(model.mass);
    MatrixXd expected(18, 36), found(18, 36);
    expected << mass.solve(-model.stiffness), mass.solve(-model.damping);
    for (Eigen::Index k = 0; k < 36; ++k) {
      const double step = k < 18 ? 1e-5 : 1e-4;
      VectorXd up(36), down(36);
      dynamics.rate(rest + step * VectorXd::Unit(36, k), hold, none, up);
      dynamics.rate(rest - step * VectorXd::Unit(36, k), hold, none, down);
      found.col(k) = (up - down).tail(18) / (2.0 * step);
    }
    for (Eigen::Index k = 0; k < 36; ++k) {
      EXPECT_LT((found - expected).col(k).norm(), 1e-6 * expected.col(k).norm() + 1e-4) << k;
    }
    const VectorXd torque = VectorXd::LinSpaced(6, 1.0, 2.0);
    VectorXd pushed(36);
    dynamics.rate(rest, hold + torque, none, pushed);
    EXPECT_LT((pushed.tail(18) - mass.solve(model.input * torque)).norm(), 1e-7 * pushed.norm());
  }
}

// d(energy)/dt = power of motors and forces - dissipation, at any state.
TEST(RobotDynamics, EnergyBalance) {
  const RobotModel robot = robot_test::paper_robot();
  RobotDynamics dynamics(robot);
  std::uint64_t seed = 1;
  for (const VectorXd& position : robot_test::some_positions()) {
    const VectorXd state = moving_state(robot, position, ++seed);
    Random random(seed + 100);
    const VectorXd torque = random_vector(random, 6, 5.0);
    const VectorXd force = random_vector(random, 18, 100.0);
    VectorXd rate(36);
    dynamics.rate(state, torque, force, rate);
    const double step = 1e-6;
    const double change =
        (dynamics.energy(state + step * rate) - dynamics.energy(state - step * rate)) /
        (2.0 * step);
    const double power = torque.dot(dynamics.motor_velocity(state)) + force.dot(state.tail(18)) -
                         dynamics.dissipated_power(state);
    EXPECT_NEAR(change, power, 1e-6 * std::abs(power) + 1e-3);
  }
}

// Let go without dampers, the robot swings and keeps its energy, while kinetic energy comes and
// goes.
TEST(RobotDynamics, FreeMotionKeepsItsEnergy) {
  RobotModel robot = robot_test::paper_robot();
  for (ArmSpring& spring : robot.springs) spring.damping = 0.0;
  RobotDynamics dynamics(robot);
  VectorXd state = moving_state(robot, robot_test::some_positions()[3], 17);
  const VectorXd torque = VectorXd::Zero(6), none = VectorXd::Zero(18);
  const double start = dynamics.energy(state), step = 2e-5;
  const auto kinetic = [&] {
    VectorXd still = state;
    still.tail(18).setZero();
    return dynamics.energy(state) - dynamics.energy(still);
  };
  double least = kinetic(), most = least;
  VectorXd k1(36), k2(36), k3(36), k4(36);
  for (int t = 0; t < 2000; ++t) {  // Runge and Kutta's classical step
    dynamics.rate(state, torque, none, k1);
    dynamics.rate(state + 0.5 * step * k1, torque, none, k2);
    dynamics.rate(state + 0.5 * step * k2, torque, none, k3);
    dynamics.rate(state + step * k3, torque, none, k4);
    state += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    least = std::min(least, kinetic());
    most = std::max(most, kinetic());
  }
  EXPECT_GT(most - least, 10.0);
  EXPECT_NEAR(dynamics.energy(state), start, 1e-6 * (most - least));
}

// While the bearings of joint 1 are straight its axis is the vertical, about which gravity has no
// moment: the arm's angular momentum about it changes by the first gearbox's torque alone.
TEST(RobotDynamics, AngularMomentumAboutTheVerticalChangesByTheFirstGearboxAlone) {
  const RobotModel robot = robot_test::paper_robot();
  RobotDynamics dynamics(robot);
  VectorXd state = moving_state(robot, robot_test::some_positions()[4], 9);
  state.head(2).setZero();
  state.segment(18, 2).setZero();
  const Eigen::Index joint_1 = 2;
  RigidChainEvaluator evaluator(robot.chain);
  const auto momentum = [&](const VectorXd& at) {
    const VectorXd rotations = at.head(12), velocities = at.segment(18, 12);
    return evaluator.mass_matrix(rotations).row(joint_1).dot(velocities);
  };
  // The bearings' accelerations are held at zero by the constraint force that a rigid bearing has.
  VectorXd rate(36), force = VectorXd::Zero(18);
  dynamics.rate(state, VectorXd::Zero(6), force, rate);
  MatrixXd response(2, 2);
  for (Eigen::Index k = 0; k < 2; ++k) {
    VectorXd pushed(36);
    dynamics.rate(state, VectorXd::Zero(6), VectorXd::Unit(18, k), pushed);
    response.col(k) = (pushed - rate).segment(18, 2);
  }
  force.head(2) = -response.inverse() * rate.segment(18, 2);
  dynamics.rate(state, VectorXd::Zero(6), force, rate);
  ASSERT_LT(rate.segment(18, 2).norm(), 1e-9 * rate.norm());
  const double step = 1e-6;
  const double change =
      (momentum(state + step * rate) - momentum(state - step * rate)) / (2.0 * step);
  const ArmSpring& gearbox = robot.springs[static_cast<std::size_t>(joint_1)];
  const double torque = -gearbox.stiffness * (state(joint_1) - state(12)) -
                        gearbox.damping * (state(18 + joint_1) - state(18 + 12));
  EXPECT_NEAR(change, torque, 1e-6 * std::abs(torque));
}

}  // namespace
}  // namespace graybox
