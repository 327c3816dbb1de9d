// The picture of a law in a report. What the recordings ask for is drawn as points and as means
// with bars, the law as a line over them.
//
// The line and the means are there where the law is a function of the axis alone; a friction over
// the deflection is drawn as points. The scale is that of the law and of 99 % of the recorded
// forces, so that no outlier sets it.
#pragma once

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/verdict/svg_chart.hpp"

namespace graybox {

// Over the rate or the deflection.
[[nodiscard]] Chart law_chart(const ForcePicture& picture, const std::string& title,
                              bool over_rate);

}  // namespace graybox
