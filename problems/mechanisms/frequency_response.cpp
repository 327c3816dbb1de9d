#include "problems/mechanisms/frequency_response.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

namespace graybox {

using Complex = std::complex<double>;

// (1 - e^{-jx}) / (jx) = e^{-jx/2} sin(x/2) / (x/2).
Complex hold_factor(double w, double sample_time) {
  const double half = 0.5 * w * sample_time;
  const double sinc = half == 0.0 ? 1.0 : std::sin(half) / half;
  return std::polar(sinc, -half);
}

Eigen::MatrixXcd dynamic_stiffness(const LocalModel& model, double w) {
  Eigen::MatrixXcd d(model.mass.rows(), model.mass.cols());
  d.real() = model.stiffness - w * w * model.mass;
  d.imag() = w * model.damping;
  return d;
}

Eigen::VectorXd natural_frequencies(const LocalModel& model) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> modes(
      0.5 * (model.stiffness + model.stiffness.transpose()), model.mass, Eigen::EigenvaluesOnly);
  return modes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
}

Eigen::MatrixXcd frequency_response(const LocalModel& model, double w, double sample_time) {
  const Eigen::PartialPivLU<Eigen::MatrixXcd> factor(dynamic_stiffness(model, w));
  return Complex(0.0, w) * hold_factor(w, sample_time) *
         (model.output.cast<Complex>() * factor.solve(model.input.cast<Complex>()));
}

std::vector<Eigen::MatrixXcd> frequency_response_derivatives(const LocalModel& model, double w,
                                                             double sample_time) {
  const Eigen::PartialPivLU<Eigen::MatrixXcd> factor(dynamic_stiffness(model, w));
  // D is symmetric and B = S^T, so b^T D^-1 B is the transpose of S D^-1 b.
  const Eigen::MatrixXcd states = factor.solve(model.input.cast<Complex>());
  const Complex velocity = Complex(0.0, w) * hold_factor(w, sample_time);
  std::vector<Eigen::MatrixXcd> derivatives;
  for (const std::size_t p : model.parameters) {
    const LinearElement& element = model.elements[p];
    const Complex law = element.kind == LinearElement::Kind::kSpring
                            ? Complex(element.value, 0.0)
                            : Complex(0.0, w * element.value);
    const Eigen::VectorXcd direction = states.transpose() * element.location.cast<Complex>();
    derivatives.push_back(-velocity * law * direction * direction.transpose());
  }
  return derivatives;
}

Eigen::VectorXcd controller_response(const PiController& controller, double w, double sample_time) {
  // 1 - e^{-j w T_s} = j w T_s h(w), so T_s / (1 - e^{-j w T_s}) = 1 / (j w h).
  const Complex integrator = 1.0 / (Complex(0.0, w) * hold_factor(w, sample_time));
  Eigen::VectorXcd response(controller.proportional.size());
  for (Eigen::Index i = 0; i < response.size(); ++i) {
    response(i) = controller.proportional(i) * (1.0 + integrator / controller.integral_time(i));
  }
  return response;
}

double velocity_noise_psd(const RobotModel& robot, double w) {
  return robot.velocity_psd_slope * w * w;
}

Eigen::MatrixXcd response_covariance(const Eigen::MatrixXcd& response,
                                     const Eigen::VectorXcd& controller,
                                     const Eigen::MatrixXcd& noise_psd, double reference_psd) {
  Eigen::MatrixXcd closed = response;
  closed.diagonal() += controller.cwiseInverse();
  const Eigen::Index n_u = response.cols(), n_y = response.rows();
  const Eigen::MatrixXcd left = (closed.adjoint() * closed).transpose();
  Eigen::MatrixXcd covariance(n_y * n_u, n_y * n_u);
  for (Eigen::Index i = 0; i < n_u; ++i) {
    for (Eigen::Index j = 0; j < n_u; ++j) {
      covariance.block(i * n_y, j * n_y, n_y, n_y) = left(i, j) * noise_psd;
    }
  }
  return covariance * (static_cast<double>(n_y) / reference_psd);
}

}  // namespace graybox
