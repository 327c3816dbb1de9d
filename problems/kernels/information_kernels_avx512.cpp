// The information kernel for avx512: 8 doubles a vector. The compiler flags of this file alone are
// set by cmake/GrayboxKernels.cmake.
#include <cstddef>

#include "problems/kernels/information_kernels.hpp"

namespace graybox::information_avx512 {
namespace {

constexpr int kLanes = 8;
#include "problems/kernels/information_kernels_body.inc"

}  // namespace

extern const InformationKernel kKernel;
const InformationKernel kKernel = {"avx512", &information, &lines};

}  // namespace graybox::information_avx512
