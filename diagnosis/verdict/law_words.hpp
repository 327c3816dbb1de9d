// What an engineer would say of a law at a place: "the gearbox of joint_3 hardens".
#pragma once

#include <string>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// "joint_3.gearbox" -> "the gearbox of joint_3"; names without a joint stay as they are.
[[nodiscard]] std::string place_words(const std::string& place);

// The sign of the leading parameter chooses between "hardens" and "softens". Laws that users have
// defined are called by their names.
[[nodiscard]] std::string law_sentence(const Hypothesis& hypothesis, const FittedLaw& law);

// The same, where a negative stiffness has no spring of the model to make softer.
[[nodiscard]] std::string effect_sentence(const Hypothesis& hypothesis, const FoundEffect& effect);

// A static friction that the motion hardly reached: its error is as large as it, or as the whole
// way from the sliding level. Such a number is not printed.
[[nodiscard]] bool is_unseen_static_level(const FittedLaw& law,
                                          const LawParameterEstimate& estimate);

// What to record where this law may stand in the place of the one found; empty: nothing special.
[[nodiscard]] std::string advice_for(const Hypothesis& found, const Hypothesis& rival);

}  // namespace graybox
