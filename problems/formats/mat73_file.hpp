// Information sets as MATLAB 7.3 files, which are HDF5 files: a cell array is a dataset of object
// references, each to the dataset of one matrix; the attribute MATLAB_class tells the kind. Read
// through HDF5 itself: matio takes time quadratic in the number of cells.
#pragma once

#include <string>

#include "problems/formats/stored_set.hpp"

namespace graybox {

// What read_mat (mat_file.hpp) makes of files of version 7.3; in the process that reads them.
[[nodiscard]] StoredSet stored_mat73(const std::string& path, const std::string& variable);

}  // namespace graybox
