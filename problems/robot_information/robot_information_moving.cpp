#include "problems/robot_information/robot_information_moving.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <complex>

#include "problems/base/packed_matrix.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
constexpr double kStep = 1e-4;  // rad

}  // namespace

MovingPointWorker::MovingPointWorker(const RobotModel& robot, double scale)
    : robot_(&robot),
      scale_(scale),
      builder_(robot),
      stiffness_change_(robot.parameters.size()),
      mass_change_(robot.parameters.size()) {}

void MovingPointWorker::differentiate_arm(const LocalModel& local,
                                          const Eigen::VectorXd& commanded) {
  const Eigen::Index n = robot_->arm_size();
  const Eigen::VectorXd rotations = local.position.head(n);
  // The arm's block of K holds springs and gravity stiffness: the matrix of the equilibrium.
  const Eigen::LLT<Eigen::MatrixXd> factor(local.stiffness.topLeftCorner(n, n));
  for (std::size_t p = 0; p < robot_->parameters.size(); ++p) {
    const auto spring = static_cast<Eigen::Index>(robot_->parameters[p]);
    const double torque =
        robot_->springs[robot_->parameters[p]].stiffness * (rotations(spring) - commanded(spring));
    const Eigen::VectorXd direction = -factor.solve(torque * Eigen::VectorXd::Unit(n, spring));
    const double length = direction.norm();
    stiffness_change_[p] = mass_change_[p] = Eigen::MatrixXd::Zero(n, n);
    if (length == 0.0) continue;
    const Eigen::VectorXd step = direction * (kStep / length);
    for (const double sign : {1.0, -1.0}) {
      const ArmLinearisation& arm = builder_.at_rotations(rotations + sign * step);
      stiffness_change_[p] += arm.gravity_stiffness * (sign * length / (2.0 * kStep));
      mass_change_[p] += arm.mass * (sign * length / (2.0 * kStep));
    }
  }
}

void MovingPointWorker::add_frequency(const LocalModel& local, double w,
                                      Eigen::MatrixXd& information) const {
  const Eigen::Index n = robot_->arm_size();
  const Complex velocity = Complex(0.0, w) * hold_factor(w, robot_->sample_time);
  const Eigen::MatrixXcd states =
      dynamic_stiffness(local, w).partialPivLu().solve(local.input.cast<Complex>());
  Eigen::MatrixXcd closed = velocity * (local.output.cast<Complex>() * states);
  closed.diagonal() +=
      controller_response(robot_->controller, w, robot_->sample_time).cwiseInverse();
  const Eigen::MatrixXcd closed_inverse = closed.inverse();

  const std::size_t d = robot_->parameters.size();
  std::vector<Eigen::MatrixXcd> weighted(d);  // Y_p
  for (std::size_t p = 0; p < d; ++p) {
    const LinearElement& element = local.elements[local.parameters[p]];
    const Eigen::VectorXcd direct = states.transpose() * element.location.cast<Complex>();
    const Eigen::MatrixXd moved = stiffness_change_[p] - w * w * mass_change_[p];
    Eigen::MatrixXcd derivative = element.value * direct * direct.transpose();
    derivative += states.topRows(n).transpose() * moved.cast<Complex>() * states.topRows(n);
    weighted[p] = -velocity * derivative * closed_inverse;
  }
  const double weight =
      2.0 * robot_->reference_psd /
      (static_cast<double>(robot_->motor_count()) * velocity_noise_psd(*robot_, w));
  for (std::size_t p = 0; p < d; ++p) {
    for (std::size_t q = 0; q <= p; ++q) {
      information(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(q)) +=
          weight * weighted[p].conjugate().cwiseProduct(weighted[q]).sum().real();
    }
  }
}

void MovingPointWorker::compute(const Eigen::VectorXd& joint_angles, double* information) {
  const LocalModel local = builder_.build(joint_angles);
  Eigen::VectorXd commanded = Eigen::VectorXd::Zero(robot_->arm_size());
  const std::vector<Eigen::Index> gearboxes = robot_->gearbox_rotations();
  for (std::size_t j = 0; j < gearboxes.size(); ++j) {
    commanded(gearboxes[j]) = joint_angles(static_cast<Eigen::Index>(j));
  }
  differentiate_arm(local, commanded);

  const auto d = static_cast<Eigen::Index>(robot_->parameters.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(d, d);
  for (const double w : robot_->frequencies) add_frequency(local, w, sum);
  for (Eigen::Index p = 0; p < d; ++p) {
    for (Eigen::Index q = 0; q <= p; ++q) {
      information[packed_index(static_cast<std::size_t>(p), static_cast<std::size_t>(q))] =
          scale_ * sum(p, q);
    }
  }
}

}  // namespace graybox
