// Kernels for avx2: 4 doubles a vector. The compiler flags of this file alone are in
// problems/CMakeLists.txt.
#include <cstddef>

#include "problems/kernels/kernels.hpp"

namespace graybox::kernels_avx2 {
namespace {

constexpr int kLanes = 4;
#include "problems/kernels/kernels_body.inc"

}  // namespace

extern const Kernels kTable;
const Kernels kTable = {"avx2", &price, &accumulate, &reweigh, &sum};

}  // namespace graybox::kernels_avx2
