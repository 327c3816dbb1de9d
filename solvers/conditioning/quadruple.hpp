// Quadruple: a floating-point number with a significand of 113 bits, rounded to nearest as in IEEE
// 754, for the few sums that 64 bits do not settle (certificate.hpp). A multiplication takes about
// 50 ns.
#pragma once

#include <boost/multiprecision/cpp_bin_float.hpp>

namespace graybox {

using Quadruple = boost::multiprecision::cpp_bin_float_quad;

}  // namespace graybox
