// FrequencyResponseEstimate: the frequency response of one position and excitation level, estimated
// from recordings, with what is known of its error:
//
//   Cov vec(G_hat - G) = [W^H W]^T (x) Phi,      G_hat - G = V W,
//
// where the columns of V (one for each recording) are independent with covariance Phi, and W is how
// G_hat weighs them. W = U^-1 for the n_u sub-experiments of one realisation. This is the form
// Lambda = [(U U^H)^-1]^T (x) Phi_v of response_measurement.hpp (vec stacks columns). Only W^H W
// counts; it is kept as `input_gram`.
//
// Two covariances, two questions:
//   noise   what would change if the same references were applied again: for the test whether the
//           plant is linear;
//   total   what would change with other random phases: noise and non-linear distortion. For fits
//           and for confidence regions of the best linear approximation. Needs realisations.
// Both are estimates themselves and carry their complex degrees of freedom q: q Phi_hat ~ complex
// Wishart. Regions and tests that use them are in confidence.hpp: a chi-square would be too tight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/response_fits/response_measurement.hpp"
#include "diagnosis/signal_faults/finding.hpp"

namespace graybox {

enum class ResponseMethod : std::int8_t { kPeriodic, kLocalPolynomial };
[[nodiscard]] std::string_view to_string(ResponseMethod method);

// Phi of one column of V.
struct OutputCovariance {
  Eigen::MatrixXcd covariance;      // n_y x n_y
  double degrees_of_freedom = 0.0;  // q, complex
  std::size_t pooled_lines = 1;     // over so many neighbouring lines
};

// A line that was not excited, and how the outputs answer there (distortion.hpp). Levels are rms
// over the recordings, in the unit of each output and the DFT scaling of multisine.hpp.
struct DetectionLine {
  std::size_t line = 0;
  double frequency = 0.0;   // rad/s
  Eigen::VectorXd level;    // of Y - G_hat U, noise included
  Eigen::VectorXd noise;    // of it, as expected
  Eigen::VectorXd p_value;  // small where the plant is not linear

  [[nodiscard]] bool even() const { return line % 2 == 0; }
};

struct FrequencyResponseEstimate {
  ResponseMethod method = ResponseMethod::kPeriodic;
  std::vector<double> position;  // degrees; empty for a lumped model
  double level = 0.0;
  std::size_t realisation = 0;               // 0: all of them together
  std::size_t realisations = 0;              // M
  std::size_t recordings = 0;                // columns of V
  std::size_t periods = 0;                   // P; 0: not periodic
  std::size_t period = 0;                    // samples; 0: not periodic
  double sample_time = 0.0;                  // s
  InputHold hold = InputHold::kZero;         // what inputs did between samples: G_hat includes it
  std::vector<std::string> inputs, outputs;  // channels
  std::vector<std::string> input_units, output_units;

  std::vector<std::size_t> lines;            // of one period; empty if not periodic
  std::vector<double> frequencies;           // rad/s
  std::vector<Eigen::MatrixXcd> responses;   // G_hat, n_y x n_u
  std::vector<Eigen::MatrixXcd> input_gram;  // W^H W, n_u x n_u
  std::vector<OutputCovariance> noise;       // empty: not known (one period)
  std::vector<OutputCovariance> total;       // empty: not known (one realisation)
  // By feedback (closed_loop_bias.hpp); empty: not known. E G_hat - G, n_y x n_u, and how much of
  // G_hat is that of the feedback, 0 to 1.
  std::vector<Eigen::MatrixXcd> bias;
  std::vector<double> feedback_share;
  Eigen::MatrixXd output_level;  // rms of |Y| over the recordings, n_y x lines
  Eigen::MatrixXd
      nonlinearity_p_value;  // total against noise (distortion.hpp), n_y x lines; or empty
  std::vector<DetectionLine> detection;
  std::vector<Finding> findings;

  // Total where it is known, else noise. Throws InputError where neither is.
  [[nodiscard]] const std::vector<OutputCovariance>& best_covariance() const;
  // E |G_hat_ij - G_ij|^2 at line k by that covariance, n_y x n_u.
  [[nodiscard]] Eigen::MatrixXd variance(std::size_t line) const;
};

enum class CovarianceKind : std::int8_t { kBest, kNoise, kTotal };

// For a fit. Its noise factors whiten by the estimated covariance, scaled by ((q - n_y) / q)^(1/2)
// because E Phi_hat^-1 = q / (q - n_y) Phi^-1. Weighted sums of squares then have the mean that
// they would have with Phi itself, and H = J^T J that of the information. A covariance of lower
// rank is raised to 1e-26 of the output's power (noise-free simulations). Throws InputError where
// the covariance is not known or q <= n_y + 1.
[[nodiscard]] ResponseMeasurement response_measurement(const FrequencyResponseEstimate& estimate,
                                                       CovarianceKind kind = CovarianceKind::kBest);

}  // namespace graybox
