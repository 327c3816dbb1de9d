// The curves of a diagnosis over time as traces of a page: measured, predicted before the laws were
// found and after, recordings kept out first.
#pragma once

#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/report/trace.hpp"

namespace graybox {

// The rms of what is left where something is predicted, % of the standard deviation of what was
// measured.
[[nodiscard]] double curve_nrmse(const ResidualCurve& curve);

// The curve of the same channel, recording and axis; null if there is none.
[[nodiscard]] const ResidualCurve* same_curve(const std::vector<ResidualCurve>& curves,
                                              const ResidualCurve& wanted);

[[nodiscard]] std::vector<Trace> diagnosis_traces(const Diagnosis& diagnosis);

}  // namespace graybox
