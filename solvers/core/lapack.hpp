// The few BLAS and LAPACK routines that the back-ends call, as functions on column-major arrays.
// Cholesky routines touch the lower triangle only: of a column-major array, which is the upper
// triangle of the same bytes read row by row. The library's thread count is the environment's
// affair (OPENBLAS_NUM_THREADS); nothing here changes it.
#pragma once

#include <cstddef>

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info,
             std::size_t uplo_length);
void dpotrs_(const char* uplo, const int* n, const int* nrhs, const double* a, const int* lda,
             double* b, const int* ldb, int* info, std::size_t uplo_length);
void dtrtri_(const char* uplo, const char* diag, const int* n, double* a, const int* lda, int* info,
             std::size_t uplo_length, std::size_t diag_length);
void dsyrk_(const char* uplo, const char* trans, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* beta, double* c, const int* ldc,
            std::size_t uplo_length, std::size_t trans_length);
}

namespace graybox::lapack {

// Bytes of the buffer that OpenBLAS takes for each thread that calls it.
constexpr std::size_t kBuffer = std::size_t{128} << 20;

// Throws InputError where the limits of this process (ulimit -d, -v) leave no room for the buffers
// of so many callers at a time; else OpenBLAS has them from then on. To be asked before the first
// call and outside of parallel regions: OpenBLAS asks for a buffer that it is refused again and
// again, without end.
void require_room(int callers);

// A = L L^T in place; false where A is not positive definite (or holds a NaN). n^3/3 flops.
[[nodiscard]] inline bool factorise_cholesky(std::size_t n, double* a) {
  const int size = static_cast<int>(n);
  int info = 0;
  dpotrf_("L", &size, a, &size, &info, 1);
  return info == 0;
}

// b := (L L^T)^-1 b for `columns` right sides, with the factor left by factorise_cholesky.
inline void solve_cholesky(std::size_t n, const double* factor, std::size_t columns, double* b) {
  const int size = static_cast<int>(n), right_sides = static_cast<int>(columns);
  int info = 0;
  dpotrs_("L", &size, &right_sides, factor, &size, b, &size, &info, 1);
}

// L := L^-1 in place, for a lower triangular L of non-zero diagonal.
inline void invert_lower(std::size_t n, double* a) {
  const int size = static_cast<int>(n);
  int info = 0;
  dtrtri_("L", "N", &size, a, &size, &info, 1, 1);
}

// Lower triangle of the n x n array c := A^T A for a column-major k x n array A. k n^2 flops.
inline void gram(std::size_t n, std::size_t k, const double* a, double* c) {
  const int size = static_cast<int>(n), depth = static_cast<int>(k);
  const double one = 1.0, zero = 0.0;
  dsyrk_("L", "T", &size, &depth, &one, a, &depth, &zero, c, &size, 1, 1);
}

}  // namespace graybox::lapack
