// The bias of Y U^-1 where the input carries noise that is correlated with that of the output, as
// under feedback.
//
// One input. U = U_0 + N, Y = G U + V, (N, V) circular complex normal, V = C N + rest independent
// of N, C = E V N* / E |N|^2. The mean of 1/(U_0 + z) over a circle |z| = r is 1/U_0 for r < |U_0|
// and 0 beyond, so E 1/U = (1 - exp(-|U_0|^2 / E|N|^2)) / U_0 and
//
//   E G_hat - G = C E N/U = C (1 - U_0 E 1/U) = C exp(-|U_0|^2 / E|N|^2),
//
// exactly (Pintelon and Schoukens 2012, section 2.4, give it in other form). It dies faster than
// any power of the signal-to-noise ratio. Under feedback u = F (r - y), C = -(G + F^-1): where
// noise dominates, G_hat tends to -F^-1, the inverse of the controller instead of the plant.
//
// Several inputs. With A = Phi_N^(-1/2) U_0 = sum_i s_i x_i y_i^H, Phi_N the covariance of N's
// columns and C = Phi_VN Phi_N^-1,
//
//   E G_hat - G = C L,    L = Phi_N^(1/2) [sum_i b_i x_i x_i^H] Phi_N^(-1/2),   0 <= b_i <= 1.
//
// For Z of independent entries CN(0, 1) and X = A + Z, E Z X^-1 = sum b_i x_i x_i^H. By parts (E
// Z_ia g = E dg/d conj(Z_ia)) only the singular matrices X count, where conj-derivatives of 1/det X
// are delta functions. Let w be the left null vector of X. It is uniform on the sphere, weighed by
// the density of w^H X at 0 and by the mean squared minors of the rest, a non-central Wishart
// determinant. With it
//
//   b_i = n/n! E_p p_i exp(-sum_l p_l s_l^2) sum_m p_m sum_k (n-k)! e_k(s^2 without s_m^2),
//
// p_l = |w_l|^2 uniform on the simplex, e_k elementary symmetric polynomials. The means over the
// simplex are divided differences of the exponential (Hermite and Genocchi). These are entries of
// the exponential of a bidiagonal matrix (Opitz 1964), all of one sign. With n = 1 it is the
// formula above. Equal s give exp(-s^2) sum_k C(n-1, k) s^2k (n-k)!/n!. Tests compare it with Monte
// Carlo.
//
// What can be estimated. C and U_0 are not known. C' = Phi_yN Phi_N^-1 - G_hat comes from the noise
// that was measured. As G_hat = G + C L on average, it gives the bias C' L (I - L)^-1. U U^H - n_u
// Phi_N stands for U_0 U_0^H. Where b is near 1 the plant can't be told from its controller: b
// itself is the warning.
//
// This is for periodic excitation, where averages over P periods are taken before the quotient, so
// that s_i^2 grows with P. Quotients of power spectra (local_polynomial.hpp) have the larger bias
// C Phi_N (U_0 U_0^H + Phi_N)^-1, which falls only with the signal-to-noise ratio of each bin.
#pragma once

#include <Eigen/Core>

namespace graybox {

// b for the squares s^2 >= 0. Cost n^2 small matrix exponentials, but none where all s^2 > 60.
[[nodiscard]] Eigen::VectorXd quotient_bias(const Eigen::VectorXd& power);

struct ClosedLoopBias {
  Eigen::MatrixXcd bias;  // of G_hat, n_y x n_u
  double share = 0.0;     // the largest b: 0 no bias, 1 all of G_hat is that of the feedback
};

// `input_power` is U U^H as measured; `samples` are of the noise of one column, outputs over
// inputs, at least as many as inputs (fewer, or inputs without noise, give zero).
[[nodiscard]] ClosedLoopBias closed_loop_bias(const Eigen::MatrixXcd& response,
                                              const Eigen::MatrixXcd& input_power,
                                              const Eigen::MatrixXcd& samples);

}  // namespace graybox
