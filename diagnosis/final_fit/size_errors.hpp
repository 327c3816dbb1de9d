// Standard errors of the sizes that a final fit found.
//
// They allow for residuals with memory and of changing size: H^-1 (sum over blocks g_b g_b') H^-1,
// g_b = J_b'r_b, never below those of white residuals. They don't see a bias: noise in what the
// filter starts from, or a law that is finer in the machine. So the fit is repeated over the next
// shorter windows, and what both differ by beyond their errors is added. Where more than 5 % of
// the signal is left, it is also begun with each law at 0.7 and 1.4 times its size: friction that
// sticks has many valleys. Errors are at least the distance to one that predicts as well.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/final_fit/last_fit.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"

namespace graybox {

// Standard errors of the free parameters, in their units, by one fit alone.
[[nodiscard]] Eigen::VectorXd deviations_of(const PredictionFit& fit);

// Those errors by slopes that are the median of three steps, at the weights of the last fit.
[[nodiscard]] Eigen::VectorXd steady_deviations(const LastFit& last, const PredictionFit& fit);

// Those of the model found, with what other windows disagree by.
[[nodiscard]] Eigen::VectorXd deviations_with_disagreement(const LastFit& last);

// What changes most surely of each law; none where all windows are whole recordings. By the fit's
// windows; where it runs free by shorter ones, since there what a parameter did early is still felt
// late.
[[nodiscard]] std::vector<LawTrend> size_trends(const LastFit& last);

}  // namespace graybox
