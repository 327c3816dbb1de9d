// The stiffness of a robot from the spectral lines of periodic recordings themselves: where the fit
// of frequency responses goes on.
//
// Responses are freed of leakage by local polynomials. These cost noise (half as much again and
// more) and do not follow modes that are sharper than the bins. And Y U^-1 takes what noise makes
// of the inputs, by way of the controller, for excitation. Here the model itself takes out free
// motion and feedback (periodic/cleared_fit.hpp); what is left is
//
//   chi_square = sum over recordings and lines |Phi^-1/2 (Y - y(U; theta))|^2,
//
// y the steady state, of the linear plants or of the full robot (PlantKind), images of the hold
// included. Phi is estimated between the lines, with q degrees of freedom; the covariance of
// theta_hat is widened by kappa(q) of maximum_likelihood.hpp.
//
// Cost: local, some seconds for 100 recordings; full, a minute or so.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/response_fits/maximum_likelihood.hpp"

namespace graybox {

struct LineFitOptions {
  double noise_samples = 200.0;  // q, at least
  int threads = 1;
  std::function<bool()> keep_going{};
};

struct LineFit {
  FitResult fit;  // theta relative to the file's stiffness; kFailed: nothing settled near the start
  double noise_samples = 0.0;  // q
};

// Near `start`. `data` need no whitening where they have bins between their lines; they are
// cleared.
[[nodiscard]] LineFit fit_lines(const PlantFamily& family, const Eigen::VectorXd& start,
                                const LineFitOptions& options, PeriodicData& data);

// How well theta explains records of cleared data. Chi-square over its expectation, numbers +
// `expected_excess`.
[[nodiscard]] FitQuality line_fit_quality(const PlantFamily& family, const Eigen::VectorXd& theta,
                                          const PeriodicData& data,
                                          const std::vector<MeasuredRecord>& records,
                                          double expected_excess, int threads);

// J^T J of records at theta.
[[nodiscard]] Eigen::MatrixXd line_fit_information(const PlantFamily& family,
                                                   const Eigen::VectorXd& theta,
                                                   const PeriodicData& data,
                                                   const std::vector<MeasuredRecord>& records,
                                                   int threads);

}  // namespace graybox
