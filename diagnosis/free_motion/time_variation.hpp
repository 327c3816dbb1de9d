// Whether a system changes while it is recorded: friction that warms up, a stiffness that swings.
//
// A coefficient at a place that is off by s(t) adds the force -b s(t) w(t), w = z (stiffness) or z'
// (damping), or s(t) w(t) to a signal w (gain). All models here do not depend on time, so that w
// has nothing but the lines k of the period. Over P periods T, with
//
//   s(t) = Re sum over m = 1 ... P - 1 of c_m e^(2 pi j m t / (P T)),
//
// the force lies at the bins between the lines of the spectra of all periods,
//
//   bin k P + m:  c_m W_k / 2,        bin k P - m:  conj(c_m) W_k / 2,
//
// where else there is only noise (transients.hpp takes the free motion out). Energy beside excited
// lines tells of time variation (Pintelon, Louarroudi and Lataire 2013); that it has the pattern of
// one place, at all lines and in all outputs, with few numbers c_m, tells where, far below what
// energy alone would.
//
// The score test of c = 0, one for each record: what is left between the lines against the 2 (P -
// 1) columns of a place. Chi-square with 2 (P - 1) degrees of freedom a record where the columns
// are independent. That the free motion was fitted to the same bins before lowers it: the level is
// held, not exactly met.
//
// Laws whose slopes vary meet the free motion as well, and what they make of it lies between the
// lines and dies away with it, like a change. It is a share of the free motion: `free_power` is
// what that had, to compare with.
//
// Cost: O(n^3) a bin of each plant, and O(B n_y) a place and record, for B bins.
#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {

enum class Coefficient : std::int8_t { kStiffness, kDamping, kGain };

struct VariationScore {
  const CandidatePlace* place = nullptr;
  Coefficient coefficient = Coefficient::kStiffness;
  double statistic = 0.0;
  double degrees_of_freedom = 0.0;
  // Rms of s over all records, less what noise adds. At least: free motion and noise were estimated
  // with the change.
  double deviation = 0.0;
  // The share of the change's force in the largest of those that act at the place: spring, damper,
  // inertia; the change itself for a gain.
  double force_share = 0.0;
  double free_power = 0.0;  // of the free motion between the lines of all records, in the noise's
  // Of the record that tells most:
  double duration = 0.0;       // P T, s
  double frequency = 0.0;      // m / (P T) of the largest c_m, Hz
  std::vector<double> course;  // s at equal steps through the record
};

// Tests all places of the family but couplings, sums and differences of places and the flange, over
// all records that were freed of free motion; empty without any. Not seen: what changes from record
// to record only, and, but for its edges, what changes as fast as the period or faster.
// Results do not depend on the threads.
[[nodiscard]] std::vector<VariationScore> variation_scores(const PlantFamily& family,
                                                           const PeriodicData& data,
                                                           const ModelState& model, int threads);

}  // namespace graybox
