// The readers behind read_recording_file, one a format (recording_file.hpp says what each takes).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "problems/files/reading_process.hpp"

namespace graybox::formats {

// Text tables and JSON come from the file, or from `text` where it was packed.
using PackedText = std::optional<std::string>;
[[nodiscard]] RecordingFile read_csv_recording(const std::string& path, PackedText text = {});
[[nodiscard]] RecordingFile read_npy_recording(const std::string& path);
[[nodiscard]] RecordingFile read_json_recording(const std::string& path, PackedText text = {});
[[nodiscard]] RecordingFile read_json_lines(const std::string& path, PackedText text = {});

// These call libhdf5 and matio, which a damaged file can crash or hang: in a process of their own,
// through read_isolated.
[[nodiscard]] RecordingFile read_hdf5_recording(const std::string& path);
[[nodiscard]] RecordingFile read_mat_recording(const std::string& path);

extern const ReadingTask kReadHdf5Recording;
extern const ReadingTask kReadMatRecording;
[[nodiscard]] RecordingFile read_isolated(const ReadingTask& task, const std::string& path);

// Adds an array as columns, or to the unclear arrays. `values` is row-major [rows x columns]; its
// transpose gives the same columns. `name` is empty for an array without one.
void add_array(const std::string& name, const std::string& unit, Eigen::Index rows,
               Eigen::Index columns, const double* values, RecordingFile& file);

}  // namespace graybox::formats
