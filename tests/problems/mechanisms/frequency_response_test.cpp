#include "problems/mechanisms/frequency_response.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "problems/base/random.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kSampleTime = 0.0005;

// One mass on a damper: y' = -c/m y + u/m, a first-order system whose sampled response under a
// zero-order hold is known in closed form.
LocalModel mass_on_damper(double mass, double damping) {
  LocalModel model;
  model.mass = MatrixXd::Constant(1, 1, mass);
  model.damping = MatrixXd::Constant(1, 1, damping);
  model.stiffness = MatrixXd::Zero(1, 1);
  model.input = model.output = MatrixXd::Ones(1, 1);
  return model;
}

TEST(FrequencyResponse, HoldFactorMatchesItsDefinition) {
  for (const double w : {1.0, 100.0, 3000.0, 6000.0}) {
    const Complex x(0.0, w * kSampleTime);
    EXPECT_LT(std::abs(hold_factor(w, kSampleTime) - (1.0 - std::exp(-x)) / x), 1e-12);
  }
  EXPECT_EQ(hold_factor(0.0, kSampleTime), Complex(1.0, 0.0));
}

// (11) leaves out the images of the Poisson sum, which are small far below the Nyquist frequency.
TEST(FrequencyResponse, HoldFactorGivesTheSampledResponseBelowNyquist) {
  const LocalModel model = mass_on_damper(2.0, 50.0);
  const double pole = std::exp(-50.0 / 2.0 * kSampleTime);
  for (const double hz : {1.0, 10.0, 60.0}) {
    const double w = 2.0 * std::numbers::pi * hz;
    const Complex z = std::polar(1.0, w * kSampleTime);
    const Complex exact = (1.0 - pole) / 50.0 / (z - pole);
    const Complex approximate = frequency_response(model, w, kSampleTime)(0, 0);
    const double image = w * kSampleTime / (2.0 * std::numbers::pi);  // of relative size w / w_s
    EXPECT_LT(std::abs(approximate - exact), image * std::abs(exact));
  }
}

TEST(FrequencyResponse, IsReciprocal) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(robot_test::some_positions()[4]);
  for (const double w : {10.0, 60.0, 300.0}) {
    const MatrixXcd g = frequency_response(model, w, robot.sample_time);
    EXPECT_LT((g - g.transpose()).norm(), 1e-12 * g.norm());
  }
}

// Far below all resonances motors and arm move as one: with gravity off,
// G = N (M_joints + N^2 J)^-1 N / (j w).
TEST(FrequencyResponse, IsTheRigidRobotAtLowFrequency) {
  RobotModel robot = robot_test::paper_robot();
  robot.chain = RigidChain(robot.chain.rotations(), Eigen::Vector3d::Zero());
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(robot_test::some_positions()[4]);
  MatrixXd rigid = robot.transmission * robot.motor_inertia.asDiagonal() * robot.transmission;
  const auto gearboxes = robot.gearbox_rotations();
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = 0; j < 6; ++j) {
      rigid(i, j) += model.mass(gearboxes[static_cast<std::size_t>(i)],
                                gearboxes[static_cast<std::size_t>(j)]);
    }
  }
  const double w = 2.0 * std::numbers::pi * 0.01;
  const MatrixXcd g = frequency_response(model, w, robot.sample_time);
  const MatrixXd expected = robot.transmission * rigid.inverse() * robot.transmission / w;
  EXPECT_LT((g.imag() + expected).norm(), 1e-4 * expected.norm());
}

// G in extended precision with the stiffness of one spring scaled by 1 + change. At low frequencies
// the derivatives are so far below G that differences in double precision would be lost.
using LongComplex = std::complex<long double>;
using LongMatrix = Eigen::Matrix<LongComplex, Eigen::Dynamic, Eigen::Dynamic>;

LongMatrix long_response(const LocalModel& model, const LinearElement& spring, long double w,
                         long double change) {
  const auto b = spring.location.cast<long double>();
  LongMatrix d = model.stiffness.cast<LongComplex>();
  d += (change * static_cast<long double>(spring.value) * b * b.transpose()).cast<LongComplex>();
  d += LongComplex(0, w) * model.damping.cast<LongComplex>();
  d -= LongComplex(w * w) * model.mass.cast<LongComplex>();
  const LongComplex delay = std::polar(1.0L, -w * static_cast<long double>(kSampleTime));
  const LongComplex hold = (1.0L - delay) / static_cast<long double>(kSampleTime);  // j w h
  return hold * (model.output.cast<LongComplex>() *
                 d.partialPivLu().solve(model.input.cast<LongComplex>()));
}

// Central differences with steps h and 2 h, extrapolated (error of order h^4).
MatrixXcd differenced(const LocalModel& model, const LinearElement& spring, double w) {
  const auto central = [&](long double h) {
    return LongMatrix((long_response(model, spring, w, h) - long_response(model, spring, w, -h)) /
                      LongComplex(2 * h));
  };
  const long double h = 1e-5L;
  return LongMatrix((LongComplex(4) * central(h) - central(2 * h)) / LongComplex(3))
      .cast<Complex>();
}

TEST(FrequencyResponse, DerivativesMatchCentralDifferences) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  for (const VectorXd& position : robot_test::some_positions()) {
    const LocalModel model = builder.build(position);
    for (std::size_t f = 0; f < robot.frequencies.size(); f += 7) {
      const double w = robot.frequencies[f];
      const auto derivatives = frequency_response_derivatives(model, w, kSampleTime);
      ASSERT_EQ(derivatives.size(), 12U);
      for (std::size_t p = 0; p < 12; ++p) {
        const MatrixXcd expected = differenced(model, model.elements[model.parameters[p]], w);
        EXPECT_LT((derivatives[p] - expected).norm(), 1e-6 * expected.norm())
            << "parameter " << p << ", frequency " << w;
      }
    }
  }
}

TEST(FrequencyResponse, DamperDerivativesMatchCentralDifferences) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  LocalModel model = builder.build(robot_test::some_positions()[1]);
  model.parameters = {12 + 2};  // the damper of joint 1's gearbox: dampers follow the 12 springs
  ASSERT_EQ(model.elements[14].kind, LinearElement::Kind::kDamper);
  const double w = 80.0, step = 1e-3;
  const VectorXd one = VectorXd::Ones(1);
  const MatrixXcd difference =
      (frequency_response(model.with_parameters((1.0 + step) * one), w, robot.sample_time) -
       frequency_response(model.with_parameters((1.0 - step) * one), w, robot.sample_time)) /
      (2.0 * step);
  const MatrixXcd exact = frequency_response_derivatives(model, w, robot.sample_time)[0];
  EXPECT_LT((exact - difference).norm(), 1e-6 * exact.norm());
}

// u_k = K_p (e_k + T_s/T_i sum_{i <= k} e_i), fed with e^{j w k T_s} since ever.
TEST(FrequencyResponse, ControllerIsTheSampledPi) {
  PiController controller{VectorXd::Constant(1, 2.0), VectorXd::Constant(1, 0.11)};
  const double w = 50.0;
  const Complex z = std::polar(1.0, w * kSampleTime);
  const Complex f = controller_response(controller, w, kSampleTime)(0);
  // The response must satisfy the difference equation u_k - u_{k-1} = K_p (e_k - e_{k-1} + c e_k).
  const Complex left = f * (1.0 - 1.0 / z);
  const Complex right = 2.0 * ((1.0 - 1.0 / z) + kSampleTime / 0.11);
  EXPECT_LT(std::abs(left - right), 1e-12 * std::abs(right));
}

// vec(G_hat) from simulated spectra of the closed loop, Y = G U + V, U = F (R - Y): its covariance
// is (12).
TEST(FrequencyResponse, CovarianceOfSimulatedEstimatesIsLambda) {
  Random random(7);
  const Eigen::Index n = 3;
  const auto normal = [&] { return Complex(random.normal(), random.normal()) / std::sqrt(2.0); };
  const MatrixXcd g = MatrixXcd::NullaryExpr(n, n, normal);
  const VectorXcd f = VectorXcd::NullaryExpr(n, [&] { return 2.0 + normal(); });
  const MatrixXcd root = 1e-4 * MatrixXcd::NullaryExpr(n, n, normal);
  const MatrixXcd noise = root * root.adjoint();
  const double reference_psd = 1.7;
  const MatrixXcd unitary = MatrixXcd::NullaryExpr(n, n, normal).householderQr().householderQ();
  const MatrixXcd reference = std::sqrt(reference_psd / static_cast<double>(n)) * unitary;

  const MatrixXcd identity = MatrixXcd::Identity(n, n);
  const MatrixXcd lambda = response_covariance(g, f, noise, reference_psd);
  MatrixXcd sample = MatrixXcd::Zero(n * n, n * n);
  const int runs = 20000;
  for (int run = 0; run < runs; ++run) {
    const MatrixXcd v = root * MatrixXcd::NullaryExpr(n, n, normal);
    const MatrixXcd u =
        (identity + f.asDiagonal() * g).partialPivLu().solve(f.asDiagonal() * (reference - v));
    const MatrixXcd error = (g * u + v) * u.inverse() - g;
    const VectorXcd e = error.reshaped();
    sample += e * e.adjoint() / runs;
  }
  // Entries have standard deviations sqrt(L_ii L_jj / runs).
  for (Eigen::Index i = 0; i < n * n; ++i) {
    for (Eigen::Index j = 0; j < n * n; ++j) {
      const double scale = std::sqrt(std::real(lambda(i, i)) * std::real(lambda(j, j)) / runs);
      EXPECT_LT(std::abs(sample(i, j) - lambda(i, j)), 5.0 * scale) << i << ", " << j;
    }
  }
}

// Without damping D is singular there, and for a motor that nothing holds at zero.
TEST(FrequencyResponse, NaturalFrequenciesAreWhereTheUndampedModelIsSingular) {
  const RobotModel robot = robot_test::paper_robot();
  LocalModelBuilder builder(robot);
  LocalModel model = builder.build(robot_test::some_positions()[1]);
  model.damping.setZero();
  const Eigen::VectorXd frequencies = natural_frequencies(model);
  ASSERT_EQ(frequencies.size(), model.degrees_of_freedom());
  EXPECT_TRUE(std::is_sorted(frequencies.begin(), frequencies.end()));
  for (Eigen::Index k = 6; k < frequencies.size(); ++k) {  // after the six motors' zeros
    EXPECT_GT(frequencies(k), 1.0);
    const auto determinant = [&](double w) {
      // Scaled by the mass, so that the numbers stay in range.
      const Eigen::MatrixXd d = dynamic_stiffness(model, w).real() / 1e5;
      return d.determinant();
    };
    EXPECT_LT(determinant(frequencies(k) * (1 - 1e-6)) * determinant(frequencies(k) * (1 + 1e-6)),
              0.0);
  }
}

}  // namespace
}  // namespace graybox
