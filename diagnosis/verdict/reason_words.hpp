// The reasons of a verdict, what was rejected and the range that all was checked in: in words and
// as JSON (verdict_file.hpp has the keys).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

// One line each, with the next step where it failed.
[[nodiscard]] std::vector<std::string> reason_lines(const Diagnosis& diagnosis);

// "Tried and rejected: ...", one line each.
[[nodiscard]] std::vector<std::string> rejected_lines(const Diagnosis& diagnosis,
                                                      std::span<const Hypothesis> hypotheses);

// What of the stated model is off, where it was given some freedom; else empty.
[[nodiscard]] std::vector<std::string> freed_model_lines(const Diagnosis& diagnosis);

// What a law does to recordings kept out, one sentence; empty where it could not be asked.
[[nodiscard]] std::string held_out_words(const FoundEffect& effect, const Diagnosis& diagnosis);

// "Checked on ...: velocity of carriage -0.2 to 0.2 m/s, ...; nothing is said beyond." Empty where
// it is not known.
[[nodiscard]] std::string range_words(const CheckedRange& range);

[[nodiscard]] nlohmann::ordered_json reasons_json(const Diagnosis& diagnosis);
[[nodiscard]] nlohmann::ordered_json rejected_json(const Diagnosis& diagnosis,
                                                   std::span<const Hypothesis> hypotheses);
// null where the model stands as stated.
[[nodiscard]] nlohmann::ordered_json freed_model_json(const std::optional<FreedModel>& model);
[[nodiscard]] nlohmann::ordered_json range_json(const CheckedRange& range);

}  // namespace graybox
