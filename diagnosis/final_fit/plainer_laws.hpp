// Laws of a final fit that change: for a plainer one that does as well, for another place, or for a
// rival that holds on recordings kept out.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/final_fit/last_fit.hpp"

namespace graybox {

// Hypotheses that may be one with this law in what is measured. These are the same law at other
// places, and lateness at other signals, where the model has none.
[[nodiscard]] std::vector<std::size_t> places_elsewhere(const LastFit& last,
                                                        std::size_t hypothesis);

// The model refitted with a weight in place of a spring; unusable where none can be.
[[nodiscard]] JudgedModel fit_with_weight_for_spring(const LastFit& last, std::size_t law);

// Moves laws to where they fit better, and says whether one moved. Over the short horizons of the
// search few channels may not tell where a law is. The long ones of the last fit may.
[[nodiscard]] bool take_better_places(LastFit& last);

// Takes plainer laws where these do as well, and says whether one changed. Friction of two levels
// may be one of one level, and a spring with a clearance one without.
[[nodiscard]] bool take_plainer_laws(LastFit& last);

}  // namespace graybox
