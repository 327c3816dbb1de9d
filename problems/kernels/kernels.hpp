// The loops that touch every byte of an information set, compiled for several vector widths and
// chosen once at run time. All work on candidates packed as in information_set.hpp; no alignment
// is assumed. Each kernel adds in an order that is fixed for a given vector width, so a result is
// repeatable on a machine, whatever the thread count.
#pragma once

#include <cstddef>

namespace graybox {

// Weights that shrink geometrically stop here, far above the slow denormal numbers.
inline constexpr double kSmallestWeight = 1e-200;

struct Kernels {
  const char* name;  // "generic", "avx2", "avx512"

  // out_i = sum_k dual_k data_ik: with dual in trace-dual packing, tr(W H_i). Bound by memory.
  void (*price)(const double* data, std::size_t count, std::size_t packed_size, const double* dual,
                double* out);

  // sum_k += sum_i weights_i data_ik.
  void (*accumulate)(const double* data, std::size_t count, std::size_t packed_size,
                     const double* weights, double* sum);

  // Pricing, a multiplicative step and the new sum in one read of the data: with s_i = tr(W H_i),
  //   out_i = s_i,   weights_i <- max(weights_i s_i factor, kSmallestWeight),
  //   sum += weights_i H_i.
  void (*reweigh)(const double* data, std::size_t count, std::size_t packed_size,
                  const double* dual, double factor, double* weights, double* out, double* sum);

  // Plain sum of an array: the reference for memory speed (stream_read in the benchmarks).
  double (*sum)(const double* data, std::size_t size);
};

// The widest set this processor runs; the environment variable GRAYBOX_KERNELS=generic|avx2|avx512
// chooses a narrower one (for tests; ignored if the processor lacks it).
[[nodiscard]] const Kernels& kernels();

}  // namespace graybox
