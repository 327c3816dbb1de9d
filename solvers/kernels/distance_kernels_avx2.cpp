// Distance kernels for avx2: 4 doubles a vector. The compiler flags of this file alone are in
// cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/distance_kernels.hpp"

namespace graybox::distance_kernels_avx2 {
namespace {

constexpr std::size_t kLanes = 4;
#include "solvers/kernels/distance_kernels_body.inc"

}  // namespace

extern const DistanceKernels kTable;
const DistanceKernels kTable = {&squared};

}  // namespace graybox::distance_kernels_avx2
