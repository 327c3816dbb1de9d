// Information sets as MATLAB files (versions 5, 7 and 7.3): a cell array of Q equal symmetric
// matrices, such as the authors' own covdata.mat with its cell Hi, or a numeric array d x d x Q.
// Full real double or single matrices.
#pragma once

#include <string>

#include "problems/files/reading_process.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {

// The child's part of read_mat: libhdf5 and matio run in a process of their own.
extern const ReadingTask kReadMat;

// `variable` names the variable to read; if empty, the only one that can be an information set is
// taken. Throws InputError if there is none or several (naming them), and for matrices that are
// unequal, not square or not symmetric.
[[nodiscard]] InformationSet read_mat(const std::string& path, const std::string& variable = {});

// Throws InputError for a truncated file of version 5 or 7, which matio would fill with zeros.
void require_complete_mat(const std::string& path);

// Writes the cell Hi [1 x Q], version 5, uncompressed; coordinates and names are not kept. Throws
// InputError above the format's limit of 2^31 bytes (version 5).
void write_mat(const std::string& path, const InformationSet& set);

}  // namespace graybox
