// Does a law that was found hold on the average only? The test asks whether one of its parameters
// changes with the time, the position or the speed (law_trend.hpp).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"

namespace graybox {

// Only trends count that change a parameter by a tenth of the law's largest in that unit. The test
// fails where the most significant of them is 4.5 standard errors from none and takes 3 % of the
// signal: less of a rest that depends on the motion is let pass, too. The verdict is
// `unknown` where something changes with time. Else the law stands in for another one at its place
// (`ambiguous`). `trends`: of the effects found; none: not tested, for the reason `why_not`.
[[nodiscard]] VerdictReason trend_reason(std::span<const LawTrend> trends,
                                         std::span<const FoundEffect> effects, const char* why_not);

// Those of 4.5 standard errors, most significant first.
[[nodiscard]] std::vector<LawTrend> told_trends(std::span<const LawTrend> trends,
                                                std::span<const FoundEffect> effects);

// "level of coulomb at axis: about 8.7 N m where recordings begin, 5.2 where they end".
[[nodiscard]] std::string trend_words(const LawTrend& trend, std::span<const FoundEffect> effects);

}  // namespace graybox
