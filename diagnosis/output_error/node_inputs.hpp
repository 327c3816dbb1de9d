// Inputs between samples: what an integrator of step h = T_s/m sees of a recorded input at the
// beginning, the middle and the end of each of its steps.
//
//   zero          u(t) = u_k within sample k
//   first         straight from u_k to u_(k+1)
//   band_limited  the sinc series, cut off after 24 samples either side by a Kaiser window (beta =
//                 8): gain within 1e-4 of one up to 0.9 of the Nyquist frequency. Beyond the ends
//                 the record goes on as its odd reflection.
//
// Delays shift the input: u(t - tau). A held input then jumps within a step. Its three values are
// those of the parabola with the same integrals against 1, t and t^2. So what a smooth system
// answers is right to third order in h and smooth in tau.
#pragma once

#include <Eigen/Core>

#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

struct NodeInputs {
  int steps_per_sample = 1;
  Eigen::MatrixXd nodes;    // channels x 3 steps: values of step s in columns 3s, 3s + 1, 3s + 2
  Eigen::MatrixXd slopes;   // d nodes / d tau of that channel; empty unless asked for
  Eigen::MatrixXd samples;  // channels x samples: at the samples themselves
  Eigen::MatrixXd sample_slopes;  // like slopes

  void drop_samples(Eigen::Index first);  // so many, at the beginning
};

// `values`: samples x channels. `delays`: of each channel in samples, at least 0; empty: none.
// `before`: what a held input was before the record, by channel; empty, or another hold: its first
// value.
[[nodiscard]] NodeInputs node_inputs(const Eigen::MatrixXd& values, InputHold hold,
                                     int steps_per_sample, const Eigen::VectorXd& delays = {},
                                     bool with_slopes = false, const Eigen::VectorXd& before = {});

}  // namespace graybox
