// WhitenedResiduals: the residuals of one measurement for Ceres, with exact derivatives, as defined
// in maximum_likelihood.hpp: for each frequency the entries of sqrt(2 m) left E right, column by
// column, each with its real and then its imaginary part.
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "diagnosis/response_fits/maximum_likelihood.hpp"

namespace graybox {

enum class ResidualKind : std::int8_t {
  kResponse,    // right is that of the noise, held
  kClosedLoop,  // right = s T(theta)
};

// The scale s of a closed loop is the one with which the model predicts its noise, right = s T; it
// is not taken from the measured G_hat, whose noise would enlarge it.
class WhitenedResiduals : public ceres::CostFunction {
 public:
  // Linearises the model at the measurement's position for this theta. Keeps a reference to the
  // measurement. Throws InputError where there is no operating point.
  WhitenedResiduals(const ResponseMeasurement& measurement, const ResponseModel& model,
                    const Eigen::VectorXd& theta, ParameterScale scale, ResidualKind kind);

  // parameters[0]: theta or its logarithm. Ceres evaluates a block in one thread at a time, so the
  // workspace may be the block's.
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  struct Weights {
    Eigen::MatrixXcd left, right;         // of the noise, times sqrt(2 m)
    Eigen::MatrixXcd inverse_controller;  // closed loop only, likewise:
    double right_scale = 1.0;             // s
  };

  void weigh(const Weights& weights) const;
  void write_derivatives(double* out) const;

  const ResponseMeasurement& measurement_;
  std::unique_ptr<LocalResponse> local_;
  ParameterScale scale_;
  ResidualKind kind_;
  Eigen::Index parameter_count_;
  std::vector<Weights> weights_;
  // What one frequency needs: E, the factors of the residual and of its derivatives.
  mutable Eigen::VectorXd theta_;
  mutable Eigen::MatrixXcd response_, error_, left_, right_, residual_;
  mutable std::vector<ResponseDerivative> derivatives_;
};

}  // namespace graybox
