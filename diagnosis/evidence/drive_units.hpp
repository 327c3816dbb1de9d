// Words for a machine whose drives' gains are not known: each force is then a number of the drive's
// own unit, mA say, and so are masses, springs and dampings but for lengths and times. A text in
// N m would state what nobody measured.
//
//   N m -> mA,   N m/rad -> mA/rad,   N m s/rad -> mA s/rad,   kg m^2 -> mA s^2/rad,
//   N -> mA,     N/m -> mA/m,         N s/m -> mA s/m,         kg -> mA s^2/m
//
// Files for programs (verdict.json, model_extended.yaml) keep N m, as the model has it.
#pragma once

#include <string>

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

// The text with all units of forces in `unit`; an empty unit leaves it.
[[nodiscard]] std::string in_drive_unit(std::string text, const std::string& unit);

// The diagnosis, for texts and pictures: its units, and the sentences in it.
[[nodiscard]] Diagnosis in_drive_unit(Diagnosis diagnosis, const std::string& unit);

}  // namespace graybox
