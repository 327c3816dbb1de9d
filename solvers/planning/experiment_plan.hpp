// How many experiments are needed: the smallest M for which whole numbers m_i of experiments,
// sum_i m_i <= M, reach every target c_j^T M(m)^-1 c_j <= s_j^2 (precision_target.hpp), and those
// numbers. M(m) = P + sum_i m_i H_i with earlier information P, under the constraints of
// design_constraints.hpp.
//
// H_i is the information of one experiment, in absolute terms: M^-1 is the covariance.
//
// M is proven from both sides:
//   - a design of M experiments that reaches every target;
//   - for every smaller number, that none does. Where the relaxed problem already misses a target
//     (minimax_precision.hpp) no whole numbers reach it. Above that number branch and bound
//     (constrained_exact.hpp) shows for fixed weights mu that tr(W(mu) M^-1) > 1 for all designs,
//     so that some target is missed.
// It is assumed that what N experiments reach, N + 1 reach too: so it is without constraints that
// ask for more of something as N grows.
//
//   const auto plan = graybox::plan_experiments(set, constraints_for, targets, {.at_most = 200});
//   if (plan.status == graybox::PlanStatus::kProven) run(plan.counts);
//
// Cost: some ten relaxed problems, then a tree for each number from the relaxed one on.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "solvers/planning/minimax_precision.hpp"

namespace graybox {

enum class PlanStatus : std::int8_t {
  kProven = 0,       // no smaller number does
  kReached = 1,      // smaller numbers from `least` on are not excluded
  kOutOfReach = -1,  // proven: not with at_most experiments, nor with fewer
  kNotFound = -2,    // time was up, or whole numbers were not found up to at_most
};
[[nodiscard]] std::string_view to_string(PlanStatus status);

struct PlanOptions {
  std::int64_t at_most = 1000;
  double time_limit = std::numeric_limits<double>::infinity();  // wall seconds
  std::uint64_t seed = 1;
  int threads = 1;
};

struct ExperimentPlan {
  PlanStatus status = PlanStatus::kNotFound;
  std::int64_t experiments = 0;         // M: sum of `counts`
  std::int64_t least = 1;               // no smaller number reaches the targets: proven
  std::vector<std::int64_t> counts;     // Q numbers; empty where none were found
  std::vector<double> standard_errors;  // of each target, by `counts`
  double worst_ratio =
      0.0;  // kOutOfReach: the worst target's error over its limit is at least this
  std::string message;
};

// The constraints of N experiments, so that rows as "at most 30 %" grow with N. Row 0 is the number
// of experiments; its lower end is left out.
using ConstraintsOf = std::function<DesignConstraints(std::int64_t)>;

// Throws InputError for targets that are none, and as solve_constrained().
[[nodiscard]] ExperimentPlan plan_experiments(const InformationSet& set,
                                              const ConstraintsOf& constraints_of,
                                              std::span<const PrecisionTarget> targets,
                                              const PlanOptions& options);

// One number of experiments: what the best whole numbers that were found reach.
struct PrecisionPoint {
  std::int64_t experiments = 0;
  double least_ratio = 0.0;  // proven: the worst target's error over its limit is at least this
  double ratio = 0.0;        // of the design found; infinity where there is none
  std::vector<double> standard_errors;
};
[[nodiscard]] std::vector<PrecisionPoint> precision_curve(const InformationSet& set,
                                                          const ConstraintsOf& constraints_of,
                                                          std::span<const PrecisionTarget> targets,
                                                          std::span<const std::int64_t> experiments,
                                                          const PlanOptions& options);

}  // namespace graybox
