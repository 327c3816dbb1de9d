// Which coefficient changes while a system is recorded, if any does (time_variation.hpp has the
// test of each).
#pragma once

#include <cstddef>
#include <optional>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// The best of all coefficients at all places, if it is more than laws whose slopes vary may make of
// the free motion. The first `own_laws` of the model are its own. The gain, `gain`, is what the
// others lower the deviance by. The rest, `left`, is chi-square that no law explains, which may be
// such a force. A change whose force is less than a thousandth of those that act at its place is
// small: its p-value is one, however sure it is.
[[nodiscard]] std::optional<TimeVariation> find_time_variation(const PlantFamily& family,
                                                               const PeriodicData& data,
                                                               const ModelState& model,
                                                               std::size_t own_laws, double gain,
                                                               double left, int threads);

// Of forces that bend free motion.
[[nodiscard]] bool has_varying_slopes(const ActingLaw& law);

}  // namespace graybox
