#include "solvers/core/sensitivity.hpp"

#include <algorithm>
#include <limits>

#include "problems/kernels/kernels.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {
namespace {

void add_factors(const InformationSet& set, std::span<const double> weights,
                 std::span<double> packed) {
  const std::size_t d = set.dimension();
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    if (weights[i] == 0.0) continue;
    const auto factor = set.factor(i);
    for (std::size_t r = 0; r < factor.size(); r += d) {
      for (std::size_t j = 0, k = 0; j < d; ++j) {
        const double scaled = weights[i] * factor[r + j];
        for (std::size_t l = 0; l <= j; ++l, ++k) packed[k] += scaled * factor[r + l];
      }
    }
  }
}

// out_i = sum over the rows f of F_i of f^T W f.
void price_factors(const InformationSet& set, std::span<const double> trace_dual,
                   std::span<double> out) {
  const std::size_t d = set.dimension();
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto factor = set.factor(i);
    double total = 0.0;
    for (std::size_t r = 0; r < factor.size(); r += d) {
      for (std::size_t j = 0, k = 0; j < d; ++j) {
        double inner = 0.0;
        for (std::size_t l = 0; l <= j; ++l, ++k) inner += trace_dual[k] * factor[r + l];
        total += inner * factor[r + j];
      }
    }
    out[i] = total;
  }
}

}  // namespace

void information_matrix(const InformationSet& set, std::span<const double> weights,
                        std::span<double> packed) {
  std::ranges::fill(packed, 0.0);
  if (set.has_factors()) return add_factors(set, weights, packed);
  const std::size_t p = set.packed_size();
  const std::size_t count = set.candidate_count();
  const auto& kernel = kernels();
  // Runs of non-zero weights go to the kernel together; zeros cost nothing.
  for (std::size_t begin = 0; begin < count;) {
    if (weights[begin] == 0.0) {
      ++begin;
      continue;
    }
    std::size_t end = begin + 1;
    while (end < count && weights[end] != 0.0) ++end;
    kernel.accumulate(set.data() + begin * p, end - begin, p, weights.data() + begin,
                      packed.data());
    begin = end;
  }
}

double log_det_information(const InformationSet& set, std::span<const double> weights) {
  std::vector<double> packed(set.packed_size());
  information_matrix(set, weights, packed);
  return InverseCholesky(set.dimension()).log_det_of(packed);
}

bool invert(std::span<const double> packed, std::size_t dimension, InverseFactor& factor) {
  InverseCholesky cholesky(dimension);
  if (!cholesky.factor(packed)) return false;
  factor.trace_dual.assign(cholesky.trace_dual().begin(), cholesky.trace_dual().end());
  factor.log_det = cholesky.log_det();
  return true;
}

void sensitivities(const InformationSet& set, std::span<const double> trace_dual,
                   std::span<double> out) {
  if (set.has_factors()) return price_factors(set, trace_dual, out);
  kernels().price(set.data(), set.candidate_count(), set.packed_size(), trace_dual.data(),
                  out.data());
}

double duality_gap(const InformationSet& set, std::span<const double> weights) {
  std::vector<double> packed(set.packed_size());
  information_matrix(set, weights, packed);
  InverseFactor factor;
  if (!invert(packed, set.dimension(), factor)) return std::numeric_limits<double>::infinity();
  std::vector<double> sensitivity(set.candidate_count());
  sensitivities(set, factor.trace_dual, sensitivity);
  return *std::ranges::max_element(sensitivity) / static_cast<double>(set.dimension()) - 1.0;
}

}  // namespace graybox
