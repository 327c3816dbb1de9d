// One frequency response from the recordings of one position and level under periodic excitation.
//
// Columns. Recording e gives columns Y_e, U_e (and R_e, references) of n_y x n, n_u x n, n_r x n
// matrices at each excited line, n = sub-experiments x realisations. The loop is linear, so that
//
//   Y = G U + V   exactly, whatever feedback made U of V: V is the plant's own output noise.
//
// Estimate. With any n x n_u matrix W such that U W = I,
//
//   G_hat = Y W,    G_hat - G = V W.
//
// One realisation, n = n_u: W = U^-1, the estimate Y U^-1 of the paper. More realisations: W =
// R^H (U R^H)^-1 where references are recorded (the joint input-output estimate: noise that
// feedback brings into U averages out before it is divided by), else the mean over realisations of
// U_m^-1.
//
// Error. Given U, Cov vec(V W) = [W^H W]^T (x) Phi_v exactly. Under feedback U depends on V: to
// first order in the noise, V W = V W_0, W_0 the noise-free one, so the same covariance holds with
// W_0; that of the measured U differs by the order of the noise-to-signal ratio. The bias is
// smaller still (closed_loop_bias.hpp).
//
// Noise covariance Phi_v from the noise samples of line_spectra.hpp, each y - G_hat u: noise on
// inputs and outputs and their correlation by feedback all count. Degrees of freedom: samples.
//
// Total covariance from the scatter of the columns over realisations. With A = I - W U, Y - G_hat U
// = V A, so Phi = (V A)(V A)^H / tr(A A^H). The degrees of freedom are (tr A A^H)^2 / tr (A A^H)^2
// (Satterthwaite; n - n_u for orthogonal multisines). It holds noise and what a non-linear plant
// adds that changes with the phases, taken as independent between recordings.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/responses/frequency_response_estimate.hpp"
#include "diagnosis/signals/line_spectra.hpp"

namespace graybox {

// Channels of `spectra`: outputs, then inputs, then references.
struct PeriodicRecord {
  std::size_t realisation = 1;
  std::size_t sub_experiment = 1;
  LineSpectra spectra;    // at the excited lines
  LineSpectra detection;  // at detection_lines()
};

struct PeriodicResponseOptions {
  // Complex degrees of freedom of covariances, at least, by pooling lines; 0: four times n_y, or 8.
  double degrees_of_freedom = 0.0;
};

// Fills what is estimated into `estimate`, which has its inputs, outputs, lines and frequencies.
// `references`: channels after inputs. Records are ordered by realisation, each with as many
// recordings. Throws InputError where the inputs of a line are not independent, naming `place`.
void estimate_periodic_response(const std::vector<const PeriodicRecord*>& records,
                                std::size_t references, const PeriodicResponseOptions& options,
                                const std::string& place, FrequencyResponseEstimate& estimate);

}  // namespace graybox
