// What a reader is told of a finished diagnosis: what a force may be instead, what should be
// recorded, and in which units sizes are.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

// Marks stiffnesses at places where the model has no spring (FoundEffect::is_first_of_its_kind).
// Throws InputError for a model that can't be read.
void mark_first_springs(const std::filesystem::path& model, std::span<const Hypothesis> hypotheses,
                        Diagnosis& diagnosis);

// Has the test of rivals say what to record, by their laws. Stribeck's friction shows in slow
// motion.
void advise_on_rivals(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

// Adds a test that fails where laws are told and none is confirmed; the verdict then is `unknown`.
void require_confirmed_laws(Diagnosis& diagnosis);

// Says of each constant force on what turned or moved one way that it may be dry friction. Of what
// went one way at about one speed it says that a law of the position may be a change with time.
void tell_one_way_forces(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis);

// Says of inputs with flat tops, where laws were found, what these laws may stand in for.
void tell_clipped_inputs(std::span<const std::string> inputs, Diagnosis& diagnosis);

// Whether the model is a robot whose bodies tell the gains of its drives: sizes are in N m then.
[[nodiscard]] bool estimates_drive_gains(const std::filesystem::path& model);

// The unit in which forces are known: "mA" or "drive units" where one such unit stands for 1 N m or
// 1 N of every drive, because no gain is stated; else empty.
[[nodiscard]] std::string drive_unit_of(const Campaign& campaign);

// Names drives of which one recorded unit stands for 1 N m or 1 N, because their gain is not known:
// a sentence for those in one unit, by the columns that the user knows.
void tell_unknown_gains(const Campaign& campaign, Diagnosis& diagnosis);

}  // namespace graybox
