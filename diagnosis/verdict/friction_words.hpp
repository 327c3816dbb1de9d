// The friction that was found, told as its curve: numbers that can be checked at the machine.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

// A line for each place with dry friction whose velocity was recorded: the force of all frictions
// found there at 1 %, 10 % and all of the highest speed that was checked. The damping that the
// model of a single mass has itself is in the sum. Directions are told apart where they differ by
// more than 5 %. Places with friction that has a memory beyond Dahl's are left out.
//
//   Friction of the arm axis of elbow: 0.71 N m at 0.012 rad/s, 0.84 at 0.12, 2 at 1.2.
[[nodiscard]] std::vector<std::string> friction_lines(const Diagnosis& diagnosis,
                                                      std::span<const Hypothesis> hypotheses);

}  // namespace graybox
