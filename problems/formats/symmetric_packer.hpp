// SymmetricPacker: turns full square matrices from a file into packed lower triangles, block by
// block, so that a large file never stands in memory twice. Every matrix is checked:
//
//   |H_jk - H_kj| <= tolerance * sqrt(|H_jj H_kk|)
//
// (the bound that positive semidefinite matrices obey for |H_jk| itself, so the test does not
// depend on the units of the parameters); the packed value is the mean of the two. Throws
// InputError naming the file, the field, the candidate and the entry. Cost O(d^2) a matrix.
#pragma once

#include <cstddef>
#include <string>

#include "problems/base/aligned_array.hpp"

namespace graybox {

inline constexpr double kSymmetryTolerance = 1e-8;        // for data kept in 64 bits
inline constexpr double kSingleSymmetryTolerance = 1e-4;  // for data kept in 32 bits

// d with d (d + 1) / 2 = packed, or 0 if there is none.
[[nodiscard]] std::size_t dimension_from_packed_size(std::size_t packed);

class SymmetricPacker {
 public:
  // `source` begins the error messages: "file: field".
  SymmetricPacker(std::string source, std::size_t dimension, std::size_t count, double tolerance);

  // The next `count` full d x d matrices, contiguous, row- or column-major alike.
  void add(const double* full, std::size_t count);

  [[nodiscard]] AlignedArray take();  // all packed matrices, once every one was added

 private:
  void add_one(const double* full);

  std::string source_;
  std::size_t dimension_;
  double tolerance_;
  std::size_t next_ = 0;
  AlignedArray packed_;
};

// Throws InputError naming the first entry that is not finite: "file: field: candidate 3: ...".
void require_finite(const std::string& source, const AlignedArray& packed, std::size_t dimension);

}  // namespace graybox
