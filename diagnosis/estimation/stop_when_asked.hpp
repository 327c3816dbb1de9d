// Ends a run of Ceres where stop.hpp says so: with the best parameters so far, not converged.
#pragma once

#include <ceres/iteration_callback.h>

#include "problems/base/stop.hpp"

namespace graybox {

class StopWhenAsked final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return stop_requested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
};

}  // namespace graybox
