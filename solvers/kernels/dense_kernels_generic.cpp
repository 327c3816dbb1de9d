// Dense kernels for generic: 2 doubles a vector; flags in cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/dense_kernels.hpp"

namespace graybox::dense_kernels_generic {
namespace {

constexpr int kLanes = 2;
#include "solvers/kernels/dense_kernels_body.inc"

}  // namespace

extern const DenseKernels kTable;
const DenseKernels kTable = {"generic", &price_indexed,  &whiten,          &gram,
                             &cholesky, &cholesky_solve, &subtract_product};

}  // namespace graybox::dense_kernels_generic
