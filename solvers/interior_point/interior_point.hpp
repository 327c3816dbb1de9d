// What the interior-point back-ends have in common: the figures of a design in normalised
// coordinates, the step to the boundary, and the end of a run.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {

// Rows are wanted this much more accurate than the gap that is to be reached.
inline constexpr double kRowAccuracy = 1e-2;

// Information matrix, its factors, sensitivities and duality gap of a design given by multipliers
// z_i = n_i lambda_i of the rows A_i (normalized_set.hpp); the lambda_i need not sum to one.
class DesignEvaluator {
 public:
  explicit DesignEvaluator(const NormalizedSet& normal);

  // Two passes. False where M = sum_i z_i A_i is not numerically positive definite.
  [[nodiscard]] bool evaluate(std::span<const double> multipliers);

  // All of the last successful evaluate().
  [[nodiscard]] std::span<const double> information() const { return information_; }  // M, packed
  [[nodiscard]] std::span<const double> factor() const { return factor_; }            // L, packed
  [[nodiscard]] std::span<const double> inverse_factor() const { return inverse_factor_; }  // L^-1
  [[nodiscard]] std::span<const double> traces() const { return traces_; }  // tr(M^-1 A_i)
  [[nodiscard]] double weight_sum() const { return weight_sum_; }           // sum_i lambda_i
  // max_i tr(M^-1 H_i)/d - 1 of the normalised design.
  [[nodiscard]] double gap() const { return gap_; }
  // How well it is known (claim.hpp).
  [[nodiscard]] double gap_rounding() const;

 private:
  const NormalizedSet& normal_;
  std::vector<double> information_;
  std::vector<double> square_;  // d x d scratch
  std::vector<double> factor_;
  std::vector<double> inverse_factor_;
  std::vector<double> trace_dual_;
  std::vector<double> traces_;
  double weight_sum_ = 0.0;
  double gap_ = 0.0;
};

// The largest t <= infinity with x + t dx >= 0, for x > 0.
[[nodiscard]] double step_to_boundary(std::span<const double> x, std::span<const double> dx);

// How far towards the boundary a step may go: 0.99 far from the optimum, closer to 1 as the gap
// closes, so that the last iterations converge faster than linearly.
[[nodiscard]] double boundary_fraction(double gap);

// Keeps the best design of a run and decides when the run is over:
//
//   while (run.proceed(evaluated, evaluator, multipliers)) { one more step }
//   return run.finish(reduced_costs);
//
// The target is 2 % below options.duality_gap, or as far as the rounding of the gap (claim.hpp), a
// margin by which the checker's figure may differ. The run fails where the gap has not fallen by a
// tenth in 15 iterations.
class InteriorPointRun {
 public:
  static constexpr std::int64_t kDefaultIterationLimit = 100;

  InteriorPointRun(const NormalizedSet& normal, const SolveOptions& options, Tracer& tracer);

  // Takes the figures of the current iterate. False when the run is over: solved, out of time or
  // iterations, without progress, or `evaluated` is false (the information matrix was singular).
  [[nodiscard]] bool proceed(bool evaluated, const DesignEvaluator& evaluator,
                             std::span<const double> multipliers);

  // The value sigma mu that the corrector aims for, from sum_i s_i z_i (Q times mu) now and after
  // the predictor: Mehrotra's sigma = (predicted/product)^3. Not below a tenth of what the target
  // needs (the gap is about Q mu/d near the optimum): smaller complementarity products would only
  // spread the ratios z_i/s_i further and cost digits in the Newton system.
  [[nodiscard]] double centring(double product, double predicted) const;

  // Ends the run for a numerical reason.
  void fail(std::string message);

  // The answer. In a solved run, the pair (z_i, reduced cost s_i) marks candidates as outside the
  // support (lambda_i d < s_i n_i, or more clearly so). They get weight exactly zero if the gap
  // stays within the target. Failing that, the lightest do whose loss the target allows.
  [[nodiscard]] Solution finish(std::span<const double> reduced_costs);

 private:
  void drop_negligible(std::span<const double> reduced_costs);

  const NormalizedSet& normal_;
  const SolveOptions& options_;
  Tracer& tracer_;
  std::int64_t iteration_limit_;
  double target_;
  std::int64_t iteration_ = -1;  // the starting point is iteration 0
  std::int64_t last_progress_ = 0;
  double progress_gap_;
  double best_gap_;
  std::vector<double> best_;  // multipliers
  SolveStatus status_ = SolveStatus::kNumericalFailure;
  std::string message_;
};

// The answer for a set that has no regular design.
[[nodiscard]] Solution unsupported(const InformationSet& set, Tracer& tracer, std::string message);

}  // namespace graybox
