#include "problems/robot_information/robot_information.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// (5) with the full Kronecker form of (12), from derivatives dG/dtheta_p at each frequency.
template <class Derivatives>
MatrixXd kronecker_information(const RobotModel& robot, const LocalModel& model,
                               const Derivatives& derivatives_at) {
  const Eigen::Index m = robot.motor_count();
  const auto d = static_cast<Eigen::Index>(robot.parameters.size());
  MatrixXd information = MatrixXd::Zero(d, d);
  for (const double w : robot.frequencies) {
    const std::vector<MatrixXcd> derivatives = derivatives_at(w);
    MatrixXcd psi(d, m * m);
    for (Eigen::Index p = 0; p < d; ++p) {
      psi.row(p) = derivatives[static_cast<std::size_t>(p)].reshaped().transpose();
    }
    const MatrixXcd lambda = response_covariance(
        frequency_response(model, w, robot.sample_time),
        controller_response(robot.controller, w, robot.sample_time),
        velocity_noise_psd(robot, w) * MatrixXcd::Identity(m, m), robot.reference_psd);
    information += 2.0 * (psi.conjugate() * lambda.partialPivLu().solve(psi.transpose())).real();
  }
  return information;
}

MatrixXd kronecker_information(const RobotModel& robot, const VectorXd& position) {
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(position);
  return kronecker_information(robot, model, [&](double w) {
    return frequency_response_derivatives(model, w, robot.sample_time);
  });
}

// Largest difference of an entry, relative to the geometric mean of its two diagonal entries.
double scaled_difference(const MatrixXd& a, const MatrixXd& b) {
  const VectorXd scale = b.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

RobotModel robot_with_coupled_wrist() {
  RobotModel robot = robot_test::paper_robot();
  robot.transmission(4, 3) = -12.0;
  robot.transmission(5, 3) = 7.0;
  robot.transmission(5, 4) = -25.0;
  robot.motor_friction << 0.01, 0.02, 0.03, 0.004, 0.005, 0.006;
  return robot;
}

TEST(RobotInformation, EqualsTheFullKroneckerForm) {
  const RobotModel robot = robot_test::paper_robot();
  for (const VectorXd& position : robot_test::some_positions()) {
    const MatrixXd expected = kronecker_information(robot, position);
    EXPECT_LT(scaled_difference(robot_information_matrix(robot, position), expected), 1e-10);
  }
}

TEST(RobotInformation, EqualsTheKroneckerFormForOtherRobots) {
  RobotModel negative = robot_test::paper_robot();
  negative.transmission(2, 2) *= -1.0;
  RobotModel without_damping = robot_test::paper_robot();
  for (ArmSpring& spring : without_damping.springs) spring.damping = 0.0;
  RobotModel few = robot_test::paper_robot();
  few.parameters = {4, 2, 9};
  few.frequencies.resize(3);
  const VectorXd position = robot_test::some_positions()[4];
  for (const RobotModel& robot : {robot_with_coupled_wrist(), negative, without_damping, few}) {
    const MatrixXd expected = kronecker_information(robot, position);
    EXPECT_LT(scaled_difference(robot_information_matrix(robot, position), expected), 1e-10);
  }
}

// A robot of two joints, one with a bearing: sizes that are not compiled in.
TEST(RobotInformation, EqualsTheKroneckerFormForOtherSizes) {
  const RobotModel paper = robot_test::paper_robot();
  std::vector<ChainRotation> rotations(paper.chain.rotations().begin() + 4,
                                       paper.chain.rotations().begin() + 6);
  rotations.push_back(paper.chain.rotations()[8]);
  RobotModel robot = paper;
  robot.chain = RigidChain(rotations, paper.chain.gravity());
  robot.springs = {paper.springs[4], paper.springs[5], paper.springs[8]};
  robot.springs[0].joint = robot.springs[1].joint = 0;
  robot.springs[2].joint = 1;
  robot.transmission = paper.transmission.block(1, 1, 2, 2);
  robot.motor_inertia = paper.motor_inertia.segment(1, 2);
  robot.motor_friction = VectorXd::Zero(2);
  robot.controller = {paper.controller.proportional.segment(1, 2),
                      paper.controller.integral_time.segment(1, 2)};
  robot.parameters = {1, 2, 0};
  const VectorXd position = robot_test::radians({20, -35});
  for (const double coupling : {0.0, 30.0}) {
    robot.transmission(1, 0) = coupling;
    const MatrixXd expected = kronecker_information(robot, position);
    EXPECT_LT(scaled_difference(robot_information_matrix(robot, position), expected), 1e-10);
  }
}

TEST(RobotInformation, IsPositiveDefiniteAndFinite) {
  const RobotModel robot = robot_test::paper_robot();
  const InformationSet set = robot_information_set(robot, robot_grid(100));
  EXPECT_NO_THROW(set.validate());
  EXPECT_EQ(set.dimension(), 12U);
  EXPECT_EQ(set.parameters(), robot.parameter_names());
  EXPECT_EQ(set.candidates().names, (std::vector<std::string>{"q1", "q2", "q3", "q4", "q5", "q6"}));
  EXPECT_EQ(set.candidates().values, robot_grid(100).degrees);
  MatrixXd h(12, 12);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    unpack(set.information(i).data(), 12, h.data());
    const VectorXd scale = h.diagonal().cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * h * scale.asDiagonal();
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(scaled).eigenvalues()(0), 1e-9);
  }
}

TEST(RobotInformation, DoesNotDependOnThreadsToTheLastBit) {
  const RobotModel robot = robot_test::paper_robot();
  const PositionTable positions = robot_grid(200);
  const std::string one = robot_information_set(robot, positions).content_hash();
  for (const int threads : {2, 3, 7}) {
    EXPECT_EQ(robot_information_set(robot, positions, {.threads = threads}).content_hash(), one);
  }
}

TEST(RobotInformation, PermutedPositionsGivePermutedMatricesToTheLastBit) {
  const RobotModel robot = robot_test::paper_robot();
  const PositionTable positions = robot_grid(60);
  std::vector<std::size_t> order(60);
  std::iota(order.rbegin(), order.rend(), 0UL);
  const InformationSet set = robot_information_set(robot, positions);
  const InformationSet permuted = robot_information_set(robot, positions.subset(order));
  EXPECT_EQ(set.subset(order).content_hash(), permuted.content_hash());
}

TEST(RobotInformation, PermutedParametersPermuteRowsAndColumns) {
  RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[1];
  const MatrixXd h = robot_information_matrix(robot, position);
  const std::vector<Eigen::Index> order = {11, 3, 0, 7};
  const std::vector<std::size_t> all = robot.parameters;
  robot.parameters.clear();
  for (const Eigen::Index p : order) robot.parameters.push_back(all[static_cast<std::size_t>(p)]);
  EXPECT_EQ(robot_information_matrix(robot, position), h(order, order));
}

// Information about theta is information about the stiffness times k_p k_q; central differences of
// G in N m/rad give the latter.
TEST(RobotInformation, ParametersScaleTheStiffness) {
  const RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[3];
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(position);
  const MatrixXd per_stiffness = kronecker_information(robot, model, [&](double w) {
    std::vector<MatrixXcd> derivatives;
    for (const std::size_t spring : robot.parameters) {
      const double step = 20.0;  // N m/rad
      LocalModel above = model, below = model;
      const VectorXd& b = model.elements[spring].location;
      above.stiffness += step * b * b.transpose();
      below.stiffness -= step * b * b.transpose();
      derivatives.push_back((frequency_response(above, w, robot.sample_time) -
                             frequency_response(below, w, robot.sample_time)) /
                            (2.0 * step));
    }
    return derivatives;
  });
  VectorXd k(12);
  for (Eigen::Index p = 0; p < 12; ++p) {
    k(p) = robot.springs[robot.parameters[static_cast<std::size_t>(p)]].stiffness;
  }
  const MatrixXd expected = k.asDiagonal() * per_stiffness * k.asDiagonal();
  EXPECT_LT(scaled_difference(robot_information_matrix(robot, position), expected), 1e-6);
}

// A robot of another unit of force has the same information: all torques and masses times s, while
// angles and times stay.
TEST(RobotInformation, DoesNotDependOnTheUnitOfForce) {
  const RobotModel robot = robot_test::paper_robot();
  RobotModel heavy = robot;
  const double s = 8.0;
  std::vector<ChainRotation> rotations = robot.chain.rotations();
  for (ChainRotation& rotation : rotations) {
    rotation.body.mass *= s;
    rotation.body.inertia *= s;
  }
  heavy.chain = RigidChain(rotations, robot.chain.gravity());
  for (ArmSpring& spring : heavy.springs) {
    spring.stiffness *= s;
    spring.damping *= s;
  }
  heavy.motor_inertia *= s;
  heavy.controller.proportional *= s;
  for (const VectorXd& position : robot_test::some_positions()) {
    const MatrixXd h = robot_information_matrix(robot, position);
    EXPECT_LT(scaled_difference(robot_information_matrix(heavy, position), h), 1e-10);
  }
}

TEST(RobotInformation, ScalesWithExcitationNoiseAndTheOption) {
  RobotModel robot = robot_test::paper_robot();
  const VectorXd position = robot_test::some_positions()[2];
  const MatrixXd h = robot_information_matrix(robot, position);
  EXPECT_LT(scaled_difference(robot_information_matrix(robot, position, {.scale = 3.0}), 3.0 * h),
            1e-14);
  robot.reference_psd *= 6.0;
  robot.velocity_psd_slope *= 2.0;
  EXPECT_LT(scaled_difference(robot_information_matrix(robot, position), 3.0 * h), 1e-14);
}

// The payload is symmetric about axis 6, which is why the paper leaves q6 at 0.
TEST(RobotInformation, DoesNotDependOnTheLastAngle) {
  const RobotModel robot = robot_test::paper_robot();
  const MatrixXd at_zero =
      robot_information_matrix(robot, robot_test::radians({45, 15, -150, 45, -90, 0}));
  const MatrixXd turned =
      robot_information_matrix(robot, robot_test::radians({45, 15, -150, 45, -90, 77}));
  EXPECT_LT(scaled_difference(turned, at_zero), 1e-10);
}

// Nor on the first, about the vertical.
TEST(RobotInformation, DoesNotDependOnTheFirstAngleButForTheBearingsBelowIt) {
  RobotModel robot = robot_test::paper_robot();
  robot.springs[0].stiffness = robot.springs[1].stiffness;  // bearings alike about x and y
  robot.springs[0].damping = robot.springs[1].damping;
  robot.parameters = {2, 5, 8, 9, 10, 11};
  const MatrixXd at_zero =
      robot_information_matrix(robot, robot_test::radians({0, 15, -150, 45, -90, 0}));
  const MatrixXd turned =
      robot_information_matrix(robot, robot_test::radians({90, 15, -150, 45, -90, 0}));
  EXPECT_LT(scaled_difference(turned, at_zero), 1e-3);
}

TEST(RobotInformation, TotalDerivativeFollowsTheMovingEquilibrium) {
  RobotModel robot = robot_test::paper_robot();
  robot.frequencies = {20.0, 75.0, 190.0};
  const VectorXd position = robot_test::some_positions()[1];
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(position);
  const MatrixXd expected = kronecker_information(robot, model, [&](double w) {
    std::vector<MatrixXcd> derivatives;
    for (const std::size_t spring : robot.parameters) {
      const double step = 1e-5;
      MatrixXcd difference = MatrixXcd::Zero(6, 6);
      for (const double sign : {1.0, -1.0}) {
        RobotModel changed = robot;
        changed.springs[spring].stiffness *= 1.0 + sign * step;
        LocalModelBuilder changed_builder(changed);
        difference += sign / (2.0 * step) *
                      frequency_response(changed_builder.build(position), w, robot.sample_time);
      }
      derivatives.push_back(difference);
    }
    return derivatives;
  });
  const MatrixXd total = robot_information_matrix(robot, position, {.total_derivative = true});
  EXPECT_LT(scaled_difference(total, expected), 1e-6);
  // The point does move: the derivative at a held point is another one.
  EXPECT_GT(scaled_difference(robot_information_matrix(robot, position), expected), 1e-5);
}

// Without gravity nothing sags and the two derivatives agree.
TEST(RobotInformation, TotalDerivativeIsThePartialOneWithoutGravity) {
  RobotModel robot = robot_test::paper_robot();
  robot.chain = RigidChain(robot.chain.rotations(), Eigen::Vector3d::Zero());
  const VectorXd position = robot_test::some_positions()[4];
  EXPECT_LT(scaled_difference(robot_information_matrix(robot, position, {.total_derivative = true}),
                              robot_information_matrix(robot, position)),
            1e-10);
}

// Maximum likelihood (7) by Gauss-Newton on responses estimated from simulated spectra of the
// closed loop, Y = G U + V, U = F (R - Y), G_hat = Y U^-1: the estimates' covariance is H^-1.
class MonteCarlo {
 public:
  MonteCarlo(const RobotModel& robot, const VectorXd& position) : robot_(robot), random_(2024) {
    LocalModelBuilder builder(robot_);
    model_ = builder.build(position);
    for (const double w : robot_.frequencies) {
      const MatrixXcd g = frequency_response(model_, w, robot_.sample_time);
      const VectorXcd f = controller_response(robot_.controller, w, robot_.sample_time);
      const MatrixXcd lambda = response_covariance(
          g, f, velocity_noise_psd(robot_, w) * MatrixXcd::Identity(6, 6), robot_.reference_psd);
      responses_.push_back(g);
      controllers_.push_back(f);
      factors_.emplace_back(lambda);
    }
  }

  VectorXd estimate_error() {
    std::vector<MatrixXcd> measured;
    for (std::size_t k = 0; k < responses_.size(); ++k) measured.push_back(measure(k));
    VectorXd theta = VectorXd::Ones(12);
    for (int iteration = 0; iteration < 2; ++iteration) theta += gauss_newton_step(measured, theta);
    return theta - VectorXd::Ones(12);
  }

 private:
  MatrixXcd measure(std::size_t k) {
    const double w = robot_.frequencies[k];
    const MatrixXcd& g = responses_[k];
    const auto f = controllers_[k].asDiagonal();
    const double noise = std::sqrt(velocity_noise_psd(robot_, w) / 2.0);
    const MatrixXcd v = MatrixXcd::NullaryExpr(
        6, 6, [&] { return noise * Complex(random_.normal(), random_.normal()); });
    const MatrixXcd identity = MatrixXcd::Identity(6, 6);
    const MatrixXcd r = std::sqrt(robot_.reference_psd / 6.0) * identity;
    const MatrixXcd u = (identity + f * g).partialPivLu().solve(f * (r - v));
    return (g * u + v) * u.inverse();
  }

  // The minimiser of sum e^H Lambda^-1 e with G linearised at theta.
  VectorXd gauss_newton_step(const std::vector<MatrixXcd>& measured, const VectorXd& theta) const {
    const LocalModel model = model_.with_parameters(theta);
    MatrixXd normal = MatrixXd::Zero(12, 12);
    VectorXd right = VectorXd::Zero(12);
    for (std::size_t k = 0; k < measured.size(); ++k) {
      const double w = robot_.frequencies[k];
      const auto derivatives = frequency_response_derivatives(model, w, robot_.sample_time);
      MatrixXcd jacobian(36, 12);
      for (Eigen::Index p = 0; p < 12; ++p) {
        jacobian.col(p) = derivatives[static_cast<std::size_t>(p)].reshaped() /
                          theta(p);  // with_parameters() makes theta the new unit
      }
      VectorXcd error = (measured[k] - frequency_response(model, w, robot_.sample_time)).reshaped();
      factors_[k].matrixL().solveInPlace(jacobian);
      factors_[k].matrixL().solveInPlace(error);
      normal += (jacobian.adjoint() * jacobian).real();
      right += (jacobian.adjoint() * error).real();
    }
    return normal.ldlt().solve(right);
  }

  RobotModel robot_;
  Random random_;
  LocalModel model_;
  std::vector<MatrixXcd> responses_;
  std::vector<VectorXcd> controllers_;
  std::vector<Eigen::LLT<MatrixXcd>> factors_;
};

TEST(RobotInformation, IsTheInverseCovarianceOfEstimatesFromSimulatedResponses) {
  RobotModel robot = robot_test::paper_robot();
  robot.velocity_psd_slope *= 1e-12;  // so little noise that the estimator is linear in it
  std::vector<double> frequencies;
  for (std::size_t k = 0; k < 50; k += 4) frequencies.push_back(robot.frequencies[k]);
  robot.frequencies = frequencies;
  const VectorXd position = robot_test::some_positions()[1];
  const MatrixXd h = robot_information_matrix(robot, position);
  const MatrixXd root = Eigen::LLT<MatrixXd>(h).matrixL().transpose();  // H = root^T root

  MonteCarlo monte_carlo(robot, position);
  const int runs = 400;
  MatrixXd covariance = MatrixXd::Zero(12, 12);  // of root * error: the identity
  VectorXd mean = VectorXd::Zero(12);
  for (int run = 0; run < runs; ++run) {
    const VectorXd whitened = root * monte_carlo.estimate_error();
    mean += whitened / runs;
    covariance += whitened * whitened.transpose() / runs;
  }
  // Standard deviations: 1 / sqrt(N) of a mean, sqrt(2 / N) of a variance, 1 / sqrt(N) of a
  // covariance; the trace has 12 variances. All bounds are 4.5 of them.
  const double unit = 4.5 / std::sqrt(runs);
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), unit);
  EXPECT_NEAR(covariance.trace(), 12.0, unit * std::sqrt(2.0 * 12.0));
  for (Eigen::Index p = 0; p < 12; ++p) {
    EXPECT_NEAR(covariance(p, p), 1.0, unit * std::sqrt(2.0));
    for (Eigen::Index q = 0; q < p; ++q) EXPECT_NEAR(covariance(p, q), 0.0, unit);
  }
}

TEST(RobotInformation, RefusesBadInput) {
  const RobotModel robot = robot_test::paper_robot();
  const PositionTable good = robot_grid(2);
  EXPECT_THROW((void)robot_information_set(robot, {6, {}}), InputError);
  EXPECT_THROW((void)robot_information_set(robot, {5, std::vector<double>(10, 0.0)}), InputError);
  EXPECT_THROW((void)robot_information_set(robot, good, {.threads = 0}), InputError);
  EXPECT_THROW((void)robot_information_set(robot, good, {.scale = 0.0}), InputError);
  EXPECT_THROW((void)robot_information_set(robot, good,
                                           {.gravity_deflection = false, .total_derivative = true}),
               InputError);
  PositionTable bad = good;
  bad.degrees[7] = std::nan("");
  EXPECT_THROW((void)robot_information_set(robot, bad), InputError);
  RobotModel soft = robot;
  for (ArmSpring& spring : soft.springs) spring.stiffness = 10.0;
  EXPECT_THROW((void)robot_information_set(soft, good, {.threads = 2}), InputError);
}

}  // namespace
}  // namespace graybox
