// Prices of candidates in factor form: w_i = |X F_i^T|^2 = tr(M^-1 F_i^T F_i) with X = L^-1,
// M = L L^T. Compiled for several vector widths and chosen once at run time, as in kernels.hpp.
//
// Four vectors of factor rows are taken at a time and transposed, so that each lane has one of
// them. Then the triangular product is d^2 / 2 multiply-adds a row, with every number of X loaded
// once for all of them. A rank-one set of d = 12 is read in a sixth of the bytes of its packed
// matrices. Each price is computed in an order that does not depend on its neighbours.
//
//   std::vector<double> scratch(kernel.scratch_size(d));
//   kernel.price(set.factors(), count, rank, d, inverse_factor, scratch.data(), w);
#pragma once

#include <cstddef>

namespace graybox {

struct FactorKernels {
  const char* name;  // "generic", "avx2", "avx512"

  // Doubles of scratch that the others need.
  std::size_t (*scratch_size)(std::size_t dimension);

  // out_i for `count` factors of `rank` rows and d columns, one after the other. x: X, packed lower
  // triangle.
  void (*price)(const double* factors, std::size_t count, std::size_t rank, std::size_t dimension,
                const double* x, double* scratch, double* out);

  // The same for the candidates listed: out_k of candidate indices_k.
  void (*price_indexed)(const double* factors, const std::size_t* indices, std::size_t count,
                        std::size_t rank, std::size_t dimension, const double* x, double* scratch,
                        double* out);
};

// The widest set this processor runs, see kernels().
[[nodiscard]] const FactorKernels& factor_kernels();

}  // namespace graybox
