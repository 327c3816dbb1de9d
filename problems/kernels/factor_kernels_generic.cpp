// Factor kernels for generic: 2 doubles a vector. The compiler flags of this file alone are in
// problems/CMakeLists.txt.
#include <cstddef>

#include "problems/kernels/factor_kernels.hpp"

namespace graybox::factor_kernels_generic {
namespace {

constexpr int kLanes = 2;
#include "problems/kernels/factor_kernels_body.inc"

}  // namespace

extern const FactorKernels kTable;
const FactorKernels kTable = {"generic", &scratch_size, &price, &price_indexed};

}  // namespace graybox::factor_kernels_generic
