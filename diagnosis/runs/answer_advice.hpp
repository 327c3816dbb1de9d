// What a finished diagnosis is still asked: can a machine be that, and what should be recorded?
#pragma once

#include <cstddef>
#include <filesystem>
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

// Joints, from 0, whose unknown rotor inertia the recordings do not show. Empty unless that alone
// keeps the answer from being sure. `graybox model` adds such inertias to robots.
[[nodiscard]] std::vector<std::size_t> rotors_to_leave_out(const Diagnosis& diagnosis);

// Has the test of rivals say what to record, by their laws. Stribeck's friction shows in slow
// motion.
void advise_on_rivals(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

}  // namespace graybox
