// Dense kernels for avx512: 8 doubles a vector; flags in cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/dense_kernels.hpp"

namespace graybox::dense_kernels_avx512 {
namespace {

constexpr int kLanes = 8;
#include "solvers/kernels/dense_kernels_body.inc"

}  // namespace

extern const DenseKernels kTable;
const DenseKernels kTable = {"avx512",  &price_indexed,  &whiten,          &gram,
                             &cholesky, &cholesky_solve, &subtract_product};

}  // namespace graybox::dense_kernels_avx512
