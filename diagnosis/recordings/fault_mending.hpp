// Samples that can't be data are left out before anything is computed from a recording, and it is
// said: one spike in a position, differentiated twice, hides the physics of a whole recording.
//
//   - Spikes of at most kLongestSpike samples in a row become the straight line between the samples
//     beside them. Longer ones are cut out.
//   - Where a measured position held its value and then jumped, all channels are cut out.
//   - Where a measured position jumps, the piece is cut in two.
//   - Times that jitter while the samples don't become even ones.
//
// Periodic recordings are not cut, for a period must stay whole. Nothing is cut where that would
// leave less than kLeastKept of the samples: then it is no fault of single samples. With
// `faulty_samples: keep` in campaign.yaml all samples are taken as they are.
#pragma once

#include <vector>

#include "diagnosis/recordings/data_faults.hpp"
#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {

inline constexpr Eigen::Index kLongestSpike = 3;  // samples
inline constexpr double kLeastKept = 0.8;

// `faults`: by piece. What was changed is among the remarks of `data`. Cost: O(samples).
void mend_faulty_samples(const std::vector<DataFaults>& faults, Signals& data);

}  // namespace graybox
