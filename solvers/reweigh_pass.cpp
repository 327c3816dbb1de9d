#include "graybox/solvers/reweigh_pass.hpp"

#include <algorithm>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {

void ReweighPass::run(const double* data, std::span<const double> trace_dual,
                      std::span<double> weights, std::span<double> sensitivities,
                      std::span<double> information) {
  constexpr std::size_t kBlock = 2048;
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
  std::ranges::fill(information, 0.0);
  for (std::size_t block = 0; block < blocks; ++block) {
    for (std::size_t k = 0; k < p; ++k) information[k] += partial_[block * p + k];
  }
}

}  // namespace graybox
