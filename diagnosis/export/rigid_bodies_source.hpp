// The bodies of a robot in C99: recursive Newton and Euler (Luh, Walker and Paul 1980) over tables
// of the joints, as rigid_body_regressor.hpp has it.
//
//   static void rigid_bodies(const double position[N], const double velocity[N],
//                            const double acceleration[N], double force[N])
#pragma once

#include <string>

#include "diagnosis/export/exported_model.hpp"

namespace graybox {

// Of a model with a robot.
[[nodiscard]] std::string rigid_bodies_source(const ExportedModel& model);

}  // namespace graybox
