// What a controller made of noise and free motion, taken out of the lines (transients.hpp).
#pragma once

#include <vector>

#include "diagnosis/free_motion/free_records.hpp"

namespace graybox {

// After the free motion itself. The residual stays what it is, also where the model is not linear.
// Does nothing where the model has no controller. Throws Stopped.
void take_out_feedback(const FreeMotionFrame& frame, const FreeRecords& free);

}  // namespace graybox
