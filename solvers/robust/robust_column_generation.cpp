#include "solvers/robust/robust_column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "problems/base/aligned_array.hpp"
#include "problems/base/random.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/column_generation/best_design.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/robust/robust_working_set.hpp"

namespace graybox {
namespace {

class RobustColumnGeneration {
 public:
  RobustColumnGeneration(const RobustProblem& problem, const SolveOptions& options, Tracer& tracer)
      : problem_(problem),
        options_(options),
        tracer_(tracer),
        working_(problem),
        random_(options.seed),
        count_(problem.first().candidate_count()),
        dimension_(static_cast<double>(problem.first().dimension())),
        sensitivity_(count_) {}

  RobustSolution run() {
    constexpr int kPatience = 12;
    if (!start()) return finish(SolveStatus::kUnsupported);
    double pool_gap = 1.0, share = 1.0;
    for (int since_progress = 0;; ++rounds_) {
      // As exact as the best gap deserves, and ten times more so after each round without progress:
      // an inexact optimum can send the members round in a circle.
      const double reached = std::min(pool_gap, best_.gap());
      const double target =
          std::max(0.3 * options_.duality_gap, share * std::min(0.1 * reached, reached * reached));
      if (!working_.optimise(target, [this] { return out_of_time(); })) {
        return fail("the information matrix of a sample became singular");
      }
      pool_gap = price() / dimension_ * working_.spread() - 1.0;
      const bool progress = pool_gap < 0.9 * best_.gap();
      since_progress = progress ? 0 : since_progress + 1;
      share = progress ? 1.0 : 0.1 * share;
      keep_if_better(pool_gap);
      if (best_.gap() <= options_.duality_gap) return finish(SolveStatus::kSolved);
      if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
      if (options_.iteration_limit > 0 && rounds_ + 1 >= options_.iteration_limit) {
        return finish(SolveStatus::kIterationLimit);
      }
      if (since_progress > kPatience) {
        return fail(fmt::format("rounding keeps the gap at {:.1e}", best_.gap()));
      }
      if (progress) {
        working_.drop_below(dimension_ * (1.0 - std::sqrt(working_.gap() + pool_gap)));
      }
      add_violators();
    }
  }

 private:
  // The mean of designs that are optimal for some samples each, regular for all.
  bool start() {
    constexpr std::size_t kStarts = 8;
    const std::size_t total = problem_.samples.size();
    const std::size_t first = std::min(total, kStarts);
    for (std::size_t k = 0; k < first; ++k) {
      if (!add_optimum_of(total * k / first)) return false;
    }
    for (std::size_t s = working_.singular_sample(); s < total; s = working_.singular_sample()) {
      if (s == repaired_) {
        message_ = fmt::format("sample {} is singular in double precision", s);
        return false;
      }
      repaired_ = s;
      if (!add_optimum_of(s)) return false;
    }
    return true;
  }

  bool add_optimum_of(std::size_t s) {
    SolveOptions rough = options_;
    rough.duality_gap = 0.01;
    rough.iteration_limit = 0;
    rough.criterion = Criterion();
    const Solution solution = ColumnGeneration().solve(*problem_.samples[s], rough);
    if (solution.status == SolveStatus::kUnsupported) {
      message_ = fmt::format("sample {}: {}", s, solution.message);
      return false;
    }
    tracer_.count_passes(solution.counters.passes / static_cast<double>(problem_.samples.size()));
    for (std::size_t i = 0; i < count_; ++i) {
      if (solution.design.weights[i] > 0.0) working_.add(i, solution.design.weights[i]);
    }
    return true;
  }

  // Lets the user's wish to stop arrive between pricings.
  bool out_of_time() {
    tracer_.record(best_.gap(), working_.iterations());
    return tracer_.out_of_time();
  }

  // w_i for all candidates; returns the largest. A block of candidates goes through all samples, so
  // that each w_i is added up in the order of the samples.
  double price() {
    constexpr std::size_t kBlock = 1024;
    const auto blocks = static_cast<std::ptrdiff_t>((count_ + kBlock - 1) / kBlock);
    const std::size_t p = problem_.first().packed_size();
#pragma omp parallel for num_threads(options_.threads) schedule(static) if (options_.threads > 1)
    for (std::ptrdiff_t b = 0; b < blocks; ++b) {
      const std::size_t from = static_cast<std::size_t>(b) * kBlock;
      const std::size_t size = std::min(kBlock, count_ - from);
      double traces[kBlock];
      std::fill_n(sensitivity_.data() + from, size, 0.0);
      for (std::size_t s = 0; s < problem_.samples.size(); ++s) {
        const double price = working_.prices()[s];
        if (price == 0.0) continue;
        kernels().price(problem_.samples[s]->data() + from * p, size, p,
                        working_.trace_dual(s).data(), traces);
        for (std::size_t i = 0; i < size; ++i) sensitivity_[from + i] += price * traces[i];
      }
    }
    const auto read = std::ranges::count_if(working_.prices(), [](double x) { return x > 0.0; });
    tracer_.count_passes(static_cast<double>(read) / static_cast<double>(problem_.samples.size()));
    return *std::max_element(sensitivity_.begin(), sensitivity_.end());
  }

  void add_violators() {
    const std::size_t d = problem_.first().dimension();
    for (const std::size_t candidate :
         violators(sensitivity_.span(), dimension_, 2 * d, 4 * d, random_)) {
      working_.add(candidate, 0.0);
    }
  }

  void keep_if_better(double gap) {
    if (best_.offer(gap, working_.members(), working_.weights())) {
      best_prices_.assign(working_.prices().begin(), working_.prices().end());
    }
    tracer_.record(gap, working_.iterations());
  }

  RobustSolution fail(std::string message) {
    message_ = std::move(message);
    return finish(SolveStatus::kNumericalFailure);
  }

  RobustSolution finish(SolveStatus status) {
    Design design;
    if (status != SolveStatus::kUnsupported) design = best_.design(count_);
    return {tracer_.finish(std::move(design), status, working_.iterations(), std::move(message_)),
            std::move(best_prices_)};
  }

  const RobustProblem& problem_;
  const SolveOptions& options_;
  Tracer& tracer_;
  RobustWorkingSet working_;
  Random random_;
  std::size_t count_;
  double dimension_;
  AlignedArray sensitivity_;
  std::size_t repaired_ = static_cast<std::size_t>(-1);
  std::int64_t rounds_ = 0;
  BestDesign best_;
  std::vector<double> best_prices_;
  std::string message_;
};

}  // namespace

RobustSolution solve_robust(const RobustProblem& problem, const SolveOptions& options,
                            SolveObserver* observer) {
  require_shared_candidates(problem);
  Tracer tracer(problem.first(), options, observer);
  return RobustColumnGeneration(problem, options, tracer).run();
}

}  // namespace graybox
