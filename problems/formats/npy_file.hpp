// Information sets as NumPy arrays (numpy.save): [Q x d x d] full symmetric matrices, or [Q x p]
// packed lower triangles (packed_matrix.hpp). C and Fortran order, little-endian float64 and
// float32. C-ordered float64 [Q x p] goes from the file straight into the set's own array; other
// layouts pass through a buffer of at most a few megabytes.
//
// Format: numpy.lib.format, versions 1.0 to 3.0.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// Any array, as stored: values in the order of the file.
struct NpyArray {
  std::vector<std::size_t> shape;
  bool fortran_order = false;
  std::vector<double> values;
};

// Little-endian float64 and float32. Throws InputError for a file that is no such array, or is
// truncated.
[[nodiscard]] NpyArray read_npy_array(const std::string& path);

// What is said of an array that holds no information set, in a file or in memory.
[[nodiscard]] std::string wrong_dtype(const std::string& source, std::string_view dtype);
// d of an array of this shape, or throws InputError.
[[nodiscard]] std::size_t dimension_of_shape(const std::string& source,
                                             const std::vector<std::size_t>& shape);

// Throws InputError for a file that is no such array.
[[nodiscard]] InformationSet read_npy(const std::string& path);

// The same of factors: [Q x d] of rank one, or [Q x k x d] (information_set.hpp).
[[nodiscard]] InformationSet read_npy_factors(const std::string& path);

// Writes [Q x p], C order, float64. Coordinates and names are not kept.
void write_npy(const std::string& path, const InformationSet& set);

}  // namespace graybox
