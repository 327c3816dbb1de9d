// Sizes that hold only if a plain force is absent. The inertia of an axis that only ever slows down
// evenly is another beside a weight. The damping of one that turns at one speed is another beside
// dry friction.
//
// The model found is fitted again beside each constant force, weight, dry and viscous friction that
// it lacks. None of them gained enough to be found. A parameter is told where its value beside such
// a force is other by a fifth, or uncertain by half, and that is five of its own standard errors.
// Source: omitted variables (Theil, Review of the International Statistical Institute 25, 1957).
// Cost: a few fits for each mass. Recordings of more than 4000 samples are not asked.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/prediction_verdict/prediction_outcome.hpp"

namespace graybox {

// One sentence for each such parameter; of an axis that moves at one speed, one that says so.
[[nodiscard]] std::vector<std::string> confounded_sizes(const PredictionOutcome& from);

}  // namespace graybox
