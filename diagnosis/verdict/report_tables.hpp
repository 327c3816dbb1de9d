// The tables of a report: reasons, laws, parameters, errors by channel, what was excluded.
#pragma once

#include <span>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox {

using Hypotheses = std::span<const Hypothesis>;

// The tests with values and limits, ticked or crossed; no rows where there are none.
[[nodiscard]] PageTable reasons_table(const Diagnosis& diagnosis);
// Each law found: its parameters with errors, whether a machine has them, and what it gained.
[[nodiscard]] PageTable laws_table(const Diagnosis& diagnosis, Hypotheses hypotheses);
// The model's own parameters before and after.
[[nodiscard]] PageTable parameters_table(const Diagnosis& diagnosis);
// Errors on the recordings of the fit and those kept out.
[[nodiscard]] PageTable errors_table(const Diagnosis& diagnosis);
// Errors of each channel, where the noise is not known.
[[nodiscard]] PageTable channels_table(const Diagnosis& diagnosis);
// All that was weighed against one law.
[[nodiscard]] PageTable rivals_table(const FoundEffect& effect, Hypotheses hypotheses,
                                     bool noise_is_known);
[[nodiscard]] PageTable rejected_table(const Diagnosis& diagnosis, Hypotheses hypotheses);
[[nodiscard]] PageTable detectable_table(const Diagnosis& diagnosis, Hypotheses hypotheses);

}  // namespace graybox
