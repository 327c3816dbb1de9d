// Writes one recording as columns with names: HDF5 (one dataset a channel, attribute sample_time)
// or CSV (time first).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace graybox {

struct RecordedChannel {
  std::string name;
  std::string unit;
  Eigen::VectorXd values;
};

// The ending .h5 or .csv decides. Written in full or not at all; throws InputError if that fails.
// All channels have the same length. HDF5 must not be called from two threads at a time.
void write_recording(const std::filesystem::path& file, double sample_time,
                     const std::vector<RecordedChannel>& channels);

}  // namespace graybox
