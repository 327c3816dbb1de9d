// What a fitted model leaves of periodic recordings, for the report. There are spectra of each
// output, measured, left and noise, of one recording of the fit and one kept out, and one period in
// time.
//
// The recordings shown are those with the most signal above the noise in that channel, whatever the
// model, so that fits before and after an extension are seen on the same ones.
#pragma once

#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Rms of lines, (2/N)^(1/2) |Y|, in the unit of the output. Channels in their order, each first
// of the fit, then kept out; then the period of the first channel.
[[nodiscard]] std::vector<ResidualCurve> residual_spectra(const PlantFamily& family,
                                                          const PeriodicData& data,
                                                          const ModelState& model);

}  // namespace graybox
