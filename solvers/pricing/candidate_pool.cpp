#include "solvers/pricing/candidate_pool.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "problems/kernels/kernels.hpp"
#include "solvers/kernels/dense_kernels.hpp"
#include "solvers/pricing/candidate_pricer.hpp"

namespace graybox {
namespace {

// The sensitivities of a pool, block by block on all threads, and the largest of them. `make_price`
// gives each thread its own price(from, count, out).
template <typename MakePrice>
void price_blocks(int threads, CandidatePool& pool, MakePrice make_price) {
  constexpr std::size_t kBlock = 4096;
  const auto blocks = static_cast<std::ptrdiff_t>((pool.count + kBlock - 1) / kBlock);
  const int used = blocks < 8 ? 1 : threads;
#pragma omp parallel num_threads(used) if (used > 1)
  {
    auto price = make_price();
#pragma omp for schedule(static)
    for (std::ptrdiff_t b = 0; b < blocks; ++b) {
      const std::size_t from = static_cast<std::size_t>(b) * kBlock;
      price(from, std::min(kBlock, pool.count - from), pool.sensitivity.data() + from);
    }
  }
  pool.best = static_cast<std::size_t>(
      std::max_element(pool.sensitivity.begin(), pool.sensitivity.begin() + pool.count) -
      pool.sensitivity.begin());
}

}  // namespace

CandidatePool sample_pool(std::size_t total, std::size_t count, Random& random) {
  CandidatePool pool;
  pool.count = std::min(count, total);
  if (count < total) {
    pool.indices.resize(count);
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t from = total * k / count;
      const std::size_t to = total * (k + 1) / count;
      pool.indices[k] = from + random.below(to - from);
    }
  }
  pool.sensitivity = AlignedArray(pool.count);
  return pool;
}

CandidatePool pool_above(const CandidatePool& all, std::span<const double> values,
                         double threshold) {
  CandidatePool list;
  std::vector<std::size_t> positions;
  constexpr std::size_t kBlock = 64;  // most have none, which vectors of comparisons tell
  for (std::size_t from = 0; from < all.count; from += kBlock) {
    const std::size_t to = std::min(all.count, from + kBlock);
    std::size_t above = 0;
    for (std::size_t k = from; k < to; ++k) above += values[k] >= threshold ? 1U : 0U;
    for (std::size_t k = from; above > 0 && k < to; ++k) {
      if (values[k] >= threshold) positions.push_back(k);
    }
  }
  list.count = positions.size();
  list.sensitivity = AlignedArray(list.count);
  list.indices.resize(list.count);
  for (std::size_t k = 0; k < list.count; ++k) {
    list.sensitivity[k] = all.sensitivity[positions[k]];
    list.indices[k] = all.candidate(positions[k]);
  }
  return list;
}

void price_pool(const InformationSet& set, std::span<const double> trace_dual, int threads,
                CandidatePool& pool) {
  const std::size_t p = set.packed_size();
  const double* data = set.data();
  price_blocks(threads, pool, [=, &pool] {
    return [=, &pool](std::size_t from, std::size_t count, double* out) {
      if (pool.whole()) {
        kernels().price(data + from * p, count, p, trace_dual.data(), out);
      } else {
        dense_kernels().price_indexed(data, pool.indices.data() + from, count, p, trace_dual.data(),
                                      out);
      }
    };
  });
}

void price_pool(const InformationSet& set, const InverseCholesky& inverse, int threads,
                CandidatePool& pool) {
  price_blocks(threads, pool, [&] {
    return [&pool, pricer = CandidatePricer(set, inverse)](std::size_t from, std::size_t count,
                                                           double* out) mutable {
      if (pool.whole()) {
        pricer.price(from, count, out);
      } else {
        pricer.price(std::span(pool.indices).subspan(from, count), out);
      }
    };
  });
}

std::vector<std::size_t> violators(std::span<const double> sensitivities, double threshold,
                                   std::size_t wanted, std::size_t stretches, Random& random) {
  const std::size_t count = sensitivities.size();
  if (count == 0 || stretches == 0) return {};
  stretches = std::min(count, stretches);
  const std::size_t length = (count + stretches - 1) / stretches;
  const std::size_t shift = random.below(length);
  std::vector<std::pair<double, std::size_t>> found;
  for (std::size_t from = 0; from < count;) {
    const std::size_t to = std::min(count, from == 0 ? length - shift : from + length);
    const double* first = sensitivities.data() + from;
    const double* best = std::max_element(first, sensitivities.data() + to);
    if (*best > threshold) {
      found.emplace_back(*best, from + static_cast<std::size_t>(best - first));
    }
    from = to;
  }
  wanted = std::min(found.size(), wanted);
  std::ranges::partial_sort(found, found.begin() + static_cast<std::ptrdiff_t>(wanted),
                            std::greater<>());
  std::vector<std::size_t> positions(wanted);
  for (std::size_t k = 0; k < wanted; ++k) positions[k] = found[k].second;
  return positions;
}

}  // namespace graybox
