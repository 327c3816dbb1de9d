#include "diagnosis/robot_fits/constitutive_residuals.hpp"

#include <complex>
#include <cstddef>

#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {

using Complex = std::complex<double>;

ConstitutiveResiduals::ConstitutiveResiduals(const RobotModel& robot,
                                             const ResponseMeasurement& measurement,
                                             const Eigen::VectorXd& theta, double relaxation)
    : model_(LocalModelBuilder(with_stiffness_factors(robot, theta)).build(measurement.position)),
      sample_time_(robot.sample_time),
      springs_(model_.mass.rows(), theta.size()),
      base_theta_(theta),
      nominal_(theta.size()) {
  for (Eigen::Index p = 0; p < theta.size(); ++p) {
    const LinearElement& spring = model_.elements[model_.parameters[static_cast<std::size_t>(p)]];
    springs_.col(p) = spring.location;
    nominal_(p) = spring.value / theta(p);
  }
  sources_.resize(springs_.rows(), model_.input.cols() + springs_.cols());
  sources_ << model_.input.cast<Complex>(), springs_.cast<Complex>();
  for (std::size_t f = 0; f < measurement.frequencies.size(); ++f) {
    const double w = measurement.frequencies[f];
    const Eigen::MatrixXcd& response = measurement.responses[f];
    const ResponseNoise noise =
        measurement.noise.empty() ? closed_loop_noise(robot, w, response) : measurement.noise[f];
    Line line{w, response, noise.right, {}, {}};
    line.covariance = (2.0 * measurement.experiments * noise.left.adjoint() * noise.left).inverse();
    line.energy = relaxation * relaxation *
                  ((response * noise.right).cwiseAbs2().transpose() * robot.motor_inertia);
    lines_.push_back(std::move(line));
  }
  set_num_residuals(2 * static_cast<int>(measurement.channel_count()));
  mutable_parameter_block_sizes()->push_back(static_cast<int>(theta.size()));
}

bool ConstitutiveResiduals::Evaluate(double const* const* parameters, double* residuals,
                                     double** jacobians) const {
  const Eigen::Index d = nominal_.size();
  const Eigen::VectorXd theta = Eigen::Map<const Eigen::VectorXd>(parameters[0], d).array().exp();
  if (!theta.allFinite()) return false;
  spring_stiffness_ = theta.cwiseProduct(nominal_);
  stiffness_ = model_.stiffness;
  stiffness_.noalias() +=
      springs_ * (theta - base_theta_).cwiseProduct(nominal_).asDiagonal() * springs_.transpose();
  double* jacobian = jacobians != nullptr ? jacobians[0] : nullptr;
  const double* begin = residuals;
  for (const Line& line : lines_) {
    solve(line);
    for (Eigen::Index column = 0; column < error_.cols(); ++column) {
      relax(line, column);
      if (factor_.info() != Eigen::Success) return false;
      if (jacobian != nullptr) differentiate(line, column);
      for (Eigen::Index i = 0; i < residual_.size(); ++i) {
        *residuals++ = residual_(i).real();
        *residuals++ = residual_(i).imag();
        if (jacobian == nullptr) continue;
        for (Eigen::Index p = 0; p < d; ++p) {
          jacobian[p] = derivatives_(i, p).real();
          jacobian[d + p] = derivatives_(i, p).imag();
        }
        jacobian += 2 * d;
      }
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(begin, num_residuals()).allFinite();
}

// E U, elongations and A.
void ConstitutiveResiduals::solve(const Line& line) const {
  const double w = line.frequency;
  const Eigen::Index inputs = model_.input.cols();
  const Eigen::Index d = nominal_.size();
  dynamic_.resize(stiffness_.rows(), stiffness_.cols());
  dynamic_.real() = stiffness_ - w * w * model_.mass;
  dynamic_.imag() = w * model_.damping;
  dynamic_factor_.compute(dynamic_);
  states_ = dynamic_factor_.solve(sources_);
  const Complex velocity = Complex(0.0, w) * hold_factor(w, sample_time_);
  transfer_.noalias() = velocity * (model_.input.transpose() * states_.rightCols(d));
  elongations_.noalias() = springs_.transpose() * states_;
  error_ = line.response;
  error_.noalias() -= velocity * (model_.input.transpose() * states_.leftCols(inputs));
  error_ *= line.excitation;
}

void ConstitutiveResiduals::relax(const Line& line, Eigen::Index column) const {
  covariance_ = line.covariance;
  covariance_.noalias() +=
      line.energy(column) * transfer_ * spring_stiffness_.asDiagonal() * transfer_.adjoint();
  factor_.compute(covariance_);
  residual_ = error_.col(column);
  factor_.matrixL().solveInPlace(residual_);
}

void ConstitutiveResiduals::differentiate(const Line& line, Eigen::Index column) const {
  const Eigen::Index inputs = model_.input.cols();
  force_ = transfer_.adjoint() * factor_.matrixL().adjoint().solve(residual_);
  force_.array() *= line.energy(column) * spring_stiffness_.array();
  elongation_.noalias() = elongations_.leftCols(inputs) * line.excitation.col(column);
  elongation_.noalias() += elongations_.rightCols(nominal_.size()) * force_;
  derivatives_ = transfer_;
  derivatives_ *= (spring_stiffness_.cwiseProduct(elongation_) - 0.5 * force_).asDiagonal();
  factor_.matrixL().solveInPlace(derivatives_);
}

}  // namespace graybox
