#include "solvers/conditioning/twofold_congruence.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr std::size_t kLanes = 8;
using Lanes = std::array<double, kLanes>;

// The upper half of the digits of x: x - upper_half(x) is the lower half, exactly.
inline double upper_half(double x) {
  constexpr double kSplitter = 134217729.0;  // 2^27 + 1
  const double shifted = kSplitter * x;
  return shifted - (shifted - x);
}

// One sum a lane, with what its roundings have lost.
struct TwofoldSum {
  Lanes value{};
  Lanes lost{};

  // += factor * x, both numbers exact.
  void add_product(const Lanes& x, double factor) {
    const double upper_factor = upper_half(factor), lower_factor = factor - upper_factor;
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double upper = upper_half(x[l]), lower = x[l] - upper;
      const double product = x[l] * factor;
      const double product_lost =
          (((upper * upper_factor - product) + upper * lower_factor) + lower * upper_factor) +
          lower * lower_factor;
      const double sum = value[l] + product;
      const double added = sum - value[l];
      lost[l] += ((value[l] - (sum - added)) + (product - added)) + product_lost;
      value[l] = sum;
    }
  }
  void add_product(const TwofoldSum& x, double factor) {
    add_product(x.value, factor);
    for (std::size_t l = 0; l < kLanes; ++l) lost[l] += x.lost[l] * factor;
  }
};

// At most kLanes matrices, entry by entry beside each other.
void transform_batch(const double* in, std::size_t count, std::size_t d, std::span<const double> r,
                     std::vector<Lanes>& entries, std::vector<TwofoldSum>& product, double* out) {
  const std::size_t p = packed_size(d);
  for (std::size_t k = 0; k < p; ++k) {
    for (std::size_t l = 0; l < count; ++l) entries[k][l] = in[l * p + k];
  }
  std::ranges::fill(product, TwofoldSum{});
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      for (std::size_t k = 0; k <= i; ++k) {
        product[i * d + j].add_product(entries[packed_index(std::max(k, j), std::min(k, j))],
                                       r[i * d + k]);
      }
    }
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      TwofoldSum sum;
      for (std::size_t k = 0; k <= j; ++k) sum.add_product(product[i * d + k], r[j * d + k]);
      for (std::size_t l = 0; l < count; ++l) {
        out[l * p + packed_index(i, j)] = sum.value[l] + sum.lost[l];
      }
    }
  }
}

// At most kLanes rows, entry by entry beside each other.
void multiply_batch(const double* in, std::size_t count, std::size_t d, std::span<const double> r,
                    std::vector<Lanes>& entries, double* out) {
  for (std::size_t k = 0; k < d; ++k) {
    for (std::size_t l = 0; l < count; ++l) entries[k][l] = in[l * d + k];
  }
  for (std::size_t i = 0; i < d; ++i) {
    TwofoldSum sum;
    for (std::size_t k = 0; k <= i; ++k) sum.add_product(entries[k], r[i * d + k]);
    for (std::size_t l = 0; l < count; ++l) out[l * d + i] = sum.value[l] + sum.lost[l];
  }
}

// transform(begin, count) for all batches of at most kLanes, on all threads; false where it was
// asked to stop. `make_transform` gives each thread its own.
template <typename MakeTransform>
bool transform_all(std::size_t count, int threads, MakeTransform make_transform) {
  const std::size_t batches = (count + kLanes - 1) / kLanes;
  const StopClock clock;
  std::atomic<bool> stopped = false;
#pragma omp parallel num_threads(threads) if (threads > 1)
  {
    auto transform = make_transform();
#pragma omp for schedule(static)
    for (std::size_t batch = 0; batch < batches; ++batch) {
      if (stopped.load(std::memory_order_relaxed)) continue;
      if (clock.stops()) stopped = true;
      const std::size_t begin = batch * kLanes;
      transform(begin, std::min(kLanes, count - begin));
    }
  }
  return !stopped;
}

}  // namespace

bool twofold_congruence(const double* in, std::size_t count, std::size_t d,
                        std::span<const double> r, double* out, int threads) {
  const std::size_t p = packed_size(d);
  return transform_all(count, threads, [=] {
    return [=, entries = std::vector<Lanes>(p, Lanes{}), product = std::vector<TwofoldSum>(d * d)](
               std::size_t begin, std::size_t size) mutable {
      transform_batch(in + begin * p, size, d, r, entries, product, out + begin * p);
    };
  });
}

bool twofold_product(const double* in, std::size_t count, std::size_t d, std::span<const double> r,
                     double* out, int threads) {
  return transform_all(count, threads, [=] {
    return
        [=, entries = std::vector<Lanes>(d, Lanes{})](std::size_t begin, std::size_t size) mutable {
          multiply_batch(in + begin * d, size, d, r, entries, out + begin * d);
        };
  });
}

}  // namespace graybox
