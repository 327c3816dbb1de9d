// Spectra of a periodic recording at lines of its period, freed of leakage, with samples of the
// noise that they carry.
//
// Why leakage matters although the excitation is periodic. P periods of N samples, DFT of all of
// them: the periodic part lies at the bins k P alone. Noise does not repeat, so what it left in the
// plant differs between the end and the beginning of the record, and for every pair of signals
//
//   Y(m) = G U(m) + V(m) + T(m),    T the transient: a rational function of frequency, smooth in m.
//
// For a motor, G falls as 1/w, Phi_v rises as w^2, and T is large: at 1 Hz the variance of Y - G U
// of the robot's 8 s records is a thousand times that of V. Averaging periods does not help (T
// falls no faster than V). T is therefore predicted at k P from the bins around it, which hold
// noise and transient only, and subtracted. This is the local polynomial method for periodic
// excitation (Pintelon, Vandersteen, Schoukens and Rolain 2011); order 1 with one bin on each side
// is the Hann window:
//
//   X(k P) <- X(k P) - s^T x,   x the bins k P + o,  o = the 2 n_b nearest not divisible by P,
//   s the weights by which least squares on 1, o, ..., o^R predicts the value at o = 0.
//
// The part of x that no polynomial fits, x^T Q with Q^T Q = I, is noise alone. It has 2 n_b - R - 1
// samples that are independent, of the covariance that the spectrum has between channels. All are
// scaled by (1 + |s|^2)^(1/2) to the covariance of the corrected spectrum. Signals are treated
// alike, so that the samples of Y and U together give that of Y - G U, whatever feedback correlates
// them.
//
// Scale: DFT of one period (multisine.hpp) of the mean of the periods.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/signals/real_transform.hpp"

namespace graybox {

struct LeakageOptions {
  int order = 2;    // R, of the polynomial; even: at the same variance as order R + 1
  int samples = 1;  // 2 n_b - R - 1, at least: of the noise of each line and recording
};

struct PeriodicLayout {
  std::size_t period = 0;          // samples N
  std::size_t periods = 0;         // P
  std::vector<std::size_t> lines;  // of the period, 1 ... N/2 - 1
};

struct LineSpectra {
  Eigen::MatrixXcd values;                // channels x lines
  std::vector<Eigen::MatrixXcd> samples;  // of the noise of each line, channels x count; of one
                                          // period: channels x 0
  std::vector<std::vector<std::size_t>> bins;  // of all P periods, that the samples come from
};

// The whole record: `signals` is [samples x channels], of which the first transform.length() are
// used.
// Bins x channels.
[[nodiscard]] Eigen::MatrixXcd record_spectra(const Eigen::Ref<const Eigen::MatrixXd>& signals,
                                              RealTransform& transform);

// From the spectra of P periods of N samples. With one period there are neither samples nor a
// correction.
[[nodiscard]] LineSpectra line_spectra(const Eigen::MatrixXcd& spectra,
                                       const PeriodicLayout& layout, const LeakageOptions& options);

// The lines between the first and the last excited one that are not excited: what answers there is
// not linear, or noise.
[[nodiscard]] std::vector<std::size_t> detection_lines(const PeriodicLayout& layout);

}  // namespace graybox
