// Fedorov's exchange (Fedorov 1972, Section 3.3; Atkinson, Donev and Tobias 2007, Chapter 12) for
// whole numbers of experiments with matrix-valued candidates.
//
// One step replaces one run of some candidate i of the design by one of the candidate j of the pool
// that raises log det M(m) most, over all pairs; the search ends where no exchange gains. What an
// exchange gains is taken from a freshly formed sum. Sums changed term by term differ from it by
// rounding, where M(m) is ill-conditioned by more than the gain. Two exchanges that undo each other
// would then both seem to gain. So log det rises with each step, no design comes twice, and the
// search ends; it also ends when stop.hpp says so. With A_i = M(m) - B_i and g_j = tr(A_i^-1 B_j),
//
//   log det(A_i + B_j) - log det A_i = sum_k log(1 + c_k) <= r log(1 + g_j / r),   sum_k c_k = g_j,
//
// with at most r = max rank B_j positive c_k,
// so after pricing the pool once for each distinct i only the few j whose bound beats the best
// exchange so far are evaluated by a Cholesky factorisation. Where A_i is singular (rank-one
// candidates, M close to d) it is given a ridge first, which only raises the bound.
//
// A step costs s (d^3 + n p) for s distinct candidates in the design and n in the pool, and is free
// of M. Ties: the first pair in pool order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exact_bounds/whitened_pool.hpp"

namespace graybox {

class LocalExchange {
 public:
  // `clock`: when to stop, whatever thread asks.
  explicit LocalExchange(const WhitenedPool& pool, StopClock clock = {});

  // log det of sum_k counts_k B_k; minus infinity where it is singular.
  [[nodiscard]] double log_det(std::span<const std::int64_t> counts);

  // Exchanges until none gains or time is up. Returns log det of the counts, freshly summed; minus
  // infinity where no exchange found a regular design.
  double improve(std::span<std::int64_t> counts);

  // Builds a design of `experiments` one by one, each time the candidate that raises the log det of
  // ridge * I + M(m) most. Fewer of them where time is up.
  void grow(std::int64_t experiments, std::span<std::int64_t> counts);

  // Replaces `moves` runs at random.
  void perturb(std::int64_t moves, Random& random, std::span<std::int64_t> counts) const;

  [[nodiscard]] std::int64_t steps() const { return steps_; }

 private:
  struct Best {
    double log_det;
    std::size_t add;
  };
  struct Exchanged {
    std::size_t remove;
    std::size_t add;
  };
  // The pair whose exchange seems to gain most over `current`; nothing where none does.
  std::optional<Exchanged> best_exchange(std::span<const std::int64_t> counts, double current);
  // The best candidate to add to `base`, if it beats `log_det`.
  bool best_addition(std::span<const double> base, Best& best);
  void sum(std::span<const std::int64_t> counts);

  const WhitenedPool& pool_;
  StopClock clock_;
  InverseCholesky factor_;
  InverseCholesky trial_factor_;
  std::vector<double> information_;
  std::vector<double> base_;
  std::vector<double> ridged_;
  std::vector<double> trial_;
  std::vector<double> prices_;
  std::int64_t steps_ = 0;
};

}  // namespace graybox
