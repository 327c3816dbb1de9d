// What is said of the floors of a design (efficiency_floor.hpp).
#pragma once

#include <span>
#include <string>

#include "solvers/floors/efficiency_floor.hpp"

namespace graybox::cli {

// One line each: what was asked, what is proven. `efficiencies`: of certify_floored(), or empty.
[[nodiscard]] std::string describe_floors(std::span<const EfficiencyFloor> floors,
                                          std::span<const double> efficiencies);

}  // namespace graybox::cli
