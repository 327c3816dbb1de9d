// Waves that the thinned recordings of a search are too coarse for.
#pragma once

#include "diagnosis/final_fit/last_fit.hpp"

namespace graybox {

// Adds at most two waves that are in the force that the whole recordings leave. They are weighed
// over short windows, where a wave costs most, and stay where they predict better, on what was kept
// out, too.
void add_short_ripples(LastFit& last);

}  // namespace graybox
