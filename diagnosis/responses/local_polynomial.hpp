// The local polynomial method: a frequency response from recordings that need not be periodic
// (Schoukens, Vandersteen, Barbe and Pintelon 2009; Pintelon, Schoukens, Vandersteen and Barbe
// 2010), for n_u inputs from one record or several.
//
// The DFT of a record of any kind obeys Y(k) = G U(k) + T(k) + V(k), T the leakage of the ends of
// the record. About bin k, G and T are polynomials of order R in the offset o, |o| <= n:
//
//   Y_e(k+o) = sum_r [G_r U_e(k+o) + T_e,r] o^r + V_e(k+o),      G_0 = G(k), e = 1 ... E records,
//
// (R + 1)(n_u + E) unknowns for each output from E (2 n + 1) bins, by least squares over the
// columns of Y: G_hat = Y W with W = the n_u columns of K^H (K K^H)^-1 that belong to G_0. So
//
//   Cov vec(G_hat - G) = [W^H W]^T (x) Phi_v,
//   Phi_v from the residuals, q = E (2 n + 1) - (R + 1)(n_u + E) complex degrees of freedom.
//
// n is the smallest that gives the q asked for. What a polynomial of order R can't follow within
// 2 n + 1 bins is bias: a resonance must be wider than the window. Estimates at bins more than 2 n
// apart are independent.
//
// Feedback. U then contains noise, and least squares tends to
//
//   G_hat -> G + S_vu S_uu^-1,    under u = F (r - y):  G - Phi_v (Phi_r + Phi_v)^-1 (G + F^-1),
//
// which is -F^-1 where noise dominates, however long the record. (u = S (r - v), S = (F^-1 +
// G)^-1.) Where the records bring n_u references, the joint input-output estimate is used instead.
// It is the method from r to (y, u), then G_hat = G_ry G_ru^-1, which has no such bias. To first
// order in the noise its error is (N_y - G N_u) W G_ru^-1, with W that of r.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "diagnosis/responses/frequency_response_estimate.hpp"

namespace graybox {

struct LocalPolynomialOptions {
  int order = 2;                    // R
  double degrees_of_freedom = 0.0;  // q, at least; 0: four times n_y, or 8
  double from = 0.0;                // Hz; 0: the lowest bin whose window fits
  double to = 0.0;                  // Hz; 0: the highest
  std::size_t count = 50;           // frequencies, log-spaced, each at its nearest bin once
  bool joint = true;                // joint input-output where there are n_u references
};

// Fills what is estimated into `estimate`, which has its inputs, outputs and sample_time:
// frequencies, responses, input_gram, noise, output_level. `records`: spectra (record_spectra()) of
// as many samples each, channels: outputs, inputs, references. Throws InputError, naming `place`,
// for records too short, inputs that do not vary independently, and frequencies out of range.
void estimate_local_polynomial(const std::vector<Eigen::MatrixXcd>& records, std::size_t samples,
                               std::size_t references, const LocalPolynomialOptions& options,
                               const std::string& place, FrequencyResponseEstimate& estimate);

}  // namespace graybox
