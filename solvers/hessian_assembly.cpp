#include "graybox/solvers/hessian_assembly.hpp"

#include <algorithm>

#include "graybox/solvers/kernels/gram_kernels.hpp"

namespace graybox {

HessianAssembly::HessianAssembly(std::size_t row_size, int threads)
    : row_size_(row_size),
      threads_(std::max(threads, 1)),
      workspace_(static_cast<std::size_t>(threads_) * gram_workspace_size(row_size)) {}

void HessianAssembly::assemble(const double* rows, std::size_t count,
                               std::span<const double> scales, std::span<double> gram) {
  const std::size_t n = row_size_;
  for (std::size_t i = 0; i < n; ++i) std::fill_n(gram.data() + i * n, i + 1, 0.0);
  const auto parts = static_cast<std::size_t>(threads_);
#pragma omp parallel for num_threads(threads_) if (threads_ > 1) schedule(static)
  for (std::size_t part = 0; part < parts; ++part) {
    gram_kernels().gram(rows, count, n, scales.data(), part, parts, gram.data(),
                        workspace_.data() + part * gram_workspace_size(n));
  }
}

}  // namespace graybox
