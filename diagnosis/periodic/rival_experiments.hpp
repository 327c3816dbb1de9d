// What further periodic experiments would tell of two explanations (next_experiment.hpp).
//
// Options: each position of the campaign, at half, once and twice its largest level, with the whole
// band of its excitation or a third of it (on a logarithmic scale) with the same rms. The inputs
// are those that were recorded at that position, filtered and scaled: of a loop that has settled
// they follow the reference. With y_A and y_B the steady states of both explanations under such
// inputs (steady_state.hpp) and J the derivatives of y_A by all free parameters, whitened by the
// noise of the largest level,
//   M_i = [J  y_B - y_A]^T [J  y_B - y_A],   summed over the recordings of the position, times the
// positions' number, so that every option costs as many recordings as the campaign had.
//
// Cost: two steady states and one differentiation for each recording, level and band.
#pragma once

#include <optional>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/hypotheses/next_experiment.hpp"

namespace graybox {

// Both models evaluated with derivatives. None where the recordings determine no parameter.
[[nodiscard]] std::optional<RivalExperiments> rival_experiments(const PlantFamily& family,
                                                                const PeriodicData& data,
                                                                const ModelState& a,
                                                                const ModelState& b, int threads);

}  // namespace graybox
