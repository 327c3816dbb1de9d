// Places that users add to those where missing physics is looked for, in a file:
//
//   format: graybox-places/1
//   places:
//     - {kind: element, between: [first, third]}                      # of a lumped model
//     - {kind: element, deflection: {motor: 1, load: -50}}            # through a gear of ratio 50
//     - {kind: element, joint: joint_5, axis: motor, driven_by: {joint: joint_2, axis: motor}}
//
// Each is what `location` of an element may be in a model of that format (element.hpp).
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "diagnosis/hypotheses/candidate_place.hpp"

namespace graybox {

// Appends those of a file, and returns them. Throws InputError of one line, also for a place that
// is there already, the other way round or not, and for laws of other signals (driven_by: {input:
// ...}).
std::span<CandidatePlace> add_places(const std::filesystem::path& file, const Places& model,
                                     std::vector<CandidatePlace>& places);

}  // namespace graybox
