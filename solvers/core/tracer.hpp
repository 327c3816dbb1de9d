// Tracer: the clock, pass counter and stop test that every solver shares, so that no two back-ends
// measure themselves differently.
//
//   Tracer tracer(set, options, observer);
//   for (std::int64_t iteration = 1; ; ++iteration) {
//     ... work that reads the whole set twice ...
//     tracer.count_passes(2.0);
//     tracer.record(gap, iteration);          // or tracer.record_weights(weights, iteration)
//     if (gap <= options.duality_gap) break;
//     if (tracer.out_of_time()) break;
//   }
//   return tracer.finish(std::move(design), status, iterations, message);
//
// The clock stands still while a trace point is recorded. The time limit is also this thread's
// (stop.hpp), for what the solver calls and for loops that know no tracer.
#pragma once

#include <chrono>
#include <span>
#include <vector>

#include "problems/base/stop.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

class Tracer {
 public:
  // Starts the clock. Throws InputError for options out of range. Keeps references to its
  // arguments.
  Tracer(const InformationSet& set, const SolveOptions& options, SolveObserver* observer);

  [[nodiscard]] double seconds() const;
  void count_passes(double passes) { passes_ += passes; }
  void count_candidates(std::size_t candidates);  // candidates read: adds candidates / Q passes

  // Records a gap the solver knows anyway. To keep traces short, points are kept when the gap has
  // fallen by 2 % or the time has grown by 5 % since the last one kept; the last is always kept.
  void record(double duality_gap, std::int64_t iteration);

  // For solvers whose iterates do not bring the gap along: evaluates it with the clock stopped, at
  // times at least 20 % apart, and calls record(). Returns the gap, or infinity if it was not due.
  double record_weights(std::span<const double> weights, std::int64_t iteration,
                        bool always = false);

  // True once the time limit has passed, the observer has asked to stop, or stop.hpp says so.
  [[nodiscard]] bool out_of_time() const;

  // Stops the clock for work that is not the solver's (writing a trace, evaluating a gap).
  void pause();
  void resume();

  [[nodiscard]] Solution finish(Design design, SolveStatus status, std::int64_t iterations,
                                std::string message = {});

 private:
  using Clock = std::chrono::steady_clock;

  const InformationSet& set_;
  const SolveOptions& options_;
  SolveObserver* observer_;
  TimeLimit limit_;
  Clock::time_point start_;
  Clock::time_point pause_start_;
  Clock::duration paused_{};
  double passes_ = 0.0;
  double next_evaluation_ = 0.0;
  bool stop_requested_ = false;
  bool last_kept_ = true;
  TracePoint last_;
  std::vector<TracePoint> trace_;
};

}  // namespace graybox
