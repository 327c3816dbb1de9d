// A model's inverse dynamics as one file of C99 that needs math.h and nothing else, for
// feed-forward:
//
//   void NAME_force(const double position[N], const double velocity[N],
//                   const double acceleration[N], double force[N]);
//
// The force along each coordinate that this motion takes. Every law is a function of a few lines,
// with its parameters and their units. Beside it
//
//   NAME_command   lumped models: what to ask of each input, with the laws of its actuator undone
//   NAME_motors    robots with gears: the motors' torques, N^-T f
//
// Cost of a call: O(n) for the bodies of a robot of n joints, and one evaluation a law.
#pragma once

#include <string>

#include "diagnosis/export/exported_model.hpp"

namespace graybox {

// `name`: letters, digits and _, a letter first. Throws InputError for laws that have no closed
// force (require_closed_forces), and for a name that is none.
[[nodiscard]] std::string c_function(const ExportedModel& model, const std::string& name);

// The file's name without folder and ending, with _ for what C does not take.
[[nodiscard]] std::string c_name_of(const std::filesystem::path& file);

}  // namespace graybox
