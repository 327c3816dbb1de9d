// What a finished diagnosis is still asked: can a machine be that, and what should be recorded?
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Marks stiffnesses at places where the model has no spring (FoundEffect::is_first_of_its_kind).
// Throws InputError for a model that can't be read.
void mark_first_springs(const std::filesystem::path& model, std::span<const Hypothesis> hypotheses,
                        Diagnosis& diagnosis);

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
// Whether all that was found is what signals do (late, lagging), or something that swings beside
// the machine; false where nothing was.
[[nodiscard]] bool has_signal_laws_only(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses);

// Joints, from 0, whose unknown rotor inertia the recordings do not show. Empty unless that alone
// keeps the answer from being sure. `graybox model` adds such inertias to robots.
[[nodiscard]] std::vector<std::size_t> rotors_to_leave_out(const Diagnosis& diagnosis);

// Has the test of rivals say what to record, by their laws. Stribeck's friction shows in slow
// motion.
void advise_on_rivals(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

// Says of each constant force on what turned or moved one way that it may be dry friction.
void tell_one_way_forces(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

}  // namespace graybox
