// What an engineer would say of a law at a place: "the gearbox of joint_3 hardens".
#pragma once

#include <string>

#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// "joint_3.gearbox" -> "the gearbox of joint_3"; names without a joint stay as they are.
[[nodiscard]] std::string place_words(const std::string& place);

// The sign of the leading parameter chooses between "hardens" and "softens". Laws that users have
// defined are called by their names.
[[nodiscard]] std::string law_sentence(const Hypothesis& hypothesis, const FittedLaw& law);

}  // namespace graybox
