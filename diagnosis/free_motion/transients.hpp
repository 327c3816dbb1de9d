// The free motion that periodic recordings still hold, taken out with the model's own modes.
//
// A record of P periods of N samples begins in a state x_0 and ends in x_PN. For a sampled linear
// plant, x_{n+1} = A x_n + B u_n, y_n = C x_n, the spectra of all PN samples obey at each bin b,
// exactly,
//
//   Y = G(z) U + C (z I - A)^-1 z d + V,   G = C (z I - A)^-1 B,   z = e^(2 pi j b / (P N)),
//
// with one real vector d, (x_0 - x_PN) in the spectra's scale (Pintelon and Schoukens 2012, Section
// 6.3.2). Between the lines of the period, b not a multiple of P, there is nothing periodic. These
// bins give d by weighted least squares, and what is left there is noise. A ridge is added: a
// departure of the size of the periodic motion is expected, so that what no output sees stays
// small. A polynomial over a few bins (line_spectra.hpp) needs no model. But it does not follow a
// mode that is sharper than the bins, nor G between them. Where the model is known well enough this
// is exact and leaves neighbouring lines independent. It costs 2 n real numbers a record instead of
// a third of the noise's.
//
// Laws of the model that are forces act on these motions as they are if they are linear (a mode is
// a coordinate more), else by their mean slopes. The model's own forces (PlantFamily::own_force),
// and laws without memory beyond their mean slopes, do not. The part f(q_periodic + q_free) -
// f(q_periodic) falls on the lines as well where a free motion and a periodic one multiply. It is
// taken out with the free motion.
//
// Under a controller, U = F (R - Y), noise and free motion come back in the inputs,
//
//   U = T (R - V - C (z I - A)^-1 z d),   T = (G + F^-1)^-1,
//
// near a resonance as large as what is excited there. Y - G U is V all the same, but everything
// that is judged by it (derivatives, motions that laws act on) would go with V. Its products with V
// do not average out: estimates would be biased by up to 10 standard errors, and errors 30 % too
// small. What came back is taken out of the lines. T (V + C (z I - A)^-1 z d) is added to U, and
// what the model makes of it to Y. V is limited to what noise may be, for it may be physics that
// the model leaves out. F is that of the model; nothing is done without one.
//
// These forces and the free motion are brought to agree by substitution, then by Anderson's mixing
// of its steps: near a mode that is hardly damped a small change of the one is a large one of the
// other. Where 30 steps are not enough, the one that changed least stays; what is left then counts
// as misfit. Laws that are not linear count beyond their mean slopes only where less is left
// between the lines so: a law may bend the motion so much that no substitution leads anywhere.
//
// The cost is O(n^3) once and O(B n (n + n_y)) a record for B = P (K + 1) bins and n coordinates.
// It is O(B n_y n^2) for d, and some thousand evaluations of the own forces a step: four steps for
// most records.
#pragma once

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"

namespace graybox {

// Takes free motion and feedback out of the lines of all records, states what error that leaves
// (MeasuredRecord::common_error), and replaces the whitening by that of the noise between the
// lines. Records of a single period stay as they are. Results do not depend on the threads.
void clear_transients(const PlantFamily& family, const ModelState& model,
                      const PeriodicDataOptions& options, PeriodicData& data);

}  // namespace graybox
