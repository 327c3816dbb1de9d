// The extended model: the model file with the parameters that were estimated and the elements that
// were found, a model like any other.
//
// The text is the original's as YAML (comments are lost), with
//   - estimated parameters in place of the model's: "joint_2.gearbox" of a robot (the spring's
//     stiffness; an estimate without unit multiplies it), "shaft.stiffness" or "motor.inertia" of a
//     lumped model, "friction.damping" of an element. Base parameters of a rigid robot stand in the
//     list `base_parameters`: no body has just these, so that its bodies stay unknown;
//   - the found elements behind the list `elements`, laws that users have defined in `laws`;
//   - relative paths (urdf) leading to where they did.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/search/diagnosis_search.hpp"

namespace graybox {

// The file's text for the place `target`. Throws InputError where an estimate has no place in the
// model.
// A lumped model's only input whose force was recorded earlier than its motion (`late`) gets a
// delay.
[[nodiscard]] std::string extended_model_text(const std::filesystem::path& model,
                                              const std::filesystem::path& target,
                                              const ExtendedFit& fit,
                                              std::span<const Hypothesis> hypotheses,
                                              std::span<const LateChannel> late = {});

// The same of a fit: its values, and the elements of the graybox-physics/1 files that were fitted
// with the model.
[[nodiscard]] std::string fitted_model_text(const std::filesystem::path& model,
                                            const std::filesystem::path& target,
                                            const FitReport& report,
                                            std::span<const std::filesystem::path> physics);

// The found elements alone, a graybox-physics/1 file.
[[nodiscard]] std::string physics_text(const ExtendedFit& fit,
                                       std::span<const Hypothesis> hypotheses);

}  // namespace graybox
