#include "solvers/core/tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

constexpr int kLargestThreadCount = 1024;

}  // namespace

Tracer::Tracer(const InformationSet& set, const SolveOptions& options, SolveObserver* observer)
    : set_(set),
      options_(options),
      observer_(observer),
      limit_(options.time_limit),
      start_(Clock::now()) {
  if (!(options.duality_gap > 0.0) || !std::isfinite(options.duality_gap)) {
    throw InputError(fmt::format("duality gap {} must be a positive number, for example 1e-6",
                                 options.duality_gap));
  }
  if (!(options.time_limit > 0.0)) {
    throw InputError(fmt::format("time limit {} s must be positive", options.time_limit));
  }
  if (options.iteration_limit < 0) {
    throw InputError(
        fmt::format("iteration limit {} must not be negative", options.iteration_limit));
  }
  if (options.threads < 1 || options.threads > kLargestThreadCount) {
    throw InputError(
        fmt::format("thread count {} must be from 1 to {}", options.threads, kLargestThreadCount));
  }
}

double Tracer::seconds() const {
  return std::chrono::duration<double>(Clock::now() - start_ - paused_).count();
}

void Tracer::count_candidates(std::size_t candidates) {
  passes_ += static_cast<double>(candidates) / static_cast<double>(set_.candidate_count());
}

void Tracer::record(double duality_gap, std::int64_t iteration) {
  const TracePoint point{seconds(), passes_, duality_gap, iteration};
  pause();
  const bool first = trace_.empty();
  last_kept_ = first || point.duality_gap <= 0.98 * trace_.back().duality_gap ||
               point.seconds >= 1.05 * trace_.back().seconds;
  if (last_kept_) trace_.push_back(point);
  last_ = point;
  if (observer_ != nullptr && !observer_->on_progress(point)) stop_requested_ = true;
  resume();
}

double Tracer::record_weights(std::span<const double> weights, std::int64_t iteration,
                              bool always) {
  const double now = seconds();
  if (!always && now < next_evaluation_) return std::numeric_limits<double>::infinity();
  next_evaluation_ = 1.2 * now;
  pause();
  const double gap = duality_gap(set_, weights);
  resume();
  record(gap, iteration);
  return gap;
}

bool Tracer::out_of_time() const {
  return stop_requested_ || stop_requested() || seconds() > options_.time_limit;
}

void Tracer::pause() { pause_start_ = Clock::now(); }

void Tracer::resume() {
  const Clock::duration pause = Clock::now() - pause_start_;
  paused_ += pause;
  limit_.extend(std::chrono::duration<double>(pause).count());
}

Solution Tracer::finish(Design design, SolveStatus status, std::int64_t iterations,
                        std::string message) {
  Solution solution;
  solution.counters = {iterations, passes_, seconds()};
  if (!last_kept_) trace_.push_back(last_);
  solution.trace = std::move(trace_);
  solution.design = std::move(design);
  solution.status = status;
  solution.message = std::move(message);
  return solution;
}

}  // namespace graybox
