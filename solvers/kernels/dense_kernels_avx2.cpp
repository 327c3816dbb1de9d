// Dense kernels for avx2: 4 doubles a vector; flags in cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/dense_kernels.hpp"

namespace graybox::dense_kernels_avx2 {
namespace {

constexpr int kLanes = 4;
#include "solvers/kernels/dense_kernels_body.inc"

}  // namespace

extern const DenseKernels kTable;
const DenseKernels kTable = {"avx2",    &price_indexed,  &whiten,          &gram,
                             &cholesky, &cholesky_solve, &subtract_product};

}  // namespace graybox::dense_kernels_avx2
