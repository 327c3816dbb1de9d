// A fit of periodic recordings, and of their free motion with it.
//
// Lines hold free motion of the plant beside the answer to their excitation. The fitted model takes
// it out (transients.hpp), which moves the fit, and so on until it rests. Free motion that stays in
// (polynomials do not follow modes that are sharper than the bins) makes estimates scatter more
// than the noise does, and biases them.
#pragma once

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/periodic/periodic_fit.hpp"

namespace graybox {

struct ClearedFit {
  PeriodicFit fit;
  int rounds = 0;
  double moved = 0.0;  // largest change of a parameter in the last round, in standard errors
};

// Begins with `near`, a fit that is close (its parameters and laws will do), and ends when a round
// moves no parameter by more than `at_rest` standard errors, after ten at the latest. Lines and
// whitening of `data` are those of the last round afterwards.
[[nodiscard]] ClearedFit fit_and_clear_transients(const PlantFamily& family,
                                                  const PeriodicFit& near,
                                                  const PeriodicDataOptions& options,
                                                  const PeriodicFitOptions& how, double at_rest,
                                                  PeriodicData& data);

}  // namespace graybox
