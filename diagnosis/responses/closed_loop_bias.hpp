// The bias of Y U^-1 where the input carries noise that is correlated with that of the output, as
// under feedback.
//
// One input. U = U_0 + N, Y = G U + V, (N, V) circular complex normal, V = C N + rest independent of
// N, C = E V N* / E |N|^2. The mean of 1/(U_0 + z) over a circle |z| = r is 1/U_0 for r < |U_0| and
// 0 beyond, so E 1/U = (1 - exp(-|U_0|^2 / E|N|^2)) / U_0 and
//
//   E G_hat - G = C E N/U = C (1 - U_0 E 1/U) = C exp(-|U_0|^2 / E|N|^2),
//
// exactly (Pintelon and Schoukens 2012, section 2.4, give it in other form). It dies faster than any
// power of the signal-to-noise ratio. Under feedback u = F (r - y), C = -(G + F^-1): where noise
// dominates, G_hat tends to -F^-1, the inverse of the controller instead of the plant.
//
// Several inputs. With A = Phi_N^(-1/2) U_0 = sum_i s_i x_i y_i^H, Phi_N the covariance of N's columns
// and C = Phi_VN Phi_N^-1,
//
//   E G_hat - G = C Phi_N^(1/2) [sum_i b_i x_i x_i^H] Phi_N^(-1/2),   b_i = E exp(-s_i^2 |w_i|^2),
//
// w the unit vector orthogonal to the other columns of A + noise (apply the case above along w). With
// |w_i|^2 = 1 / (1 + t c), t ~ Gamma(n_u - 1), c the mean of 1/(s_l^2 + 1) over l != i, this is one
// integral; exact for n_u = 1, within 10 % for two inputs of equal strength (tests).
//
// This is for periodic excitation, where averages over P periods are taken before the quotient, so
// that s_i^2 grows with P. Quotients of power spectra (local_polynomial.hpp) have the larger bias
// C Phi_N (U_0 U_0^H + Phi_N)^-1, which falls only with the signal-to-noise ratio of each bin.
#pragma once

#include <Eigen/Core>

namespace graybox {

// b for singular values s (of A), each >= 0.
[[nodiscard]] Eigen::VectorXd quotient_bias(const Eigen::VectorXd& singular_values);

// E G_hat - G, n_y x n_u. `input_power` is U U^H as measured, of which the part of the noise,
// n_u Phi_N, is taken off; `samples` are of the noise of one column, outputs over inputs, at least as
// many as inputs (fewer, or inputs without noise, give zero).
[[nodiscard]] Eigen::MatrixXcd closed_loop_bias(const Eigen::MatrixXcd& response,
                                                const Eigen::MatrixXcd& input_power,
                                                const Eigen::MatrixXcd& samples);

}  // namespace graybox
