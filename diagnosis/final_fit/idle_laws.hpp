// Laws that a final fit drops again: what the search found on one rung and the whole does not bear
// out, and what has no size that the recordings tell.
#pragma once

#include "diagnosis/final_fit/last_fit.hpp"

namespace graybox {

// Drops what the search found on one rung and neither that rung bears out beside the others nor the
// whole, the least missed first: what it stood in for may then fall to the others. A long run says
// little of a law whose force a disturbance hides: there the errors add up.
void drop_idle_laws(LastFit& last);

// Drops a law whose every size is smaller than its error, or a wave that is not told from none.
// Whether one went.
[[nodiscard]] bool drop_undetermined_law(LastFit& last);

// Whether a size of the law is told from none.
[[nodiscard]] bool is_told(const PredictionFit& fit, const PlacedFinding& law);

// The model refitted without one of its laws. Where it left its valley, over longer and longer
// windows again.
[[nodiscard]] JudgedModel refitted_without(const LastFit& last, const PlacedFinding& law);

}  // namespace graybox
