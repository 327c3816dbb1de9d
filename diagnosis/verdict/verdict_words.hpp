// A diagnosis in words that an engineer would use, from its numbers alone.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/search/diagnosis_search.hpp"

namespace graybox {

// "cubic spring at joint_3.gearbox".
[[nodiscard]] std::string hypothesis_words(const Hypothesis& hypothesis);
// "1.9e+09 +- 0.1e+09 N m/rad^3": value and standard error to the same digit,
// two digits of the error.
[[nodiscard]] std::string estimate_words(const LawParameterEstimate& estimate);
// "level of coulomb at axis 0.43 ± 0.01 N m instead of 0.63 ± 0.03 N m"
[[nodiscard]] std::string changed_size_words(const Diagnosis& diagnosis, const ChangedSize& size,
                                             std::span<const Hypothesis> hypotheses);

// "in position [0, 30, -60] at level 3 from 1 to 10 Hz".
[[nodiscard]] std::string experiment_words(const ExperimentOption& option);

// By the limits that a fit's rest must keep where the noise is not known (SearchOptions).
[[nodiscard]] bool is_more_than_noise(const ChannelRest& rest);

// ", 0.3 s ahead", of errors that are those of predictions so far ahead; empty: whole recordings.
[[nodiscard]] std::string ahead_words(const ExtendedFit& fit);

// The verdict in one sentence.
[[nodiscard]] std::string headline(const Diagnosis& diagnosis);

// What to record to tell two explanations apart.
[[nodiscard]] std::string next_experiment_words(const NextExperiment& next,
                                                const std::string& what = "the two apart");

// One sentence a line: the verdict, each effect with its parameters and rivals, the fit before and
// after, what could not be seen.
[[nodiscard]] std::vector<std::string> verdict_words(const Diagnosis& diagnosis,
                                                     std::span<const Hypothesis> hypotheses);

// What the framed cells of the map of what is left mean beside the test of all that is left: both
// can be true. Empty where no cell is framed.
[[nodiscard]] std::string map_words(const Diagnosis& diagnosis);

}  // namespace graybox
