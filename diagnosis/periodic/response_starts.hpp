// Starts for the fit of periodic recordings where the model's own values are off: parameters whose
// linear plants come closest to the measured frequency responses, all resonances blunted.
//
// Resonances and antiresonances are narrower than the error of the start, so that G_hat - G as a
// function of the parameters is rugged. Compared is instead
//
//   phi(g) = g / (m^2 + |g|^2)^(1/2),
//
// element by element; m is the level of |g_hat| against frequency, a straight line on logarithmic
// scales. Between a measured resonance and the model's, phi differs by a phase of up to pi, so that
// the sum of squares grows with their distance wherever they are. Gauss, Newton, Levenberg and
// Marquardt from the model's values; while the rest is large, from others about them too. Then
// there are several minima, where two springs have changed places or one has hardly any effect, and
// physics that the model lacks may make a wrong one the least: all that are not much worse are
// starts.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"

namespace graybox {

// The best first. None where sub-experiments are missing or no parameter is free.
[[nodiscard]] std::vector<Eigen::VectorXd> response_starts(const PlantFamily& family,
                                                           const PeriodicData& data, int threads);

}  // namespace graybox
