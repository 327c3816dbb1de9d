// What a second look asks of an answer: can a machine be that, how far is it from an answer that
// stands, and what does it leave?
#pragma once

#include <optional>
#include <span>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Whether a machine can be what was fitted, its mass included. Noise that was differentiated makes
// masses of nothing.
[[nodiscard]] bool is_of_a_machine(const Diagnosis& diagnosis);

// How far a diagnosis is from an answer: the largest value over its limit of the tests that it
// failed. A test that counts is three limits off, and an answer without laws a thousand. Tests that
// leave the verdict at `ambiguous` count as one.
[[nodiscard]] double shortfall_of(const Diagnosis& diagnosis);

// The force that a diagnosis by prediction error leaves on recordings, % of the forces that act;
// none where the sensors' noise accounts for all.
[[nodiscard]] std::optional<double> force_left(const Diagnosis& diagnosis);

// What a balance of forces leaves, % of the force: on recordings kept out where there are any.
[[nodiscard]] double error_of_balance(const Diagnosis& diagnosis);

// Whether all that was found is what signals do (late, lagging), or something that swings beside
// the machine; false where nothing was.
[[nodiscard]] bool has_signal_laws_only(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses);

// Says of an answer that a second look came to no end: what that would have found is not known. The
// verdict is `unknown` then.
void tell_stopped(Diagnosis& diagnosis);

}  // namespace graybox
