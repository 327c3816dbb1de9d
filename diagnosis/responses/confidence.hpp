// Confidence regions of estimated frequency responses, and the tests that use them. Covariances are
// themselves estimated, with q complex degrees of freedom; a chi-square region would be too small
// (with q = 6 and n_y = 4 outputs it misses the truth more than half the time at a nominal 5 %).
// For the error E = G_hat - G with Cov vec(E) = gram^T (x) Phi and an independent estimate Phi_hat
// (frequency_response_estimate.hpp):
//
//   one entry    |E_ij|^2 / (gram_jj Phi_hat_ii)                    ~ F(2, 2 q)
//   one row      E_i gram^-1 E_i^H / (n_u Phi_hat_ii)               ~ F(2 n_u, 2 q)
//   one column   (q - n_y + 1) / (q n_y) E_j^H Phi_hat^-1 E_j / gram_jj   ~ F(2 n_y, 2 (q - n_y +
//   1)) all          T = tr(Phi_hat^-1 E gram^-1 E^H)                   ~ b F(2 n_y n_u, D), about
//
// The first three are exact (complex Hotelling). The last is the complex form of the
// Lawley-Hotelling trace with McKeon's (1974) approximation: b and D give T its first two moments.
// With m = n_u, p = n_y, c = q - p and a complex Wishart matrix of q degrees of freedom,
//
//   E T   = q p m / c,
//   E T^2 = q^2 [m^2 (c p^2 + p) + m p (c + p)] / (c (c^2 - 1)),
//
// (from E W^-1_ij W^-1_kl = (c d_ij d_kl + d_il d_kj) / (c^3 - c)). It is exact for m = 1 and for
// p = 1, and needs q > n_y + 1.
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "diagnosis/responses/frequency_response_estimate.hpp"

namespace graybox {

// Radius of the disc about G_hat_ij that holds G_ij with this probability, for every entry of line
// k, n_y x n_u, by the best covariance.
[[nodiscard]] Eigen::MatrixXd confidence_radius(const FrequencyResponseEstimate& estimate,
                                                std::size_t line, double probability);

// The statistic T of an error of the size n_y x n_u.
[[nodiscard]] double response_statistic(const OutputCovariance& covariance,
                                        const Eigen::MatrixXcd& input_gram,
                                        const Eigen::MatrixXcd& error);

// P(T > statistic) where the model is true. Throws InputError for q <= n_y + 1.
[[nodiscard]] double response_tail(double statistic, std::size_t outputs, std::size_t inputs,
                                   double degrees_of_freedom);
// The T that is exceeded with probability 1 - `probability`.
[[nodiscard]] double response_threshold(double probability, std::size_t outputs, std::size_t inputs,
                                        double degrees_of_freedom);

}  // namespace graybox
