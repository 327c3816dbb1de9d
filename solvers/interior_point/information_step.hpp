// InformationStep: what a step of the weights does to M, to its dual variable W and to the
// sensitivities tr(W B_i). It serves a primal Newton method (primal_newton.hpp), in the scaling of
// Nesterov and Todd. With dM = sum_i dlambda_i B_i,
//
//   dM~ = G^T dM G,   dW~ = E - dM~,   dW = G dW~ G^T = G E G^T - P dM P.
//
// Two passes over the rows, one for residual_traces(); no allocation after construction.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/interior_point/nesterov_todd.hpp"

namespace graybox {

class InformationStep {
 public:
  // Keeps references to both; `scaling` must be computed before the functions below are called.
  InformationStep(const NormalizedSet& normal, const NesterovTodd& scaling);

  // dW~ and dW for a step of the weights, and traces_i = tr(dW B_i).
  void compute(std::span<const double> weight_step, std::span<double> traces);
  [[nodiscard]] const Eigen::MatrixXd& scaled_w_step() const { return scaled_step_; }  // dW~
  [[nodiscard]] const Eigen::MatrixXd& w_step() const { return w_step_; }              // dW

  // traces_i = tr(G E G^T B_i): compute() for no step of the weights.
  void residual_traces(std::span<double> traces);

  // traces_i = tr(P dM P B_i) = (K dlambda)_i, which is compute() with E = 0 and the other sign;
  // leaves dW~ and dW undefined.
  void apply_hessian(std::span<const double> weight_step, std::span<double> traces);

 private:
  void scale_information_step(std::span<const double> weight_step);  // dM~ to scaled_step_
  void price_scaled_step(std::span<double> traces);                  // dW and traces from dW~

  const NormalizedSet& normal_;
  const NesterovTodd& scaling_;
  std::vector<double> packed_;
  Eigen::MatrixXd w_step_;
  Eigen::MatrixXd scaled_step_;
  Eigen::MatrixXd product_;
};

}  // namespace graybox
