// The picture of a law in a report. What the recordings ask for is drawn as points. The law is a
// line through them with a band: the rms distance of the points from it.
//
// The line is there where the law is a function of the axis alone. A friction over the deflection
// is drawn as points. The scale is that of the law and of 99 % of the recorded forces, so that no
// outlier sets it.
#pragma once

#include <string>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/report/svg_chart.hpp"

namespace graybox {

// Whether the law's force follows from the rate alone, or from the deflection alone.
[[nodiscard]] bool is_function_of_axis(const ForcePicture& picture, bool over_rate);

// Over the rate or the deflection.
[[nodiscard]] Chart law_chart(const ForcePicture& picture, const std::string& title,
                              bool over_rate);

}  // namespace graybox
