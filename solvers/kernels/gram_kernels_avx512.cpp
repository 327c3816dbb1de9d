// Gram kernels for avx512: 8 doubles a vector. The compiler flags of this file alone are in
// cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "solvers/kernels/gram_kernels.hpp"

namespace graybox::gram_kernels_avx512 {
namespace {

constexpr std::size_t kLanes = 8;
constexpr std::size_t kTileRows =
    12;  // 2 x 12 accumulators, and what they need, fill the registers
#include "solvers/kernels/gram_kernels_body.inc"

}  // namespace

extern const GramKernels kTable;
const GramKernels kTable = {&gram, &congruence};

}  // namespace graybox::gram_kernels_avx512
