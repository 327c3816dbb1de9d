// The maximum-likelihood estimate of the parameters of a gray-box model from frequency responses
// measured in several positions: formula (7) of the paper,
//
//   theta_hat = arg min_theta  sum_i m_i vec(E_i)^H Lambda_i^-1 vec(E_i),
//   E_i = G_hat_i - G_i(theta),
//
// by Ceres (Levenberg and Marquardt) with exact derivatives. G_hat_i is the mean of the m_i
// experiments of position i.
//
// Whitening. With Lambda^-1 in Kronecker form (response_measurement.hpp) the residuals are the real
// and imaginary parts of sqrt(2 m) left E right, so that
//
//   half their squared sum       = -log likelihood + const,
//   J^T J                      = H = sum_i m_i 2 Re{Psi_i* Lambda_i^-1 Psi_i^T}  formulas (4), (5),
//   their squared sum chi_square ~ chi-square with 2 (channels x frequencies) - d degrees of
//   freedom
//
// where the model is true: a fit brings along its covariance H^-1 (the Cramer-Rao bound (3)) and a
// test of itself.
//
// Estimated Lambda. Where Phi_v is an estimate with q complex degrees of freedom, weights that err
// cost precision although they are unbiased. Take p = n_y outputs and a complex Wishart matrix W.
// Then E W^-1 = I / (q - p) and E W^-2 = q I / ((q - p)^3 - (q - p)) (Maiwald and Kraus 2000). So
// the covariance of the gradient is not H but
//
//   S = sum kappa J^T J,   kappa = q (q - p) / ((q - p)^2 - 1),   and   Cov theta_hat = H^-1 S H^-1
//
// to first order: kappa = 1.34 for q = 24 and six outputs, 1 where Lambda is known.
//
// What is held. Operating points, and Lambda where a measurement has none of its own, come from the
// model at the current theta. They are held while Ceres minimises and renewed afterwards, until
// theta moves by less than `tolerance` standard errors; the fixed point has both at theta_hat.
//
// Local minima. Resonances are narrow in frequency (damping 0.2 to 1 %), so E as a function of
// theta is rugged, and a start 40 % off leads nowhere. The controller damps them: under feedback
// the input follows the reference by T(theta) = (G + F^-1)^-1, smooth in theta. A first stage
// therefore minimises
//
//   |sqrt(2 m) s left E T(theta)|^2 = |sqrt(2 m) s left (I - (G_hat + F^-1) T(theta))|^2,
//   d(E T) = -(I + E T) dG T,
//
// which is linear in the noise of G_hat and equals (7) to first order at the truth, with T(theta)
// in place of the held `right` = s T of formula (12). Its estimate is slightly biased, for T(theta)
// also weighs the noise, and only serves as the start of (7). It is regularised by a normal prior
// about the start, of relative deviation `start_spread`: what is known before the first experiment.
// While the chi-square of this stage is rejected, it is tried from further starts drawn from that
// prior.
//
//   const RobotResponseModel model(robot);
//   const FitResult fit = fit_maximum_likelihood(model, measurements, start);
//   if (fit.status == FitStatus::kConverged && fit.lack_of_fit() < 4.0) use(fit.theta);
//
// Cost of one step of Ceres: about 40 us for each position and frequency of the robot (12
// parameters, 36 channels) on one thread; 10 steps from nearby, 30 to 100 from far.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "diagnosis/response_fits/response_measurement.hpp"
#include "diagnosis/response_fits/response_model.hpp"

namespace graybox {

enum class ParameterScale : std::int8_t {
  kLogarithmic,  // the fit works in log theta: all theta stay positive
  kLinear,       // theta of any sign
};

struct FitOptions {
  ParameterScale scale = ParameterScale::kLogarithmic;
  // Done when the last renewal moved theta by at most this many standard errors,
  // (delta^T H delta)^(1/2) <= tolerance.
  double tolerance = 1e-3;
  int renewal_limit = 20;
  int iteration_limit = 100;  // of Ceres, for each renewal
  // From a start near the truth the closed-loop stage is not needed; without feedback
  // (ResponseModel::inverse_controller) it is left out.
  bool closed_loop_stage = true;
  // Relative standard deviation of the start: of log theta, or of theta over |start| (over 1 where
  // the start is zero) in the linear scale.
  double start_spread = 0.4;
  int starts = 8;          // of the closed-loop stage, at most
  std::uint64_t seed = 1;  // of the starts after the first
  int threads = 1;         // the result depends on it in the last digits only
};

enum class FitStatus : std::int8_t {
  kConverged = 0,
  kIterationLimit = -1,  // the renewals did not settle; theta is the last
  kSingular = -2,        // the data do not see some combination of parameters: no covariance
  kFailed = -3,          // no operating point, or no finite response, at the start or on the way
};
[[nodiscard]] std::string_view to_string(FitStatus status);

struct FitResult {
  FitStatus status = FitStatus::kFailed;
  Eigen::VectorXd theta;
  Eigen::MatrixXd information;  // H at theta, by theta itself in either scale
  Eigen::MatrixXd covariance;   // H^-1 S H^-1; empty where H is singular or the fit failed
  double chi_square = 0.0;
  std::size_t degrees_of_freedom = 0;
  int iterations = 0;  // of Ceres, all stages
  int renewals = 0;
  int starts = 0;  // of the closed-loop stage

  // (chi_square - dof) / sqrt(2 dof): about standard normal where the model is true.
  [[nodiscard]] double lack_of_fit() const;
  [[nodiscard]] Eigen::VectorXd standard_errors() const;
};

// Throws InputError for measurements that do not fit the model (sizes, numbers that are not
// finite), fewer measured numbers than parameters, a start of the wrong length or not positive in
// the logarithmic scale, and options out of range.
[[nodiscard]] FitResult fit_maximum_likelihood(const ResponseModel& model,
                                               std::span<const ResponseMeasurement> measurements,
                                               const Eigen::VectorXd& start,
                                               const FitOptions& options = {});

// J^T J of the measurements at theta, by theta: H of any model, data and theta. Throws InputError
// where the model can't be linearised there.
[[nodiscard]] Eigen::MatrixXd information_at(const ResponseModel& model,
                                             std::span<const ResponseMeasurement> measurements,
                                             const Eigen::VectorXd& theta);

// kappa of weights that are estimated with q degrees of freedom.
[[nodiscard]] double weights_widening(double degrees_of_freedom, Eigen::Index outputs);

// H S^-1 H, the information that estimated weights leave: the inverse of the covariance where there
// is one, else H.
[[nodiscard]] Eigen::MatrixXd effective_information(const FitResult& fit);

}  // namespace graybox
