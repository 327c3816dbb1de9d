#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"
#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::Isometry3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kDegree = std::numbers::pi / 180.0;

// A planar arm of two links, the first of length 0.7, swinging in the vertical plane.
const std::string kArm = R"(format: graybox-rigid-robot/1
gravity: [0, -9.81, 0]
denavit_hartenberg: modified
joints:
  - {name: shoulder, a: 0, alpha: 0, d: 0, gear_ratio: 50, rotor_inertia: unknown}
  - {name: elbow, a: 0.7, alpha: 0, d: 0, gear_ratio: -30, rotor_inertia: 2e-4}
)";

const std::string kFriction = R"(elements:
  - {name: friction_1, location: {kind: element, joint: shoulder, axis: arm}, law: viscous,
     parameters: {damping: {value: 0, unit: N m s/rad}}}
  - {name: dry_2, location: {kind: element, joint: elbow, axis: motor}, law: coulomb,
     parameters: {level: {value: 0, unit: N m}, transition_velocity: {value: 0.05, unit: rad/s}}}
)";

struct Row {
  double a, alpha, d, theta;
};

std::vector<Row> random_rows(Random& random, int count) {
  std::vector<Row> rows;
  for (int k = 0; k < count; ++k) {
    rows.push_back(
        {random.normal(), random.uniform(-180, 180), random.normal(), random.uniform(-180, 180)});
  }
  return rows;
}

VectorXd random_vector(Random& random, Index size) {
  return VectorXd::NullaryExpr(size, [&] { return random.normal(); });
}

std::string body_text(Random& random) {
  const Eigen::Matrix3d root = Eigen::Matrix3d::NullaryExpr([&] { return random.normal(); });
  const Eigen::Matrix3d i = root * root.transpose();
  return fmt::format(
      "{{mass: {:.17g}, centre_of_mass: [{:.17g}, {:.17g}, {:.17g}], inertia: {{xx: {:.17g}, yy: "
      "{:.17g}, zz: {:.17g}, xy: {:.17g}, xz: {:.17g}, yz: {:.17g}}}}}",
      random.uniform(1, 3), random.normal(), random.normal(), random.normal(), i(0, 0), i(1, 1),
      i(2, 2), i(0, 1), i(0, 2), i(1, 2));
}

// Smooth motion of n joints, its derivatives by formula.
Motion multisine_motion(Index joints, Index samples, double duration) {
  Motion motion;
  motion.time = VectorXd::LinSpaced(samples, 0.0, duration);
  motion.position = motion.velocity = motion.acceleration = MatrixXd::Zero(samples, joints);
  motion.torque = MatrixXd::Zero(samples, joints);
  for (Index j = 0; j < joints; ++j) {
    for (int k = 1; k <= 4; ++k) {
      const double w =
          2.0 * std::numbers::pi * k * (1.0 + 0.17 * static_cast<double>(j)) / duration;
      const double phase = 1.3 * k + 2.1 * static_cast<double>(j), a = 0.8 / k;
      const Eigen::ArrayXd angle = w * motion.time.array() + phase;
      motion.position.col(j).array() += a * angle.sin();
      motion.velocity.col(j).array() += a * w * angle.cos();
      motion.acceleration.col(j).array() -= a * w * w * angle.sin();
    }
  }
  return motion;
}

class RigidRobot : public ::testing::Test {
 protected:
  RigidRobotModel model(const std::string& text) {
    testing::write_text(folder_.file("robot.yaml"), text);
    return load_rigid_robot(folder_.file("robot.yaml"));
  }
  // A robot of these rows; `bodies`: known ones, else unknown.
  RigidRobotModel robot_of(const std::string& convention, const std::vector<Row>& rows,
                           Random* bodies) {
    std::string text = "format: graybox-rigid-robot/1\ngravity: [1.3, -2.1, -9.0]\n";
    text += "denavit_hartenberg: " + convention + "\njoints:\n";
    for (std::size_t k = 0; k < rows.size(); ++k) {
      text += fmt::format(
          "  - {{name: j{}, a: {:.17g}, alpha: {:.17g}, d: {:.17g}, theta: {:.17g}, gear_ratio: 1, "
          "rotor_inertia: 0{}}}\n",
          k, rows[k].a, rows[k].alpha, rows[k].d, rows[k].theta,
          bodies != nullptr ? ", body: " + body_text(*bodies) : std::string());
    }
    return model(text);
  }

  testing::TemporaryFolder folder_;
};

RigidChain chain_of(const RigidRobotModel& robot) {
  std::vector<ChainRotation> rotations;
  for (const RobotJoint& joint : robot.joints) {
    rotations.push_back({joint.name, joint.origin, joint.axis, joint.body.value()});
  }
  return {rotations, robot.gravity};
}

// KDL's inverse dynamics of the same bodies; and KDL's is linear in them, too: with one body alone
// it gives that body's block of columns.
TEST_F(RigidRobot, RegressorGivesTheTorquesOfKdl) {
  Random random(5);
  for (const char* convention : {"modified", "standard"}) {
    const RigidRobotModel robot = robot_of(convention, random_rows(random, 6), &random);
    RigidBodyRegressor regressor(robot);
    for (int repetition = 0; repetition < 5; ++repetition) {
      const VectorXd q = random_vector(random, 6), v = random_vector(random, 6),
                     a = random_vector(random, 6);
      const MatrixXd& y = regressor.evaluate(q, v, a);
      for (int alone = -1; alone < 6; ++alone) {
        RigidRobotModel part = robot;
        VectorXd p = VectorXd::Zero(60);
        for (int k = 0; k < 6; ++k) {
          RigidBody& body = *part.joints[static_cast<std::size_t>(k)].body;
          if (alone >= 0 && k != alone) body = RigidBody{};
          p.segment<10>(10 * k) = standard_parameters(body);
        }
        RigidChainEvaluator kdl(chain_of(part));
        const VectorXd expected =
            kdl.mass_matrix(q) * a + kdl.coriolis_torque(q, v) + kdl.gravity_torque(q);
        EXPECT_LT((y * p - expected).norm(), 1e-10 * (1.0 + expected.norm())) << convention;
      }
    }
  }
}

// Products of the textbook's matrices, in which the body is given in the frame of its row.
TEST_F(RigidRobot, BothConventionsPlaceBodiesAsTheirMatricesDo) {
  Random random(6);
  const std::vector<Row> rows = random_rows(random, 4);
  for (const bool is_modified : {true, false}) {
    Random bodies(7), same_bodies(7);
    const RigidRobotModel robot = robot_of(is_modified ? "modified" : "standard", rows, &bodies);
    // The same file with identity rows keeps the centres of mass as written.
    const RigidRobotModel plain =
        robot_of("modified", std::vector<Row>(rows.size(), Row{0, 0, 0, 0}), &same_bodies);
    const VectorXd q = random_vector(random, 4);
    RigidChainEvaluator evaluator(chain_of(robot));
    const BodyPlaces places = evaluator.body_places(q);
    Isometry3d frame = Isometry3d::Identity();
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Row& r = rows[k];
      const Isometry3d rot_x(Eigen::AngleAxisd(r.alpha * kDegree, Vector3d::UnitX()));
      const Isometry3d trans_x(Eigen::Translation3d(r.a, 0, 0));
      const Isometry3d rot_z(
          Eigen::AngleAxisd(r.theta * kDegree + q(static_cast<Index>(k)), Vector3d::UnitZ()));
      const Isometry3d trans_z(Eigen::Translation3d(0, 0, r.d));
      frame = is_modified ? frame * rot_x * trans_x * rot_z * trans_z
                          : frame * rot_z * trans_z * trans_x * rot_x;
      EXPECT_LT((frame * plain.joints[k].body->centre_of_mass - places.centres_of_mass[k]).norm(),
                1e-12);
    }
  }
}

// A carriage on a turning rail: centrifugal and Coriolis forces in closed form.
TEST_F(RigidRobot, PrismaticJointsFollowTheClosedForm) {
  const RigidRobotModel robot = model(R"(format: graybox-rigid-robot/1
gravity: [0, 0, 0]
denavit_hartenberg: modified
joints:
  - {name: turn, a: 0, alpha: 0, d: 0, gear_ratio: 1, rotor_inertia: 0}
  - {name: slide, type: prismatic, a: 0, alpha: 90, d: 0.2, gear_ratio: 1, rotor_inertia: 0}
)");
  RigidBodyRegressor regressor(robot);
  const double m = 3.0, x = 0.5, r = 0.2 + x, dr = -0.8, ddr = 1.1, w = 1.7, dw = -0.6;
  VectorXd p = VectorXd::Zero(20);
  p.tail<10>() = standard_parameters({m, Vector3d::Zero(), Eigen::Matrix3d::Zero()});
  const VectorXd torque = regressor.evaluate(Eigen::Vector2d(0.4, x), Eigen::Vector2d(w, dr),
                                             Eigen::Vector2d(dw, ddr)) *
                          p;
  EXPECT_NEAR(torque(0), m * r * r * dw + 2.0 * m * r * dr * w, 1e-12);
  EXPECT_NEAR(torque(1), m * ddr - m * r * w * w, 1e-12);
}

TEST_F(RigidRobot, PlanarArmHasTheKnownBaseParameters) {
  const RigidRobotModel robot = model(kArm);
  TorqueColumns columns(robot);
  const BaseParameters base = structural_base_parameters(columns, 2);
  const std::vector<std::string> names{"ZZ1R", "MX1R", "MY1", "ZZ2", "MX2", "MY2"};
  EXPECT_EQ(base.names, names);
  const std::vector<std::string> relations{"ZZ1R = ZZ1 + 0.49 M2 + 2500 rotor_inertia_1",
                                           "MX1R = MX1 + 0.7 M2"};
  EXPECT_EQ(base.relations, relations);
  // Lying down, gravity does not act on it.
  std::string flat = kArm;
  flat.replace(flat.find("[0, -9.81, 0]"), 13, "[0, 0, -9.81]");
  const RigidRobotModel lying = model(flat);
  TorqueColumns flat_columns(lying);
  const std::vector<std::string> fewer{"ZZ1R", "ZZ2", "MX2", "MY2"};
  EXPECT_EQ(structural_base_parameters(flat_columns, 2).names, fewer);
}

// 36 of the bodies for six revolute joints with a vertical first axis, next axes parallel or
// perpendicular (Mayeda, Yoshida and Osuka 1990), and four rotors that have no body's column.
TEST_F(RigidRobot, SixAxisArmHasThePublishedNumberOfBaseParameters) {
  const RigidRobotModel robot =
      load_rigid_robot(std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/rigid/tx40.yaml");
  TorqueColumns columns(robot);
  const BaseParameters base = structural_base_parameters(columns, 6);
  Index bodies = 0;
  for (const std::string& name : base.names) bodies += name.starts_with("rotor") ? 0 : 1;
  EXPECT_EQ(bodies, 36);
  EXPECT_EQ(base.size(), 40);
  // Whatever the parameters, the regrouped ones give the same torques; and none is superfluous.
  Random random(8);
  const VectorXd p = random_vector(random, columns.size());
  MatrixXd stacked(6 * 40, base.size());
  for (Index t = 0; t < 40; ++t) {
    columns.evaluate(random_vector(random, 6), random_vector(random, 6), random_vector(random, 6));
    const MatrixXd kept = columns.matrix()(Eigen::all, base.columns);
    const VectorXd torque = columns.matrix() * p;
    EXPECT_LT((kept * (base.regrouping * p) - torque).norm(), 1e-9 * torque.norm());
    stacked.middleRows(6 * t, 6) = kept;
  }
  EXPECT_EQ(Eigen::ColPivHouseholderQR<MatrixXd>(stacked).rank(), base.size());
}

// The torques of the base parameters `truth` of the robot on this motion.
VectorXd torques(const RigidRobotModel& robot, const Motion& motion, const VectorXd& truth) {
  TorqueColumns columns(robot);
  const BaseParameters base = structural_base_parameters(columns, robot.size());
  columns.carry(motion.load);
  VectorXd result(motion.samples() * robot.size());
  for (Index t = 0; t < motion.samples(); ++t) {
    columns.evaluate(motion.position.row(t).transpose(), motion.velocity.row(t).transpose(),
                     motion.acceleration.row(t).transpose());
    result.segment(t * robot.size(), robot.size()) =
        columns.known() + columns.matrix()(Eigen::all, base.columns) * truth;
  }
  return result;
}

void set_torque(Motion& motion, const VectorXd& torque) {
  const Index joints = motion.position.cols();
  motion.torque = Eigen::Map<const MatrixXd>(torque.data(), joints, motion.samples()).transpose();
}

const VectorXd kArmTruth = (VectorXd(8) << 2.1, 1.9, 0.1, 0.4, 0.8, -0.05, 3.0, -0.02).finished();

// Noise with correlation r from one sample to the next, of another size in each joint.
VectorXd correlated_noise(Random& random, Index samples, double r) {
  VectorXd noise(2 * samples);
  Eigen::Vector2d state = Eigen::Vector2d::Zero();
  const double fresh = std::sqrt(1.0 - r * r);
  for (Index t = 0; t < samples; ++t) {
    state = r * state + fresh * Eigen::Vector2d(random.normal(), random.normal());
    noise.segment<2>(2 * t) = Eigen::Vector2d(1.5, 0.2).cwiseProduct(state);
  }
  return noise;
}

// Monte Carlo: mean of ((estimate - truth) / standard error)^2 over runs and parameters, 1 if the
// covariance is right.
double mean_square_of_standardised_errors(const RigidRobotModel& robot, double correlation) {
  constexpr int kRuns = 80;
  Random random(11);
  Motion motion = multisine_motion(2, 600, 4.0);
  const VectorXd exact = torques(robot, motion, kArmTruth);
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    set_torque(motion, exact + correlated_noise(random, motion.samples(), correlation));
    const InverseDynamicsFit fit =
        fit_inverse_dynamics(robot, {{"run", ExperimentRole::kEstimation, {motion}}});
    for (std::size_t p = 0; p < fit.parameters.size(); ++p) {
      const TorqueParameter& each = fit.parameters[p];
      const double error = each.value - kArmTruth(static_cast<Index>(p));
      sum += error * error / (each.standard_error * each.standard_error);
    }
  }
  return sum / (kRuns * static_cast<double>(kArmTruth.size()));
}

// 640 squares, correlated among the parameters: +-25 % is far beyond their Monte-Carlo error.
// Kernel estimates of correlated noise are known to be low in short records: at 0.7, the white
// formula would give 4 to 6.
TEST_F(RigidRobot, StandardErrorsHoldForWhiteAndCorrelatedNoise) {
  const RigidRobotModel robot = model(kArm + kFriction);
  EXPECT_NEAR(mean_square_of_standardised_errors(robot, 0.0), 1.0, 0.25);
  const double correlated = mean_square_of_standardised_errors(robot, 0.7);
  EXPECT_GT(correlated, 0.75);
  EXPECT_LT(correlated, 1.5);
}

TEST_F(RigidRobot, WeightsAreTheNoiseOfEachJoint) {
  const RigidRobotModel robot = model(kArm + kFriction);
  Random random(3);
  Motion motion = multisine_motion(2, 2000, 10.0);
  set_torque(motion, torques(robot, motion, kArmTruth) + correlated_noise(random, 2000, 0.0));
  const std::vector<MotionRecord> records{{"run", ExperimentRole::kEstimation, {motion}}};
  const InverseDynamicsFit fit = fit_inverse_dynamics(robot, records);
  EXPECT_NEAR(fit.noise(0), 1.5, 0.1);
  EXPECT_NEAR(fit.noise(1), 0.2, 0.015);
  EXPECT_EQ(fit.status, InverseDynamicsStatus::kConverged);
  EXPECT_NEAR(fit.chi_square, static_cast<double>(fit.degrees_of_freedom), 1e-3 * fit.chi_square);
  // Ordinary least squares knows the quiet joint less well.
  const InverseDynamicsFit equal =
      fit_inverse_dynamics(robot, records, {.noise = JointNoise::kEqual});
  EXPECT_GT(equal.parameters.back().standard_error, 1.5 * fit.parameters.back().standard_error);
}

TEST_F(RigidRobot, RefinesParametersThatAreNotLinear) {
  const std::string stribeck = R"(elements:
  - {name: friction, location: {kind: element, joint: elbow, axis: arm}, law: stribeck,
     parameters: {level: {value: 0, unit: N m}, static_level: {value: 0, unit: N m},
                  stribeck_velocity: {value: V, unit: rad/s},
                  transition_velocity: {value: 0.01, unit: rad/s}}}
)";
  const auto arm = [&](const std::string& velocity) {
    std::string text = stribeck;
    text.replace(text.find("value: V"), 8, "value: " + velocity);
    return model(kArm + text + "refine: [friction.stribeck_velocity]\n");
  };
  Motion motion = multisine_motion(2, 1500, 8.0);
  const VectorXd truth = (VectorXd(8) << 2.1, 1.9, 0.1, 0.4, 0.8, -0.05, 3.0, 5.0).finished();
  Random random(4);
  set_torque(motion, torques(arm("0.6"), motion, truth) +
                         0.05 * correlated_noise(random, motion.samples(), 0.0));
  for (const char* start : {"0.2", "1.8"}) {  // three times off either way
    const InverseDynamicsFit fit =
        fit_inverse_dynamics(arm(start), {{"run", ExperimentRole::kEstimation, {motion}}});
    EXPECT_EQ(fit.status, InverseDynamicsStatus::kConverged);
    const TorqueParameter& velocity = fit.parameters.back();
    EXPECT_EQ(velocity.name, "friction.stribeck_velocity");
    EXPECT_EQ(velocity.start, std::stod(start));
    EXPECT_LT(std::abs(velocity.value - 0.6), 4.0 * velocity.standard_error);
    EXPECT_LT(velocity.standard_error, 0.02);
  }
}

// A wrist whose second motor turns with both joints, one gear reversed: motor signals give the
// parameters that arm signals give.
TEST_F(RigidRobot, MotorSignalsGoThroughACoupledTransmission) {
  std::string text = kArm + kFriction;
  for (const char* ratio : {"gear_ratio: 50, ", "gear_ratio: -30, "}) {
    text.erase(text.find(ratio), std::string(ratio).size());
  }
  text += R"(transmission: [[50, 0], [-30, -30]]
channels: {torque: [u_1, u_2], torque_of: motors, position: [a_1, a_2], position_of: motors,
           velocity: [v_1, v_2], acceleration: [w_1, w_2]}
)";
  const RigidRobotModel robot = model(text);
  const Motion motion = multisine_motion(2, 400, 4.0);
  const VectorXd exact = torques(robot, motion, kArmTruth);
  const Eigen::Matrix2d n = robot.transmission;
  std::string csv = "time,u_1,u_2,a_1,a_2,v_1,v_2,w_1,w_2\n";
  for (Index t = 0; t < motion.samples(); ++t) {
    const Eigen::Vector2d u = n.transpose().inverse() * exact.segment<2>(2 * t);
    const Eigen::Vector2d a = n * motion.position.row(t).transpose(),
                          v = n * motion.velocity.row(t).transpose(),
                          w = n * motion.acceleration.row(t).transpose();
    csv += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n",
                       motion.time(t), u(0), u(1), a(0), a(1), v(0), v(1), w(0), w(1));
  }
  testing::write_text(folder_.file("run.csv"), csv);
  const std::string campaign = R"(format: graybox-campaign/1
sample_time: 0.010025062656641603
channels:
  - {name: u_1, unit: N m, is: input}
  - {name: u_2, unit: N m, is: input}
  - {name: a_1, unit: rad, is: output}
  - {name: a_2, unit: rad, is: output}
  - {name: v_1, unit: rad/s, is: output}
  - {name: v_2, unit: UNIT, is: output}
  - {name: w_1, unit: rad/s^2, is: output}
  - {name: w_2, unit: rad/s^2, is: output}
hold: zero
experiments:
  - {file: run.csv}
)";
  const auto read = [&](const std::string& unit, const std::string& role) {
    std::string changed = campaign;
    changed.replace(changed.find("UNIT"), 4, unit);
    changed.replace(changed.find("{file: run.csv}"), 15, "{file: run.csv, role: " + role + "}");
    testing::write_text(folder_.file("campaign.yaml"), changed);
    return read_motion_records(robot, read_campaign(folder_.file("campaign.yaml")));
  };
  const InverseDynamicsFit fit = fit_inverse_dynamics(robot, read("rad/s", "estimation"));
  ASSERT_EQ(fit.parameters.size(), 8U);
  for (std::size_t p = 0; p < 8; ++p) {
    EXPECT_NEAR(fit.parameters[p].value, kArmTruth(static_cast<Index>(p)), 1e-8);
  }
  EXPECT_LT(fit.records[0].total.relative, 1e-6);
  testing::expect_refused([&] { (void)read("rad", "estimation"); },
                          "channel v_2 is in rad; joint elbow");
  testing::expect_refused([&] { (void)read("rad/s", "validation"); },
                          "none has the role estimation");
  RigidRobotModel other = robot;
  other.channels.torque[1] = "u_3";
  testing::expect_refused(
      [&] { (void)read_motion_records(other, read_campaign(folder_.file("campaign.yaml"))); },
      "no channel 'u_3'");
  other.channels = {};
  testing::expect_refused(
      [&] { (void)read_motion_records(other, read_campaign(folder_.file("campaign.yaml"))); },
      "has no 'channels'");
}

TEST_F(RigidRobot, SaysWhatTheRecordingsDoNotShow) {
  const RigidRobotModel robot = model(kArm + kFriction);
  Motion motion = multisine_motion(2, 400, 4.0);
  motion.position.col(0).setConstant(0.3);
  motion.velocity.col(0).setZero();
  motion.acceleration.col(0).setZero();
  set_torque(motion, torques(robot, motion, kArmTruth));
  const InverseDynamicsFit fit =
      fit_inverse_dynamics(robot, {{"run", ExperimentRole::kEstimation, {motion}}});
  std::string words;
  for (const std::string& line : fit.unseen) words += line + "\n";
  EXPECT_NE(words.find("joint shoulder does not move"), std::string::npos) << words;
  EXPECT_NE(words.find("no effect in these recordings: ZZ1R, friction_1.damping"),
            std::string::npos)
      << words;
  EXPECT_NE(words.find("not told apart in these recordings"), std::string::npos) << words;
  EXPECT_EQ(fit.structural_parameters, 8);
  EXPECT_LT(fit.parameters.size(), 8U);
  EXPECT_LT(fit.records[0].total.relative, 1e-6);  // what is regrouped explains them all the same
  motion.torque.setZero();
  testing::expect_refused(
      [&] {
        (void)fit_inverse_dynamics(robot, {{"run", ExperimentRole::kEstimation, {motion}}});
      },
      "torques are all zero");
}

TEST_F(RigidRobot, KnownPartsAreTakenAway) {
  Random random(21);
  const std::string arm = kArm;
  std::string known = arm;
  const std::string body = body_text(random);
  known.replace(known.find("rotor_inertia: unknown"), 22, "rotor_inertia: 3e-4, body: " + body);
  known.replace(known.find("rotor_inertia: 2e-4"), 19, "rotor_inertia: 2e-4, body: " + body);
  const std::string payload = R"(elements:
  - {name: load, location: {kind: element, axis: flange}, law: payload,
     parameters: {mass: {value: 4, unit: kg}, x: {value: 0.3, unit: m}, y: {value: 0, unit: m},
                  z: {value: 0, unit: m}}}
)";
  const RigidRobotModel all_known = model(known + payload + "known: [load.mass]\n");
  Motion motion = multisine_motion(2, 200, 4.0);
  set_torque(motion, torques(all_known, motion, VectorXd(0)));
  const std::vector<MotionRecord> records{{"run", ExperimentRole::kEstimation, {motion}}};
  const InverseDynamicsFit nothing = fit_inverse_dynamics(all_known, records);
  EXPECT_TRUE(nothing.parameters.empty());
  EXPECT_LT(nothing.records[0].total.relative, 1e-10);
  const InverseDynamicsFit mass = fit_inverse_dynamics(model(known + payload), records);
  ASSERT_EQ(mass.parameters.size(), 1U);
  EXPECT_EQ(mass.parameters[0].name, "load.mass");
  EXPECT_NEAR(mass.parameters[0].value, 4.0, 1e-9);
}

// Recorded torques in units of the drives' own: what is recorded is the torque over the gain.
const std::string kUnknownGains =
    "channels: {torque: [u_1, u_2], torque_of: arm, drive_gains: unknown, position: [q_1, q_2], "
    "position_of: arm}\n";

void over_gains(Motion& motion, double first, double second) {
  motion.torque.col(0) /= first;
  motion.torque.col(1) /= second;
}

std::string arm_of_known_bodies(Random& random) {
  std::string known = kArm;
  known.replace(known.find("rotor_inertia: unknown"), 22,
                "rotor_inertia: 3e-4, body: " + body_text(random));
  known.replace(known.find("rotor_inertia: 2e-4"), 19,
                "rotor_inertia: 2e-4, body: " + body_text(random));
  return known;
}

TEST_F(RigidRobot, GainsOfDrivesFollowFromKnownBodies) {
  Random random(22);
  const std::string known = arm_of_known_bodies(random);
  Motion motion = multisine_motion(2, 200, 4.0);
  set_torque(motion, torques(model(known), motion, VectorXd(0)));
  over_gains(motion, 8.0, 0.25);
  motion.torque.col(0) += 0.3 * motion.velocity.col(0);  // friction in the unit of its drive
  const std::string friction = kFriction.substr(0, kFriction.find("  - {name: dry_2"));
  const InverseDynamicsFit fit = fit_inverse_dynamics(
      model(known + friction + kUnknownGains), {{"run", ExperimentRole::kEstimation, {motion}}});
  ASSERT_EQ(fit.parameters.size(), 3U);
  EXPECT_EQ(fit.parameters[0].name, "1/gain_1");
  EXPECT_NEAR(fit.parameters[0].value, 0.125, 1e-9);
  EXPECT_NEAR(fit.parameters[1].value, 4.0, 1e-8);
  EXPECT_EQ(fit.parameters[2].name, "friction_1.damping");
  EXPECT_NEAR(fit.parameters[2].value, 0.3, 1e-9);
}

TEST_F(RigidRobot, GainsOfDrivesDoNotTieUnknownBodies) {
  Motion motion = multisine_motion(2, 400, 4.0);
  const RigidRobotModel one_unit = model(kArm);
  set_torque(motion, torques(one_unit, motion, kArmTruth.head(6)));
  over_gains(motion, 8.0, 0.25);
  const std::vector<MotionRecord> records{{"run", ExperimentRole::kEstimation, {motion}}};
  EXPECT_GT(fit_inverse_dynamics(one_unit, records).records[0].total.relative, 5.0);
  const InverseDynamicsFit fit = fit_inverse_dynamics(model(kArm + kUnknownGains), records);
  EXPECT_LT(fit.records[0].total.relative, 1e-8);
}

const std::string kToolLoad = R"(elements:
  - {name: load, location: {kind: element, axis: flange, load: tool}, law: payload,
     parameters: {mass: {value: 4, unit: kg}, x: {value: 0.3, unit: m}, y: {value: 0, unit: m},
                  z: {value: 0, unit: m}}}
)";

// Recorded without and with a load; nothing of the arm is known.
std::vector<MotionRecord> with_and_without_load(const RigidRobotModel& robot,
                                                const VectorXd& parameters) {
  std::vector<MotionRecord> records;
  for (const char* load : {"", "tool"}) {
    Motion motion = multisine_motion(2, 400, 4.0 + 0.3 * static_cast<double>(records.size()));
    motion.load = load;
    set_torque(motion, torques(robot, motion, parameters));
    records.push_back({load, ExperimentRole::kEstimation, {motion}});
  }
  return records;
}

VectorXd some_base_parameters(const RigidRobotModel& robot) {
  TorqueColumns columns(robot);
  const Index count = structural_base_parameters(columns, robot.size()).size();
  return VectorXd::NullaryExpr(count, [](Index k) { return 0.1 * static_cast<double>(k % 7 + 1); });
}

TEST_F(RigidRobot, LoadsAreInTheRecordingsThatCarryThem) {
  const RigidRobotModel robot = model(kArm + kToolLoad);
  VectorXd truth = some_base_parameters(robot);
  truth(truth.size() - 1) = 4.0;
  const InverseDynamicsFit fit = fit_inverse_dynamics(robot, with_and_without_load(robot, truth));
  EXPECT_EQ(fit.parameters.back().name, "load.mass");
  EXPECT_NEAR(fit.parameters.back().value, 4.0, 1e-7);
  EXPECT_LT(fit.records[1].total.relative, 1e-8);
}

// Torques in units of the drives' own follow from a load that is known; of one that is not, and a
// robot of which nothing is known, they leave everything open.
TEST_F(RigidRobot, GainsOfDrivesFollowFromAKnownLoad) {
  const RigidRobotModel newtons = model(kArm + kToolLoad + "known: [load.mass]\n");
  std::vector<MotionRecord> records = with_and_without_load(newtons, some_base_parameters(newtons));
  for (MotionRecord& record : records) over_gains(record.pieces[0], 8.0, 0.25);
  const InverseDynamicsFit fit = fit_inverse_dynamics(
      model(kArm + kToolLoad + kUnknownGains + "known: [load.mass]\n"), records);
  EXPECT_LT(fit.records[1].total.relative, 1e-7);
  for (const auto& [name, value] : {std::pair{"1/gain_1", 0.125}, {"1/gain_2", 4.0}}) {
    const auto gain = std::ranges::find(fit.parameters, name, &TorqueParameter::name);
    ASSERT_NE(gain, fit.parameters.end()) << name;
    EXPECT_NEAR(gain->value, value, 1e-6 * value) << name;
  }
}

// With known bodies the mass of a load is refined beside the gains.
TEST_F(RigidRobot, LoadsAreEstimatedBesideTheGainsOfDrives) {
  Random random(23);
  const std::string known = arm_of_known_bodies(random);
  std::vector<MotionRecord> records =
      with_and_without_load(model(known + kToolLoad + "known: [load.mass]\n"), VectorXd(0));
  for (MotionRecord& record : records) over_gains(record.pieces[0], 8.0, 0.25);
  std::string guess = kToolLoad;
  guess.replace(guess.find("value: 4"), 8, "value: 1");
  const InverseDynamicsFit fit =
      fit_inverse_dynamics(model(known + guess + kUnknownGains), records);
  EXPECT_EQ(fit.parameters.back().name, "load.mass");
  EXPECT_NEAR(fit.parameters.back().value, 4.0, 1e-5);
  EXPECT_NEAR(fit.parameters[0].value, 0.125, 1e-6);
}

TEST_F(RigidRobot, RefusesWrongModelFiles) {
  const auto changed = [](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  const struct {
    std::string from, to, message;
  } cases[] = {
      {"gear_ratio: 50", "gear_ratio: 0", "gear_ratio: must not be zero"},
      {"a: 0.7, ", "", "joints[1]: field 'a' is missing"},
      {"a: 0.7", "a: long", "must be a number"},
      {"a: 0.7", "b: 0.7", "b"},
      {"rotor_inertia: unknown", "rotor_inertia: -1", "rotor_inertia"},
      {"name: elbow", "name: shoulder", "name of two joints"},
      {"modified", "usual", "denavit_hartenberg"},
      {"denavit_hartenberg: modified\n", "", "needs either urdf"},
      {"gravity: [0, -9.81, 0]", "gravity: [0, -9.81]", "gravity"},
      {"law: viscous", "law: sticky", "no law 'sticky'"},
      {"joint: elbow", "joint: wrist", "no joint 'wrist'; there are shoulder, elbow"},
      {"unit: N m s/rad", "unit: N m", "must be 'N m s/rad'"},
      {"axis: motor", "axis: gearbox", "axis"},
      {"kind: element, joint: elbow", "kind: sensor, joint: elbow", "has no laws of signals"},
      {"rotor_inertia: 2e-4",
       "rotor_inertia: 2e-4, body: {mass: 1, centre_of_mass: [0, 0, 0], "
       "inertia: {xx: 1, yy: 1, zz: 1, xy: 2, xz: 0, yz: 0}}",
       "negative principal moment"},
  };
  for (const auto& each : cases) {
    testing::expect_refused([&] { (void)model(changed(kArm + kFriction, each.from, each.to)); },
                            each.message);
  }
  const std::string good = kArm + kFriction;
  for (const auto& [lines, message] : std::initializer_list<std::pair<std::string, std::string>>{
           {"refine: [dry_2.level]", "enters the force linearly"},
           {"refine: [dry_3.level]", "names no element"},
           {"refine: [dry_2.speed]", "names no parameter of the law coulomb"},
           {"known: [dry_2]", "must be written as element.parameter"},
           {"transmission: [[50, 0], [0, 30]]", "replaces the gear ratios"},
           {"channels: {torque: [u], torque_of: arm, position: [q], position_of: arm}",
            "must name 2 channels"},
           {"transmission: [[50, 0], [0, 30]]\n" + kUnknownGains, "replaces the gear ratios"}}) {
    testing::expect_refused([&] { (void)model(good + lines + "\n"); }, message);
  }
  const std::string mode = R"(elements:
  - {name: tool, location: {kind: element, joint: elbow, axis: arm}, law: mode,
     parameters: {inertia: {value: 1, unit: kg m^2}, frequency: {value: 9, unit: Hz},
                  damping_ratio: {value: 0.1, unit: "1"}}}
)";
  testing::expect_refused([&] { (void)model(kArm + mode); }, "a motion of its own");
  const std::string coupling = R"(elements:
  - {name: tie, location: {kind: element, deflection: {shoulder: 1, elbow: 1}}, law: viscous,
     parameters: {damping: {value: 0, unit: N m s/rad}}}
)";
  testing::expect_refused([&] { (void)model(kArm + coupling + kUnknownGains); },
                          "'tie' acts on more than one joint");
}

// The same robot from a URDF, its bodies known or, for one link, not.
TEST_F(RigidRobot, ReadsBodiesFromAUrdf) {
  testing::write_text(folder_.file("arm.urdf"), R"(<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.3 0 0"/><mass value="4"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.2 0.1 0"/><mass value="2"/>
    <inertia ixx="0.05" iyy="0.06" izz="0.07" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.7 0 0"/><axis xyz="0 0 1"/></joint>
</robot>
)");
  const std::string text = R"(format: graybox-rigid-robot/1
urdf: arm.urdf
base: base
tip: lower
gravity: [0, -9.81, 0]
joints:
  - {name: shoulder, gear_ratio: 1, rotor_inertia: 0}
  - {name: elbow, gear_ratio: 1, rotor_inertia: 0, body: unknown}
)";
  const RigidRobotModel robot = model(text);
  EXPECT_EQ(robot.joints[0].body->mass, 4.0);
  EXPECT_FALSE(robot.joints[1].body.has_value());
  // The unknown link's own parameters: it acts on the shoulder, too, so its mass counts.
  TorqueColumns columns(robot);
  const std::vector<std::string> names{"ZZ2", "MX2", "MY2", "M2"};
  EXPECT_EQ(structural_base_parameters(columns, 2).names, names);
  std::string swapped = text;
  swapped.replace(swapped.find("name: shoulder"), 14, "name: elbow");
  testing::expect_refused([&] { (void)model(swapped); },
                          "the joint at this place in arm.urdf is 'shoulder'");
}

// A lift that carries one link: its force is (m1 + m2) (q'' + g), and the arm's weight acts with
// its lever; the head beside them is locked and carried, too.
TEST_F(RigidRobot, ReadsPrismaticJointsFromAUrdfAndLocksThoseBesideTheChain) {
  testing::write_text(folder_.file("lift.urdf"), R"(<robot name="lift">
  <link name="base"/>
  <link name="column"><inertial><mass value="4"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="head"><inertial><mass value="1"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="column"/>
    <axis xyz="0 0 2"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="nod" type="continuous"><parent link="column"/><child link="head"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="shoulder" type="continuous"><parent link="column"/><child link="arm"/>
    <axis xyz="0 -1 0"/></joint>
</robot>
)");
  const RigidRobotModel robot = model(R"(format: graybox-rigid-robot/1
urdf: lift.urdf
base: base
tip: arm
gravity: [0, 0, -9.81]
joints:
  - {name: lift, gear_ratio: 1, rotor_inertia: 0}
  - {name: shoulder, gear_ratio: 1, rotor_inertia: 0}
)");
  ASSERT_TRUE(robot.joints[0].is_prismatic);
  ASSERT_FALSE(robot.joints[1].is_prismatic);
  EXPECT_EQ(robot.joints[0].body->mass, 5.0);
  RigidBodyRegressor regressor(robot);
  Eigen::VectorXd parameters(2 * kStandardParameters);
  parameters << standard_parameters(*robot.joints[0].body),
      standard_parameters(*robot.joints[1].body);
  const Eigen::VectorXd forces =
      regressor.evaluate(Eigen::Vector2d(0.4, 0.0), Eigen::Vector2d::Zero(),
                         Eigen::Vector2d(3.0, 0.0)) *
      parameters;
  EXPECT_NEAR(forces(0), 7.0 * (3.0 + 9.81), 1e-9);
  EXPECT_NEAR(forces(1), 2.0 * 0.5 * (3.0 + 9.81), 1e-9);
}

// A joint locked at an angle gives the same robot as a fixed joint that stands there, in the chain
// and beside it; a finger that mimics the locked one stands accordingly.
TEST_F(RigidRobot, LocksJointsWhereTheyStand) {
  const auto urdf = [](const char* elbow, const char* finger) {
    return fmt::format(R"(<robot name="arm">
  <link name="base"/><link name="upper"/>
  <link name="lower"><inertial><origin xyz="0.2 0.1 0"/><mass value="2"/>
    <inertia ixx="0.05" iyy="0.06" izz="0.07" ixy="0.01" ixz="0" iyz="0"/></inertial></link>
  <link name="finger"><inertial><origin xyz="0 0.3 0.1"/><mass value="1"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0.005" iyz="0"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0.1 0 0.2"/><mass value="3"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="elbow" {}<parent link="upper"/><child link="lower"/></joint>
  <joint name="grip" {}<parent link="lower"/><child link="finger"/></joint>
  <joint name="wrist" type="continuous"><parent link="lower"/><child link="hand"/>
    <origin xyz="0.5 0 0"/><axis xyz="1 0 0"/></joint>
</robot>
)",
                       elbow, finger);
  };
  testing::write_text(folder_.file("moving.urdf"),
                      urdf(R"(type="revolute"><origin xyz="0.7 0 0"/><axis xyz="0 2 0"/>
           <limit lower="-1" upper="1" effort="1" velocity="1"/>)",
                           R"(type="prismatic"><mimic joint="elbow" multiplier="0.5" offset="0.02"/>
           <origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>
           <limit lower="-1" upper="1" effort="1" velocity="1"/>)"));
  testing::write_text(folder_.file("fixed.urdf"),
                      urdf(R"(type="fixed"><origin xyz="0.7 0 0" rpy="0 0.4 0"/>)",
                           R"(type="fixed"><origin xyz="0.1 0 0.22"/>)"));
  const auto text = [](const char* file, const char* locked) {
    return fmt::format(
        "format: graybox-rigid-robot/1\nurdf: {}\nbase: base\ntip: hand\n{}gravity: [0, -9.81, "
        "0]\njoints:\n  - {{name: shoulder, gear_ratio: 1, rotor_inertia: 0}}\n"
        "  - {{name: wrist, gear_ratio: 1, rotor_inertia: 0}}\n",
        file, locked);
  };
  const RigidRobotModel fixed = model(text("fixed.urdf", ""));
  const RigidRobotModel locked = model(text("moving.urdf", "locked: {elbow: 0.4}\n"));
  ASSERT_EQ(locked.size(), 2);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_TRUE(locked.joints[j].origin.isApprox(fixed.joints[j].origin, 1e-12));
    EXPECT_TRUE(standard_parameters(*locked.joints[j].body)
                    .isApprox(standard_parameters(*fixed.joints[j].body), 1e-12));
  }
  const auto refused = [&](const char* lock, const char* why) {
    testing::expect_refused([&] { (void)model(text("moving.urdf", lock)); }, why);
  };
  refused("locked: {knee: 0.4}\n", "no joint 'knee' (locked)");
  refused("locked: {elbow: 40}\n", "'elbow' is locked at 40, beyond its limits of -1 to 1 rad");
  refused("locked: {grip: 0.1}\n", "'grip' (locked) does not move by itself");
  testing::expect_refused([&] { (void)model(kArm + std::string("locked: {elbow: 0.1}\n")); },
                          "is for joints of a URDF");
}

// ---- real recordings ----------------------------------------------------------------------------

class RealRobots : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
      GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
    }
  }
  // Of one machine with these physics files; its recordings are read once.
  InverseDynamicsFit fit(const std::string& model, const std::vector<std::string>& physics) {
    const std::string root = GRAYBOX_SOURCE_DIR;
    std::vector<std::filesystem::path> files;
    for (const std::string& name : physics) files.push_back(root + "/docs/examples/rigid/" + name);
    const RigidRobotModel robot =
        load_rigid_robot(root + "/docs/examples/rigid/" + model + ".yaml", files);
    if (records_.empty()) {
      records_ = read_motion_records(
          robot, read_campaign(root + "/diagnosis/campaigns/" + model + ".yaml"));
    }
    return fit_inverse_dynamics(robot, records_);
  }
  static double validation_error(const InverseDynamicsFit& fit) {
    return fit.records.back().total.relative;
  }

 private:
  std::vector<MotionRecord> records_;
};

// Every physical term that the robot has lowers the error on data the fit did not see.
TEST_F(RealRobots, Tx40IsExplainedByFrictionAndItsCoupledWrist) {
  const double rigid = validation_error(fit("tx40", {}));
  const double viscous = validation_error(fit("tx40", {"viscous.yaml"}));
  const InverseDynamicsFit coupled =
      fit("tx40", {"viscous.yaml", "coulomb.yaml", "offset.yaml", "tx40_coupling.yaml"});
  EXPECT_GT(rigid, 70.0);
  EXPECT_LT(viscous, 0.35 * rigid);
  EXPECT_LT(validation_error(coupled), 0.4 * viscous);
  EXPECT_LT(validation_error(coupled), 8.8);
}

// Janot, Gautier and Brunot publish 95.1089 kg, 203.5034 N s/m, 20.3935 N and -3.1648 N.
TEST_F(RealRobots, EmpsHasItsPublishedParameters) {
  const InverseDynamicsFit emps =
      fit("emps", {"emps_viscous.yaml", "emps_coulomb.yaml", "emps_offset.yaml"});
  const double published[] = {95.1089, 203.5034, 20.3935, -3.1648};
  ASSERT_EQ(emps.parameters.size(), 4U);
  for (std::size_t p = 0; p < 4; ++p) {
    const TorqueParameter& each = emps.parameters[p];
    EXPECT_NEAR(each.value, published[p], 0.01 * std::abs(published[p])) << each.name;
    EXPECT_NEAR(each.value, published[p], 3.0 * each.standard_error) << each.name;
  }
  EXPECT_LT(validation_error(emps), 0.1 * validation_error(fit("emps", {})));
}

// The payload that axes 3 and 5 carry, on a trajectory the fit did not see.
TEST_F(RealRobots, Kr300CarriesAPayload) {
  const InverseDynamicsFit empty = fit("kr300", {"viscous.yaml", "coulomb.yaml"});
  const InverseDynamicsFit loaded = fit("kr300", {"viscous.yaml", "coulomb.yaml", "payload.yaml"});
  for (const std::size_t axis : {2U, 4U}) {
    EXPECT_LT(loaded.records[1].joints[axis].nrmse, 0.4 * empty.records[1].joints[axis].nrmse);
  }
  EXPECT_GT(loaded.parameters.back().value, 50.0);
}

// By hand, with the cylinder and equal weights: 28, 33 and 52 %.
TEST_F(RealRobots, Kr300sCounterbalanceCarriesItsArm) {
  const std::vector<std::string> without{"viscous.yaml", "coulomb.yaml", "payload.yaml"};
  std::vector<std::string> with = without;
  with.emplace_back("kr300_balancer.yaml");
  const InverseDynamicsFit bare = fit("kr300", without), balanced = fit("kr300", with);
  for (const std::size_t record : {0U, 1U, 2U}) {
    EXPECT_LT(balanced.records[record].joints[1].nrmse, 57.0) << record;
    EXPECT_LT(balanced.records[record].joints[1].nrmse, 0.7 * bare.records[record].joints[1].nrmse);
  }
}

}  // namespace
}  // namespace graybox
