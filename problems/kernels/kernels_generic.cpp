// Kernels for generic: 2 doubles a vector. The compiler flags of this file alone are in
// problems/CMakeLists.txt.
#include <cstddef>

#include "problems/kernels/kernels.hpp"

namespace graybox::kernels_generic {
namespace {

constexpr int kLanes = 2;
#include "problems/kernels/kernels_body.inc"

}  // namespace

extern const Kernels kTable;
const Kernels kTable = {"generic", &price, &accumulate, &reweigh, &sum};

}  // namespace graybox::kernels_generic
