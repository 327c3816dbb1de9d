#include "solvers/multiplicative/reweigh_pass.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"

namespace graybox {
namespace {

constexpr std::size_t kBlock = 2048;

}  // namespace

void ReweighPass::run(const double* data, std::span<const double> trace_dual,
                      std::span<double> weights, std::span<double> sensitivities,
                      std::span<double> information) {
  const std::size_t p = packed_size(dimension_);
  const std::size_t count = weights.size();
  const std::size_t blocks = (count + kBlock - 1) / kBlock;
  const double factor = 1.0 / static_cast<double>(dimension_);
  const auto& kernel = kernels();
  partial_.assign(blocks * p, 0.0);
#pragma omp parallel for schedule(static) num_threads(threads_) if (threads_ > 1)
  for (std::size_t block = 0; block < blocks; ++block) {
    const std::size_t begin = block * kBlock;
    const std::size_t size = std::min(kBlock, count - begin);
    kernel.reweigh(data + begin * p, size, p, trace_dual.data(), factor, weights.data() + begin,
                   sensitivities.data() + begin, partial_.data() + block * p);
  }
  add_partial_sums(information);
}

// A block is priced and, while it is in the cache, summed.
void ReweighPass::run_root(const double* data, std::span<const double> trace_dual,
                           std::span<double> weights, std::span<double> sensitivities,
                           std::span<double> information) {
  const std::size_t p = packed_size(dimension_);
  const std::size_t count = weights.size();
  const std::size_t blocks = (count + kBlock - 1) / kBlock;
  const auto& kernel = kernels();
  partial_.assign(blocks * p, 0.0);
#pragma omp parallel for schedule(static) num_threads(threads_) if (threads_ > 1)
  for (std::size_t block = 0; block < blocks; ++block) {
    const std::size_t begin = block * kBlock;
    const std::size_t size = std::min(kBlock, count - begin);
    kernel.price(data + begin * p, size, p, trace_dual.data(), sensitivities.data() + begin);
    for (std::size_t i = begin; i < begin + size; ++i) {
      weights[i] =
          std::max(weights[i] * std::sqrt(std::max(sensitivities[i], 0.0)), kSmallestWeight);
    }
    kernel.accumulate(data + begin * p, size, p, weights.data() + begin,
                      partial_.data() + block * p);
  }
  add_partial_sums(information);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  for (double& entry : information) entry /= sum;
}

void ReweighPass::add_partial_sums(std::span<double> information) const {
  const std::size_t p = information.size();
  std::ranges::fill(information, 0.0);
  for (std::size_t from = 0; from < partial_.size(); from += p) {
    for (std::size_t k = 0; k < p; ++k) information[k] += partial_[from + k];
  }
}

}  // namespace graybox
