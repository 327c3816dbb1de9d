// All channels of the real recordings (docs/how_to/recordings.md, GRAYBOX_RECORDINGS), as they were
// recorded, for the calibration of detectors.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace graybox::testing {

struct RecordedChannel {
  std::string set;  // folder
  std::string file;
  std::string column;
  double sample_time;  // s
  bool is_position;    // measured, at even times
  Eigen::VectorXd values;
};

// Columns of more than 500 samples with more than 16 levels that are no times. Empty where the
// environment names no folder.
[[nodiscard]] const std::vector<RecordedChannel>& recorded_channels();

}  // namespace graybox::testing
