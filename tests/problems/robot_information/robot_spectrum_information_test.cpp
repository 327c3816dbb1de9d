#include "problems/robot_information/robot_spectrum_information.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

MatrixXd matrix_of(const InformationSet& set, std::size_t i) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  MatrixXd full(d, d);
  unpack(set.information(i).data(), set.dimension(), full.data());
  return full;
}

// sum of rho[line] H_line over the lines of position i, from the set's P H.
MatrixXd information_for(const InformationSet& set, std::size_t position, double power,
                         const std::vector<double>& rho) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  MatrixXd sum = MatrixXd::Zero(d, d);
  for (std::size_t k = 0; k < rho.size(); ++k) {
    sum += rho[k] / power * matrix_of(set, position * rho.size() + k);
  }
  return sum;
}

double scaled_difference(const MatrixXd& a, const MatrixXd& b) {
  const VectorXd scale = b.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

// G at theta = 1 + change e_p, the linearisation point held.
MatrixXcd response(const LocalModel& model, const RobotModel& robot, double w, Eigen::Index p,
                   double change) {
  VectorXd theta = VectorXd::Ones(static_cast<Eigen::Index>(model.parameters.size()));
  theta(p) += change;
  return frequency_response(model.with_parameters(theta), w, robot.sample_time);
}

// Formula (5) as the paper writes it: Lambda = [(U U^H)^-1]^T (x) Phi_v in full, U = (G + F^-1)^-1
// R with R R^H = diag(rho) > 0, and derivatives of G by central differences. (Of fourth order: the
// step must be far below the modal damping of 0.2 %, and large enough for the lowest frequencies.)
MatrixXd full_information(const RobotModel& robot, const VectorXd& position,
                          const std::vector<double>& rho) {
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(position);
  const Eigen::Index m = robot.motor_count();
  const auto d = static_cast<Eigen::Index>(robot.parameters.size());
  MatrixXd information = MatrixXd::Zero(d, d);
  for (std::size_t f = 0; f < robot.frequencies.size(); ++f) {
    const double w = robot.frequencies[f];
    const MatrixXcd g = frequency_response(model, w, robot.sample_time);
    const VectorXcd controller = controller_response(robot.controller, w, robot.sample_time);
    MatrixXcd loop = g;
    loop.diagonal() += controller.cwiseInverse();
    VectorXd root(m);
    for (Eigen::Index a = 0; a < m; ++a) {
      root(a) = std::sqrt(rho[f * static_cast<std::size_t>(m) + static_cast<std::size_t>(a)]);
    }
    const MatrixXcd u = loop.inverse() * root.cast<Complex>().asDiagonal();
    const MatrixXcd transposed = (u * u.adjoint()).inverse().transpose();
    MatrixXcd lambda(m * m, m * m);
    for (Eigen::Index r = 0; r < m; ++r) {
      for (Eigen::Index c = 0; c < m; ++c) {
        lambda.block(r * m, c * m, m, m) =
            transposed(r, c) * velocity_noise_psd(robot, w) * MatrixXcd::Identity(m, m);
      }
    }
    MatrixXcd psi(d, m * m);
    const double step = 5e-5;
    for (Eigen::Index p = 0; p < d; ++p) {
      const auto change = [&](double by) -> MatrixXcd {
        return response(model, robot, w, p, by) - response(model, robot, w, p, -by);
      };
      const MatrixXcd difference = (8.0 * change(step) - change(2.0 * step)) / (12.0 * step);
      psi.row(p) = difference.reshaped().transpose();
    }
    information += 2.0 * (psi.conjugate() * lambda.partialPivLu().solve(psi.transpose())).real();
  }
  return information;
}

RobotModel robot_with_coupled_wrist() {
  RobotModel robot = robot_test::paper_robot();
  robot.transmission(4, 3) = -12.0;
  robot.transmission(5, 3) = 7.0;
  robot.motor_friction << 0.01, 0.02, 0.03, 0.004, 0.005, 0.006;
  return robot;
}

RobotModel robot_with_few_parameters() {
  RobotModel robot = robot_test::paper_robot();
  robot.parameters = {4, 2, 9};
  robot.frequencies.resize(3);
  return robot;
}

class RobotSpectrum : public ::testing::TestWithParam<int> {
 protected:
  static RobotModel robot() {
    switch (GetParam()) {
      case 0:
        return robot_test::paper_robot();
      case 1:
        return robot_with_coupled_wrist();
      default:
        return robot_with_few_parameters();
    }
  }
};

TEST_P(RobotSpectrum, SumsToTheInformationOfTheFlatSpectrum) {
  const RobotModel model = robot();
  const PositionTable positions = robot_test::to_table(robot_test::some_positions());
  const InformationSet lines = robot_spectrum_set(model, positions);
  const InformationSet flat = robot_information_set(model, positions);
  ASSERT_EQ(lines.candidate_count(), positions.count() * line_count(model));
  const std::vector<double> rho(line_count(model),
                                model.reference_psd / static_cast<double>(model.motor_count()));
  for (std::size_t i = 0; i < positions.count(); ++i) {
    EXPECT_LT(
        scaled_difference(information_for(lines, i, flat_power(model), rho), matrix_of(flat, i)),
        1e-12);
  }
}

// Unequal powers, so that every line counts for itself; (2) is linear, so two choices of rho that
// differ in one axis pin down that axis.
TEST_P(RobotSpectrum, EqualsTheFullFormWithDifferencesForUnequalPowers) {
  const RobotModel model = robot();
  const std::vector<VectorXd> all = robot_test::some_positions();
  const std::vector<VectorXd> two = {all[1], all[4]};
  const InformationSet lines = robot_spectrum_set(model, robot_test::to_table(two));
  std::vector<double> rho(line_count(model));
  for (std::size_t k = 0; k < rho.size(); ++k) {
    rho[k] = 0.05 + static_cast<double>((7 * k) % 11);
  }
  for (std::size_t i = 0; i < two.size(); ++i) {
    EXPECT_LT(scaled_difference(information_for(lines, i, flat_power(model), rho),
                                full_information(model, two[i], rho)),
              1e-6);
  }
}

TEST_P(RobotSpectrum, OneAxisIsTheDerivativeByItsPower) {
  RobotModel model = robot();
  model.frequencies = {model.frequencies.back()};
  const VectorXd position = robot_test::some_positions()[3];
  const InformationSet lines = robot_spectrum_set(model, robot_test::to_table({position}));
  const auto axes = static_cast<std::size_t>(model.motor_count());
  const std::vector<double> rho(axes, 1.0);
  const MatrixXd base = full_information(model, position, rho);
  for (std::size_t a = 0; a < axes; ++a) {
    std::vector<double> more = rho;
    more[a] += 2.0;
    const MatrixXd line = matrix_of(lines, a) / flat_power(model);
    EXPECT_LT(scaled_difference(base + 2.0 * line, full_information(model, position, more)), 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, RobotSpectrum, ::testing::Values(0, 1, 2));

TEST(RobotSpectrumSet, IsPositiveSemidefiniteAndNamed) {
  const RobotModel robot = robot_test::paper_robot();
  const InformationSet set = robot_spectrum_set(robot, robot_grid(3));
  EXPECT_NO_THROW(set.validate());
  EXPECT_EQ(set.candidates().names,
            (std::vector<std::string>{"q1", "q2", "q3", "q4", "q5", "q6", "frequency", "axis"}));
  EXPECT_EQ(set.parameters(), robot.parameter_names());
  EXPECT_GE(robot_spectrum_bytes(robot, 3), set.bytes());
  const std::size_t line = (2 * 50 + 17) * 6 + 4;  // position 2, frequency 17, axis 5
  const auto coordinates = set.coordinates(line);
  const auto angles = robot_grid(3).degrees;
  EXPECT_TRUE(std::equal(angles.begin() + 12, angles.end(), coordinates.begin()));
  EXPECT_EQ(coordinates[6], robot.frequencies[17] / (2.0 * std::numbers::pi));
  EXPECT_EQ(coordinates[7], 5.0);
}

TEST(RobotSpectrumSet, DoesNotDependOnThreadsToTheLastBit) {
  const RobotModel robot = robot_test::paper_robot();
  const std::string one = robot_spectrum_set(robot, robot_grid(40)).content_hash();
  for (const int threads : {2, 5}) {
    EXPECT_EQ(robot_spectrum_set(robot, robot_grid(40), {.threads = threads}).content_hash(), one);
  }
}

TEST(RobotSpectrumSet, PositionsAreIndependentOfEachOther) {
  const RobotModel robot = robot_test::paper_robot();
  const PositionTable grid = robot_grid(5);
  const std::vector<std::size_t> last = {4};
  const InformationSet all = robot_spectrum_set(robot, grid);
  std::vector<std::size_t> lines(line_count(robot));
  std::iota(lines.begin(), lines.end(), 4 * lines.size());
  EXPECT_EQ(all.subset(lines).content_hash(),
            robot_spectrum_set(robot, grid.subset(last)).content_hash());
}

TEST(RobotSpectrumSet, PowerScalesItsPosition) {
  const RobotModel robot = robot_test::paper_robot();
  const InformationSet flat = robot_spectrum_set(robot, robot_grid(2));
  const InformationSet scaled = robot_spectrum_set(
      robot, robot_grid(2), {.power = {3.0 * flat_power(robot), flat_power(robot)}});
  const std::size_t lines = line_count(robot);
  for (std::size_t k = 0; k < lines; k += 37) {
    EXPECT_LT(scaled_difference(matrix_of(scaled, k), 3.0 * matrix_of(flat, k)), 1e-12);
    EXPECT_EQ(matrix_of(scaled, lines + k), matrix_of(flat, lines + k));
  }
}

// The reference power and the number of lines scale P_i; the noise scales all alike.
TEST(RobotSpectrumSet, ScalesWithExcitationAndNoise) {
  RobotModel robot = robot_test::paper_robot();
  const PositionTable position = robot_test::to_table({robot_test::some_positions()[2]});
  const InformationSet before = robot_spectrum_set(robot, position);
  robot.reference_psd *= 6.0;
  robot.velocity_psd_slope *= 2.0;
  const InformationSet after = robot_spectrum_set(robot, position);
  for (const std::size_t line : {3UL, 120UL, 299UL}) {
    EXPECT_LT(scaled_difference(matrix_of(after, line), 3.0 * matrix_of(before, line)), 1e-12);
  }
}

// A robot whose motors 4 and 5 are listed in the other order (the rows of the transmission, which
// is then not diagonal) is the same robot: its lines are exchanged and nothing else.
TEST(RobotSpectrumSet, ExchangedAxesExchangeTheirLines) {
  RobotModel robot = robot_test::paper_robot();
  RobotModel exchanged = robot;
  const auto swap_motors = [&](auto& vector) { std::swap(vector(3), vector(4)); };
  swap_motors(exchanged.motor_inertia);
  swap_motors(exchanged.motor_friction);
  swap_motors(exchanged.controller.proportional);
  swap_motors(exchanged.controller.integral_time);
  exchanged.transmission.row(3).swap(exchanged.transmission.row(4));
  const PositionTable position = robot_test::to_table({robot_test::some_positions()[4]});
  const InformationSet first = robot_spectrum_set(robot, position);
  const InformationSet second = robot_spectrum_set(exchanged, position);
  const std::vector<std::size_t> other_axis = {0, 1, 2, 4, 3, 5};
  for (std::size_t f = 0; f < 50; f += 7) {
    for (std::size_t a = 0; a < 6; ++a) {
      EXPECT_LT(
          scaled_difference(matrix_of(second, 6 * f + other_axis[a]), matrix_of(first, 6 * f + a)),
          1e-9);
    }
  }
}

TEST(RobotSpectrumSet, RefusesBadInput) {
  const RobotModel robot = robot_test::paper_robot();
  EXPECT_THROW((void)robot_spectrum_set(robot, {6, {}}), InputError);
  EXPECT_THROW((void)robot_spectrum_set(robot, robot_grid(2), {.threads = 0}), InputError);
  EXPECT_THROW((void)robot_spectrum_set(robot, robot_grid(2), {.power = {1.0}}), InputError);
  EXPECT_THROW((void)robot_spectrum_set(robot, robot_grid(2), {.power = {1.0, 0.0}}), InputError);
  RobotModel soft = robot;
  for (ArmSpring& spring : soft.springs) spring.stiffness = 10.0;
  EXPECT_THROW((void)robot_spectrum_set(soft, robot_grid(4), {.threads = 2}), InputError);
}

}  // namespace
}  // namespace graybox
