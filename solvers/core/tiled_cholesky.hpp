// Cholesky factors and Gram matrices of large arrays on several threads, with the same bits for any
// number of them. The arrays are cut into tiles whose size depends on nothing. Each tile is changed
// by one thread at a time in a fixed order, and BLAS works on single tiles. (A threaded BLAS sums
// in an order that depends on its threads; commands give it one, see pin_threads.hpp.)
//
// Arrays are those of lapack.hpp: column-major, of which the lower triangle is used. n^3/3 and k
// n^2 flops. Between tiles both ask stop.hpp, and are unfinished where it says so.
#pragma once

#include <cstddef>

namespace graybox {

// A = L L^T in place; false where A is not positive definite (or holds a NaN), or time is up.
[[nodiscard]] bool factorise_cholesky_tiled(std::size_t n, double* a, int threads);

// Lower triangle of the n x n array c := A^T A for a column-major k x n array A. False where time
// is up.
[[nodiscard]] bool gram_tiled(std::size_t n, std::size_t k, const double* a, double* c,
                              int threads);

}  // namespace graybox
