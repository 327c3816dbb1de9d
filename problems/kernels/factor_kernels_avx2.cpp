// Factor kernels for avx2: 4 doubles a vector. The compiler flags of this file alone are in
// problems/CMakeLists.txt.
#include <cstddef>

#include "problems/kernels/factor_kernels.hpp"

namespace graybox::factor_kernels_avx2 {
namespace {

constexpr int kLanes = 4;
#include "problems/kernels/factor_kernels_body.inc"

}  // namespace

extern const FactorKernels kTable;
const FactorKernels kTable = {"avx2", &scratch_size, &price, &price_indexed};

}  // namespace graybox::factor_kernels_avx2
