#include "diagnosis/response_fits/whitened_residuals.hpp"

#include <Eigen/LU>
#include <cmath>
#include <complex>

namespace graybox {
namespace {

// The entries of a column-major matrix as real and imaginary parts, `stride` numbers apart.
void write(const Eigen::MatrixXcd& matrix, double* out, Eigen::Index stride) {
  for (const std::complex<double>& value : matrix.reshaped()) {
    out[0] = value.real();
    out[stride] = value.imag();
    out += 2 * stride;
  }
}

}  // namespace

WhitenedResiduals::WhitenedResiduals(const ResponseMeasurement& measurement,
                                     const ResponseModel& model, const Eigen::VectorXd& theta,
                                     ParameterScale scale, ResidualKind kind)
    : measurement_(measurement),
      local_(model.linearise(measurement.position, theta)),
      scale_(scale),
      kind_(kind),
      parameter_count_(theta.size()) {
  local_->set_parameters(theta);
  const double weight = std::sqrt(2.0 * measurement.experiments);
  for (std::size_t f = 0; f < measurement.frequencies.size(); ++f) {
    const double w = measurement.frequencies[f];
    const bool closed_loop = kind == ResidualKind::kClosedLoop;
    ResponseNoise noise;  // as measured, or as predicted
    if (measurement.noise.empty() || closed_loop) noise = local_->noise(w);
    Weights weights;
    if (closed_loop) {
      weights.inverse_controller = model.inverse_controller(w);
      local_->evaluate(w, response_, nullptr);
      weights.right_scale = (noise.right * (response_ + weights.inverse_controller)).norm() /
                            std::sqrt(static_cast<double>(noise.right.rows()));
    }
    if (!measurement.noise.empty()) noise = measurement.noise[f];
    weights.left = weight * noise.left;
    weights.right = noise.right;
    weights_.push_back(std::move(weights));
  }
  set_num_residuals(2 * static_cast<int>(measurement.channel_count()));
  mutable_parameter_block_sizes()->push_back(static_cast<int>(parameter_count_));
}

bool WhitenedResiduals::Evaluate(double const* const* parameters, double* residuals,
                                 double** jacobians) const {
  theta_ = Eigen::Map<const Eigen::VectorXd>(parameters[0], parameter_count_);
  if (scale_ == ParameterScale::kLogarithmic) theta_ = theta_.array().exp();
  if (!theta_.allFinite()) return false;
  local_->set_parameters(theta_);
  double* jacobian = jacobians != nullptr ? jacobians[0] : nullptr;
  Eigen::Index row = 0;
  for (std::size_t f = 0; f < weights_.size(); ++f) {
    local_->evaluate(measurement_.frequencies[f], response_,
                     jacobian != nullptr ? &derivatives_ : nullptr);
    error_ = measurement_.responses[f] - response_;
    weigh(weights_[f]);
    write(residual_, residuals + row, 1);
    if (jacobian != nullptr) write_derivatives(jacobian + row * parameter_count_);
    row += 2 * error_.size();
  }
  return Eigen::Map<const Eigen::VectorXd>(residuals, row).allFinite();
}

// The residual, and the factors between which dG stands in its derivatives.
void WhitenedResiduals::weigh(const Weights& weights) const {
  left_ = weights.left;
  right_ = weights.right;
  if (kind_ == ResidualKind::kClosedLoop) {
    right_ = (response_ + weights.inverse_controller).inverse();  // T
    const Eigen::MatrixXcd relative = error_ * right_;            // E T
    residual_.noalias() = weights.right_scale * (weights.left * relative);
    left_.noalias() += weights.left * relative;
    right_ *= weights.right_scale;
  } else {
    residual_.noalias() = left_ * (error_ * right_);
  }
}

void WhitenedResiduals::write_derivatives(double* out) const {
  for (std::size_t p = 0; p < derivatives_.size(); ++p) {
    const auto index = static_cast<Eigen::Index>(p);
    const double chain = scale_ == ParameterScale::kLogarithmic ? theta_(index) : 1.0;
    residual_.noalias() =
        (-chain * (left_ * derivatives_[p].columns)) * (derivatives_[p].rows * right_);
    write(residual_, out + index, parameter_count_);
  }
}

}  // namespace graybox
