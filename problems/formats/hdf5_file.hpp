// Information sets as HDF5, the format graybox writes by default:
//
//   /                 attributes  format = "graybox-information-set/1"
//                                 sha256 = InformationSet::content_hash(), hexadecimal
//   /information      float64 [Q x p]: packed lower triangles, the bytes of the array in memory
//   /factors          in place of /information: float64 [Q x d] or [Q x k x d], rows of F_i with
//                     H_i = F_i^T F_i (information_set.hpp); the hash is that of the matrices
//   /candidates       float64 [Q x n], attributes `names` and `units` (n strings each); absent if
//                     the candidates have no coordinates
//   /parameters       d strings; absent if the parameters have no names
//
// Reading is lenient where no doubt arises: `information` may also be [Q x d x d], 32-bit or
// chunked; sha256 and units may be missing. A hash that is there must match. Contiguous float64
// [Q x p] goes from the file straight into the set's own array. libhdf5 runs in a process of its
// own (reading_process.hpp): a damaged file can't crash or hang the caller.
#pragma once

#include <string>

#include "problems/files/reading_process.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {

// The child's part of read_hdf5 and read_hdf5_slice.
extern const ReadingTask kReadHdf5;

// Throws InputError for a file that is no such set.
[[nodiscard]] InformationSet read_hdf5(const std::string& path);

// One of `parts` contiguous slices of a set that no single process needs to hold: candidates
// total * part / parts up to total * (part + 1) / parts, without coordinates. The stored hash
// covers the whole and is passed on unchecked. Packed lower triangles [Q x p] or factors. Throws
// InputError as above, and for more parts than candidates.
struct InformationSlice {
  InformationSet set;
  std::size_t first;
  std::size_t total;
  std::string problem_hash;  // empty if the file has none
};
[[nodiscard]] InformationSlice read_hdf5_slice(const std::string& path, std::size_t part,
                                               std::size_t parts);

// Writes the file in full or not at all. Throws InputError if it can't be written.
void write_hdf5(const std::string& path, const InformationSet& set);

}  // namespace graybox
