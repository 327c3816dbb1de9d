// HessianAssembly: the p x p weighted Gram matrix over all candidates,
//
//   gram = sum_i s_i h_i h_i^T,
//
// h_i the packed row of candidate i. It is the one expensive step of an interior-point iteration on
// the paper's dual (10): linear in Q, about Q p^2 flops, one pass over the set. Register-tiled by
// hand for each vector width (kernels/gram_kernels.hpp), so that neither the cost nor the answer
// depends on how the BLAS at hand was built or threaded.
//
//   graybox::HessianAssembly assembly(set.packed_size(), /*threads=*/1);
//   assembly.assemble(set.data(), set.candidate_count(), scales, gram);   // gram: p * p numbers
//
// The answer does not depend on the number of threads. No allocation after construction.
#pragma once

#include <cstddef>
#include <span>

#include "problems/base/aligned_array.hpp"

namespace graybox {

class HessianAssembly {
 public:
  HessianAssembly(std::size_t row_size, int threads);

  // gram: row_size x row_size, row-major; its lower triangle is written, the rest left alone (to
  // column-major eyes, LAPACK's, it is the upper triangle). scales: `count` numbers of any sign.
  // False where time is up (stop.hpp); the array is then unfinished.
  bool assemble(const double* rows, std::size_t count, std::span<const double> scales,
                std::span<double> gram);

 private:
  void add(const double* rows, std::size_t count, const double* scales, std::span<double> gram);

  std::size_t row_size_;
  int threads_;
  AlignedArray workspace_;
};

}  // namespace graybox
