// Information matrices from their factors: H = F^T F, F of k rows and d columns, row-major.
//
//   const double f[2] = {1.0, 2.0};
//   double h[3];
//   graybox::pack_factor(f, 1, 2, h);   // 1, 2, 4
//
// Each entry is the sum of its k products in the order of the rows, without fused operations: every
// build of graybox finds the same bits, and so the same content hash. Cost k d^2 / 2.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace graybox {

// `packed`: d (d + 1) / 2 numbers, see packed_matrix.hpp.
void pack_factor(const double* factor, std::size_t rank, std::size_t dimension, double* packed);

// Throws InputError naming the first entry that is not finite, or the first candidate whose matrix
// would overflow. `source` begins the message.
void require_finite_factors(const std::string& source, std::span<const double> factors,
                            std::size_t rank, std::size_t dimension);

}  // namespace graybox
