// Samples at other times than those recorded, by the cubic through the four nearest samples
// (Lagrange); pieces of two or three samples by their line or parabola. Where the cubic leaves the
// range of the four by more than a quarter of it, by the line through the two beside.
//
// Error, for a signal that is smooth over four steps h: at most 0.56/24 h^4 |x''''|, so it falls
// with the fourth power of the step. Noise passes through, at most 1.3 times as large. What the
// error is on given samples is told from the samples: each is left out and interpolated from its
// four neighbours, at twice the step, which has 7 to 16 times the error. An eighth of its rms over
// the time is stated, and half of it where a line is taken. Cost: O(samples).
#pragma once

#include <Eigen/Core>

#include "diagnosis/recordings/preprocess_data.hpp"

namespace graybox {

// `time` rises and has at least two values; `at` rises and lies within it.
[[nodiscard]] Eigen::VectorXd interpolated(const Eigen::Ref<const Eigen::VectorXd>& time,
                                           const Eigen::Ref<const Eigen::VectorXd>& values,
                                           const Eigen::Ref<const Eigen::VectorXd>& at);

// Nothing is interpolated across a step longer than that: three times what 19 in 20 of these steps
// are at most. A logger that writes in bursts has many long steps, and they are no gaps. 0 for no
// steps.
[[nodiscard]] double longest_step(const Eigen::Ref<const Eigen::VectorXd>& steps);

// rms error of interpolated() between these samples. 0 below five samples.
[[nodiscard]] double interpolation_error(const Eigen::Ref<const Eigen::VectorXd>& time,
                                         const Eigen::Ref<const Eigen::VectorXd>& values);

// The steps of campaign.hpp. Throw InputError: resample of even samples, at a step more than half
// longer than the recorded ones (their median and their mean: that would fold), advance of a
// periodic excitation or by more than a piece has. Each leaves a remark with its error.
void resample(const PreprocessData& context, const Resample& step);
void advance_channels(const PreprocessData& context, const Advance& step);

}  // namespace graybox
