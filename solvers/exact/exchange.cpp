#include "solvers/exact/exchange.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "problems/base/stop.hpp"
#include "solvers/exact/efficient_rounding.hpp"
#include "solvers/exact/local_exchange.hpp"
#include "solvers/exact/rounding.hpp"
#include "solvers/exact_bounds/exact_screening.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kRandomStarts = 12;
constexpr int kPerturbations = 48;       // without a better design
constexpr std::size_t kGrownShare = 32;  // runs a parameter; beyond, rounding starts close enough

class ExchangeSearch {
 public:
  ExchangeSearch(const InformationSet& set, const Relaxation& relaxation,
                 const ExactOptions& options, ExactObserver* observer)
      : set_(set),
        relaxation_(relaxation),
        options_(options),
        observer_(observer),
        random_(options.seed),
        start_(std::chrono::steady_clock::now()),
        limit_(options.time_limit - relaxation.seconds) {
    result_.counts = round_weights(relaxation.weights, options.experiments);
    result_.log_det = -kInfinity;
  }

  ExchangeResult run() {
    try {
      first_round();
      if (!stopped()) second_round();
    } catch (const Stopped&) {  // on the way to coordinates; the best so far stands
    }
    return std::move(result_);
  }

 private:
  // Support and the most sensitive: enough for a first incumbent.
  [[nodiscard]] std::vector<std::size_t> small_pool() const {
    std::vector<std::size_t> order(set_.candidate_count());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const std::size_t kept = std::min(order.size(), 32 * set_.dimension());
    std::ranges::partial_sort(
        order, order.begin() + static_cast<std::ptrdiff_t>(kept), {}, [&](std::size_t i) {
          const bool support = relaxation_.weights[i] > 0.0;
          return std::pair{support ? -kInfinity : -relaxation_.sensitivities[i], i};
        });
    order.resize(kept);
    std::ranges::sort(order);
    return order;
  }

  void first_round() {
    const WhitenedPool pool(set_, relaxation_, small_pool(), options_.threads, StopClock());
    LocalExchange exchange(pool);
    improve_roundings(pool, exchange);
  }

  void second_round() {
    for (;;) {
      const CountLimits limits = screen_counts(relaxation_, options_.experiments, result_.log_det);
      const WhitenedPool pool(set_, relaxation_, limits.candidates, options_.threads, StopClock());
      LocalExchange exchange(pool);
      const double before = result_.log_det;
      improve_roundings(pool, exchange);
      random_starts(pool, exchange);
      perturb_best(pool, exchange);
      // A much better design shrinks the pool, and the search is worth repeating there.
      if (stopped() || !(result_.log_det > before + 1e-3)) return;
    }
  }

  // Counts over the pool; candidates outside it are dropped, and grown back by the caller's
  // improve.
  [[nodiscard]] static std::vector<std::int64_t> restricted(
      const WhitenedPool& pool, const std::vector<std::int64_t>& counts) {
    std::vector<std::int64_t> inside(pool.size());
    for (std::size_t k = 0; k < pool.size(); ++k) inside[k] = counts[pool.candidates()[k]];
    return inside;
  }

  // True if the improved counts are the best so far.
  bool offer(const WhitenedPool& pool, LocalExchange& exchange, std::vector<std::int64_t>& counts) {
    const std::int64_t total = std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
    if (total != options_.experiments)
      return false;  // it had candidates that can't be in an optimum
    const std::int64_t steps_before = exchange.steps();
    const double log_det = exchange.improve(counts) + pool.log_det_shift();
    result_.steps += exchange.steps() - steps_before;
    if (!(log_det > result_.log_det + 1e-11)) return false;
    result_.log_det = log_det;
    std::ranges::fill(result_.counts, 0);
    for (std::size_t k = 0; k < counts.size(); ++k) {
      result_.counts[pool.candidates()[k]] = counts[k];
    }
    return true;
  }

  void improve_roundings(const WhitenedPool& pool, LocalExchange& exchange) {
    for (const auto& rounded :
         {round_weights(relaxation_.weights, options_.experiments),
          round_weights_efficiently(relaxation_.weights, options_.experiments)}) {
      std::vector<std::int64_t> counts = restricted(pool, rounded);
      offer(pool, exchange, counts);
    }
    if (options_.experiments > static_cast<std::int64_t>(kGrownShare * set_.dimension())) return;
    std::vector<std::int64_t> grown(pool.size());
    exchange.grow(options_.experiments, grown);
    offer(pool, exchange, grown);
  }

  void random_starts(const WhitenedPool& pool, LocalExchange& exchange) {
    std::vector<double> cumulative(pool.size());
    double sum = 0.0;
    for (std::size_t k = 0; k < pool.size(); ++k) {
      cumulative[k] = sum += relaxation_.weights[pool.candidates()[k]];
    }
    if (!(sum > 0.0)) return;
    for (int attempt = 0; attempt < kRandomStarts && !stopped(); ++attempt) {
      std::vector<std::int64_t> counts(pool.size());
      for (std::int64_t run = 0; run < options_.experiments; ++run) {
        const auto at = std::ranges::upper_bound(cumulative, random_.uniform(0.0, sum));
        ++counts[std::min(static_cast<std::size_t>(at - cumulative.begin()), pool.size() - 1)];
      }
      offer(pool, exchange, counts);
    }
  }

  void perturb_best(const WhitenedPool& pool, LocalExchange& exchange) {
    int since_best = 0;
    for (int attempt = 0; since_best < kPerturbations && !stopped(); ++attempt) {
      std::vector<std::int64_t> counts = restricted(pool, result_.counts);
      if (std::accumulate(counts.begin(), counts.end(), std::int64_t{0}) != options_.experiments) {
        return;
      }
      exchange.perturb(1 + attempt % 3, random_, counts);
      since_best = offer(pool, exchange, counts) ? 0 : since_best + 1;
    }
  }

  bool stopped() {
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count() +
        relaxation_.seconds;
    if (seconds > options_.time_limit || stop_requested()) return true;
    if (observer_ == nullptr) return false;
    const double bound = relaxation_.log_det_bound(options_.experiments);
    const auto d = static_cast<double>(set_.dimension());
    return !observer_->on_progress({.seconds = seconds,
                                    .survivors = set_.candidate_count(),
                                    .log_det = result_.log_det,
                                    .log_det_bound = bound,
                                    .proven_efficiency = std::exp((result_.log_det - bound) / d)});
  }

  const InformationSet& set_;
  const Relaxation& relaxation_;
  const ExactOptions& options_;
  ExactObserver* observer_;
  Random random_;
  std::chrono::steady_clock::time_point start_;
  TimeLimit limit_;
  ExchangeResult result_;
};

}  // namespace

ExchangeResult search_by_exchange(const InformationSet& set, const Relaxation& relaxation,
                                  const ExactOptions& options, ExactObserver* observer) {
  return ExchangeSearch(set, relaxation, options, observer).run();
}

ExactSolution Exchange::solve(const InformationSet& set, const Relaxation& relaxation,
                              const ExactOptions& options, ExactObserver* observer) const {
  require_exact_problem(set, relaxation, options);
  const auto start = std::chrono::steady_clock::now();
  ExchangeResult found = search_by_exchange(set, relaxation, options, observer);
  ExactSolution solution;
  solution.survivors =
      screen_counts(relaxation, options.experiments, found.log_det).candidates.size();
  solution.design.counts = std::move(found.counts);
  solution.iterations = found.steps;
  solution.log_det_bound = relaxation.log_det_bound(options.experiments);
  solution.seconds =
      relaxation.seconds +
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  judge_exact(set, relaxation, options, solution);
  return solution;
}

}  // namespace graybox
