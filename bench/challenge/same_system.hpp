// Which answers are one system: names that the recordings of a case in any motion can't tell apart.
//
//   late     a delay and a lag of a signal; where one sensor is all there is, at the actuator and
//            at that sensor alike
//   play     backlash of a spring and a spring with a clearance: either is the other beside another
//            spring of the model, which is fitted
//   force    any law at the motor and at the load behind a stiff shaft, where only one of them is
//            measured
//   offset   of the actuator and of the force at the mass that it drives; with one sensor of the
//            force at the load, too, whose share is a twist that nobody sees; and of a tachometer,
//            which by a bearing's damping is a constant force
//
// Which places go together is in the truth (CaseTruth::same_places, by these names); in the
// periodic set none do, and each law at each place is a system. An asymmetric dry friction is a dry
// friction and an offset at one place: score_challenge.hpp.
#pragma once

#include <string>

#include "bench/challenge/case_truth.hpp"

namespace graybox::bench {

// The same text for the same system.
[[nodiscard]] std::string system_of(const CaseTruth& truth, const std::string& place,
                                    const std::string& law);

}  // namespace graybox::bench
