// Distance kernels for generic: 2 doubles a vector. The compiler flags of this file alone are in
// cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/distance_kernels.hpp"

namespace graybox::distance_kernels_generic {
namespace {

constexpr std::size_t kLanes = 2;
#include "solvers/kernels/distance_kernels_body.inc"

}  // namespace

extern const DistanceKernels kTable;
const DistanceKernels kTable = {&squared};

}  // namespace graybox::distance_kernels_generic
