#include "solvers/interior_point/hessian_assembly.hpp"

#include <algorithm>

#include "problems/base/stop.hpp"
#include "solvers/kernels/gram_kernels.hpp"

namespace graybox {
namespace {

// Between chunks it asks whether to stop: a fraction of a second of work.
constexpr std::size_t kLeastChunk = 64;
constexpr std::size_t kChunkWork = std::size_t{1} << 31;  // multiplications

}  // namespace

HessianAssembly::HessianAssembly(std::size_t row_size, int threads)
    : row_size_(row_size),
      threads_(std::max(threads, 1)),
      workspace_(static_cast<std::size_t>(threads_) * gram_workspace_size(row_size)) {}

bool HessianAssembly::assemble(const double* rows, std::size_t count,
                               std::span<const double> scales, std::span<double> gram) {
  const std::size_t n = row_size_;
  for (std::size_t i = 0; i < n; ++i) std::fill_n(gram.data() + i * n, i + 1, 0.0);
  const std::size_t chunk = std::max(kLeastChunk, kChunkWork / (n * n));
  for (std::size_t begin = 0; begin < count; begin += chunk) {
    if (stop_requested()) return false;
    const std::size_t size = std::min(chunk, count - begin);
    add(rows + begin * n, size, scales.data() + begin, gram);
  }
  return true;
}

void HessianAssembly::add(const double* rows, std::size_t count, const double* scales,
                          std::span<double> gram) {
  const std::size_t n = row_size_;
  const auto parts = static_cast<std::size_t>(threads_);
#pragma omp parallel for num_threads(threads_) if (threads_ > 1) schedule(static)
  for (std::size_t part = 0; part < parts; ++part) {
    gram_kernels().gram(rows, count, n, scales, part, parts, gram.data(),
                        workspace_.data() + part * gram_workspace_size(n));
  }
}

}  // namespace graybox
