#include <fmt/format.h>
#include <fmt/ranges.h>

#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/base/error.hpp"
#include "problems/formats/npy_file.hpp"

namespace graybox::formats {

RecordingFile read_npy_recording(const std::string& path) {
  const NpyArray array = read_npy_array(path);
  if (array.shape.empty() || array.shape.size() > 2) {
    throw InputError(fmt::format("{}: shape ({}): expected one or two axes, samples and channels",
                                 path, fmt::join(array.shape, ", ")));
  }
  const auto rows = static_cast<Eigen::Index>(array.shape[0]);
  const auto columns =
      array.shape.size() == 2 ? static_cast<Eigen::Index>(array.shape[1]) : Eigen::Index{1};
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  // Fortran order is the row-major transpose, and add_array takes either.
  add_array("", "", array.fortran_order ? columns : rows, array.fortran_order ? rows : columns,
            array.values.data(), file);
  return file;
}

}  // namespace graybox::formats
