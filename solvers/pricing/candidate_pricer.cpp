#include "solvers/pricing/candidate_pricer.hpp"

#include <numeric>

#include "problems/kernels/factor_kernels.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {

std::span<const double> pricing_numbers(const InformationSet& set, const InverseCholesky& inverse) {
  return set.has_factors() ? inverse.inverse_factor() : inverse.trace_dual();
}

CandidatePricer::CandidatePricer(const InformationSet& set, const InverseCholesky& inverse)
    : CandidatePricer(set, pricing_numbers(set, inverse)) {}

CandidatePricer::CandidatePricer(const InformationSet& set, std::span<const double> pricing_numbers)
    : set_(set), numbers_(pricing_numbers) {
  if (set.has_factors()) scratch_.resize(factor_kernels().scratch_size(set.dimension()));
}

void CandidatePricer::price(std::size_t from, std::size_t count, double* out) {
  if (set_.has_factors()) {
    const std::size_t each = set_.rank() * set_.dimension();
    factor_kernels().price(set_.factors() + from * each, count, set_.rank(), set_.dimension(),
                           numbers_.data(), scratch_.data(), out);
    return;
  }
  const std::size_t p = set_.packed_size();
  kernels().price(set_.data() + from * p, count, p, numbers_.data(), out);
}

void CandidatePricer::price(std::span<const std::size_t> candidates, double* out) {
  if (set_.has_factors()) {
    factor_kernels().price_indexed(set_.factors(), candidates.data(), candidates.size(),
                                   set_.rank(), set_.dimension(), numbers_.data(), scratch_.data(),
                                   out);
    return;
  }
  dense_kernels().price_indexed(set_.data(), candidates.data(), candidates.size(),
                                set_.packed_size(), numbers_.data(), out);
}

double squared_whitened_norm_of_factor(std::span<const double> factor, std::size_t rank,
                                       std::span<const double> inverse_factor,
                                       std::span<double> scratch) {
  const std::size_t d = factor.size() / rank;
  double total = 0.0;
  for (std::size_t r = 0; r < rank; ++r) {
    const double* row = factor.data() + r * d;
    double* whitened = scratch.data() + r * d;
    for (std::size_t j = 0, k = 0; j < d; ++j) {
      whitened[j] = std::inner_product(row, row + j + 1, inverse_factor.data() + k, 0.0);
      k += j + 1;
    }
    for (std::size_t s = 0; s <= r; ++s) {
      const double product =
          std::inner_product(whitened, whitened + d, scratch.data() + s * d, 0.0);
      total += (s == r ? 1.0 : 2.0) * product * product;
    }
  }
  return total;
}

}  // namespace graybox
