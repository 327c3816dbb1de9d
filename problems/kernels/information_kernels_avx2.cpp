// The information kernel for avx2: 4 doubles a vector. The compiler flags of this file alone are
// set by cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "problems/kernels/information_kernels.hpp"

namespace graybox::information_avx2 {
namespace {

constexpr int kLanes = 4;
#include "problems/kernels/information_kernels_body.inc"

}  // namespace

extern const InformationKernel kKernel;
const InformationKernel kKernel = {"avx2", &information, &lines};

}  // namespace graybox::information_avx2
