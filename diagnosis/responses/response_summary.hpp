// What there is to say about an estimated frequency response in one line.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "diagnosis/responses/frequency_response_estimate.hpp"

namespace graybox {

struct ResponseSummary {
  // 20 log10 of output level over the deviation of its noise (of the total where that alone is
  // known), over lines and outputs; none where neither is known.
  std::optional<double> median_signal_to_noise, least_signal_to_noise;  // dB
  std::optional<double> median_error;      // standard error of a row of G_hat over its length
  std::optional<double> total_over_noise;  // dB, median over lines and outputs; needs both
  // What silent lines answer beyond the noise, over the output at the excited lines: power summed
  // over the lines of each kind, the largest of the outputs, dB. None if there are no such lines,
  // or no answer.
  std::optional<double> odd_distortion, even_distortion;
  std::optional<double> largest_bias;    // by feedback, in standard errors
  std::optional<double> feedback_share;  // the largest of the lines
  double degrees_of_freedom = 0.0;       // of the best covariance, the least of the lines
};

[[nodiscard]] ResponseSummary summarise(const FrequencyResponseEstimate& estimate);

// Deviations of the noise of the output at each line, n_y x lines; empty if not known.
[[nodiscard]] Eigen::MatrixXd output_deviations(const std::vector<OutputCovariance>& covariance);

// Rms beyond the noise, at silent lines of one kind, of each output, about every excited line (from
// half way to the line before to half way to the next). It is NaN where there is none. The shape is
// n_y x lines.
[[nodiscard]] Eigen::MatrixXd distortion_levels(const FrequencyResponseEstimate& estimate,
                                                bool even);

}  // namespace graybox
