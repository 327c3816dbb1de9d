// A model that was fitted for what is reported, with its errors, and an error on recordings kept
// out.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct JudgedModel {
  PredictionFit fit;
  Eigen::Index horizon = 0;    // of the errors; 0: free run
  Eigen::VectorXd deviations;  // of the free parameters, in their units; NaN: not seen
  Eigen::VectorXd error;       // rms by output, recordings of the fit
  std::optional<Eigen::VectorXd> held_out_error;
  std::string
      held_out_trouble;  // why what was kept out has no error; empty: it has, or nothing was
  // rms of the outputs kept out about their means. What stands still there within its noise has no
  // signal of its own: then that of the fit.
  Eigen::VectorXd held_out_scale;
  std::vector<bool> stands_held_out;  // of each output
};

// An error on recordings kept out, so far ahead.
struct HeldOutError {
  Eigen::Index horizon = 0;  // samples
  Eigen::VectorXd error;     // rms by output
};

// rms over outputs of errors over their scales.
[[nodiscard]] double relative_size(const Eigen::VectorXd& error, const Eigen::VectorXd& scale);

}  // namespace graybox
