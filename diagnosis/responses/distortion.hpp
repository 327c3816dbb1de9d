// Tests whether a plant is linear, from the recordings of one frequency response.
//
// Detection lines. A periodic excitation leaves lines silent; a linear plant is silent there too.
// In closed loop the feedback brings what the plant adds back to its input, so the test is on
// Y_c = Y - G_hat U with G_hat interpolated between the excited neighbours. Per output i and line
// k, with n recordings, each of noise covariance Phi from its own q samples (line_spectra.hpp),
//
//   sum_e |Y_c,ie|^2 / (n Phi_hat_ii) ~ F(2 n, 2 q)                 where the plant is linear.
//
// Even lines answer to even non-linearity (play with a bias, gravity), odd lines to odd (friction,
// cubic stiffness). G_hat that is interpolated badly at a sharp resonance enlarges numerator and
// denominator alike.
//
// Realisations. Phi_total,ii / Phi_noise,ii ~ F(2 q_total, 2 q_noise) where nothing but noise
// differs between realisations with other phases.
//
// Many lines are tested, with overlapping bins: rejections are those of Benjamini and Yekutieli
// (2001), whose false discovery rate holds under any dependence.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/responses/frequency_response_estimate.hpp"
#include "diagnosis/signals/line_spectra.hpp"

namespace graybox {

// `spectra` of each recording at `lines`, outputs and then inputs first among the channels; lines
// lie between excited lines of the estimate.
[[nodiscard]] std::vector<DetectionLine> detect_distortion(
    const std::vector<const LineSpectra*>& spectra, const std::vector<std::size_t>& lines,
    const FrequencyResponseEstimate& estimate);

// P-values of total against noise covariance, n_y x lines; empty unless both are known.
[[nodiscard]] Eigen::MatrixXd total_over_noise(const FrequencyResponseEstimate& estimate);

// Which p-values are rejected at this false discovery rate.
[[nodiscard]] std::vector<bool> discoveries(const std::vector<double>& p_values, double rate);

}  // namespace graybox
