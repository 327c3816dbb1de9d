// The history of a run as JSON lines: seconds, passes, duality_gap, iteration.
#pragma once

#include <string>
#include <vector>

#include "solvers/core/solver.hpp"

namespace graybox::cli {

void write_trace(const std::string& path, const std::vector<TracePoint>& trace);

}  // namespace graybox::cli
