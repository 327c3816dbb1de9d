#include "diagnosis/response_fits/response_measurement.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"

namespace graybox {

using Complex = std::complex<double>;

// The noise is left^-1 Z right^-1, so vec(noise) = (right^-T (x) left^-1) vec(Z).
Eigen::MatrixXcd ResponseNoise::covariance() const {
  const Eigen::MatrixXcd left_inverse = left.inverse();
  const Eigen::MatrixXcd right_inverse = right.inverse();
  const Eigen::Index n_y = left.rows(), n_u = right.rows();
  Eigen::MatrixXcd root(n_y * n_u, n_y * n_u);
  for (Eigen::Index i = 0; i < n_u; ++i) {
    for (Eigen::Index j = 0; j < n_u; ++j) {
      root.block(i * n_y, j * n_y, n_y, n_y) = right_inverse(j, i) * left_inverse;
    }
  }
  return root * root.adjoint();
}

ResponseNoise closed_loop_noise(const RobotModel& robot, double w,
                                const Eigen::MatrixXcd& response) {
  const Eigen::Index n_y = response.rows();
  Eigen::MatrixXcd closed_loop = response;
  closed_loop.diagonal() +=
      controller_response(robot.controller, w, robot.sample_time).cwiseInverse();
  ResponseNoise noise;
  noise.left = Eigen::MatrixXcd::Identity(n_y, n_y) / std::sqrt(velocity_noise_psd(robot, w));
  noise.right = std::sqrt(robot.reference_psd / static_cast<double>(n_y)) * closed_loop.inverse();
  return noise;
}

std::size_t ResponseMeasurement::channel_count() const {
  std::size_t count = 0;
  for (const Eigen::MatrixXcd& response : responses) {
    count += static_cast<std::size_t>(response.size());
  }
  return count;
}

ResponseMeasurement simulate_measurement(const RobotModel& robot, const Eigen::VectorXd& position,
                                         double experiments, Random& random) {
  if (!(experiments >= 1.0) || !std::isfinite(experiments)) {
    throw InputError(
        fmt::format("simulate: at least one experiment a position, not {}", experiments));
  }
  const LocalModel model = LocalModelBuilder(robot).build(position);
  ResponseMeasurement measurement{position, experiments, robot.frequencies, {}, {}};
  // Real and imaginary part of a circular normal number with E |z|^2 = 1 / experiments.
  const double deviation = std::sqrt(0.5 / experiments);
  for (const double w : robot.frequencies) {
    Eigen::MatrixXcd response = frequency_response(model, w, robot.sample_time);
    ResponseNoise noise = closed_loop_noise(robot, w, response);
    Eigen::MatrixXcd white(response.rows(), response.cols());
    for (Complex& z : white.reshaped()) {
      const double real = random.normal();
      z = deviation * Complex(real, random.normal());
    }
    response += noise.left.partialPivLu().solve(white) * noise.right.inverse();
    measurement.responses.push_back(std::move(response));
    measurement.noise.push_back(std::move(noise));
  }
  return measurement;
}

void merge(ResponseMeasurement& measurement, const ResponseMeasurement& more) {
  if (measurement.position != more.position || measurement.frequencies != more.frequencies) {
    throw InputError("merge: measurements of different positions or frequencies have no mean");
  }
  const double total = measurement.experiments + more.experiments;
  for (std::size_t f = 0; f < measurement.responses.size(); ++f) {
    measurement.responses[f] +=
        (more.experiments / total) * (more.responses[f] - measurement.responses[f]);
  }
  measurement.experiments = total;
}

}  // namespace graybox
