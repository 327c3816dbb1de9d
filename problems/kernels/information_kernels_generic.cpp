// The information kernel for generic: 2 doubles a vector. The compiler flags of this file alone are
// set by cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "problems/kernels/information_kernels.hpp"

namespace graybox::information_generic {
namespace {

constexpr int kLanes = 2;
#include "problems/kernels/information_kernels_body.inc"

}  // namespace

extern const InformationKernel kKernel;
const InformationKernel kKernel = {"generic", &information, &lines};

}  // namespace graybox::information_generic
