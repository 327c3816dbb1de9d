// Small dense linear algebra for the working sets of a few dozen candidates. The calls are too
// small for a BLAS (a call costs more than the work), so they are written out. They are compiled
// for each vector width and chosen at run time like problems/kernels/kernels.hpp. Nothing
// allocates.
#pragma once

#include <cstddef>

namespace graybox {

struct DenseKernels {
  const char* name;

  // tr(W H) for the candidates listed: out_k = sum_j dual_j data[indices_k * packed_size + j].
  void (*price_indexed)(const double* data, const std::size_t* indices, std::size_t count,
                        std::size_t packed_size, const double* dual, double* out);

  // B_k = X H_i X^T, i = members_k, for packed lower triangular X (d x d) and packed matrices in
  // `rows`. Each B_k is a row of `out` (stride doubles apart) in packed order with entries off the
  // diagonal multiplied by sqrt(2), so that out_k . out_l = tr(B_k B_l). The traces are traces_k =
  // tr B_k. The tail of each row up to `stride` is zeroed. scratch: 8 d (d + 1) doubles. 2 d^3 / 3
  // multiply-adds.
  void (*whiten)(const double* rows, const std::size_t* members, std::size_t count,
                 std::size_t dimension, const double* x, double* out, std::size_t stride,
                 double* traces, double* scratch);

  // Lower triangle of rows rows^T for n rows of `stride` doubles (a multiple of 8), column-major
  // with leading dimension n.
  void (*gram)(const double* rows, std::size_t n, std::size_t stride, double* out);

  // In-place Cholesky factor of the lower triangle of a column-major n x n matrix. False where a
  // pivot is not above `smallest_pivot`. What stands above the diagonal is left alone.
  bool (*cholesky)(double* matrix, std::size_t n, double smallest_pivot);

  // Solves L L^T x = b in place.
  void (*cholesky_solve)(const double* factor, std::size_t n, double* b);

  // out -= A x for a symmetric A, of which the lower triangle is read, column-major n x n.
  void (*subtract_product)(const double* matrix, std::size_t n, const double* x, double* out);
};

[[nodiscard]] const DenseKernels& dense_kernels();

}  // namespace graybox
