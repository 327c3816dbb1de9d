// The relaxed design whose worst target is best: with targets c_j^T M^-1 c_j <= s_j^2,
//
//   v = min_x max_j v_j(x),   v_j(x) = c_j^T M(x)^-1 c_j / s_j^2,   M(x) = P + sum_i x_i H_i,
//
// over the x of design_constraints.hpp. All targets are reached by some x exactly where v <= 1.
//
// v_j is convex in x. So by the minimax theorem, with W(mu) = sum_j mu_j c_j c_j^T / s_j^2,
//
//   v = max_mu  min_x tr(W(mu) M(x)^-1),   mu on the simplex.                                 (1)
//
// The inner problem is an L-optimal design (constrained_column_generation.hpp). Its certificate
// gives a lower bound of v for each mu, and any x an upper one. With designs x_t of several mu the
// matrix game
//
//   min_alpha max_j sum_t alpha_t v_j(x_t)
//
// is a linear programme. Its alpha mixes the x_t to a design no worse than the game's value (by
// convexity), and its multipliers are the next mu: Kelley's method, drawn halfway back to the best
// mu so far (Ben-Ameur and Neto, Networks 49, 2007).
//
// Cost: 1 (one target) to some 100 inner problems.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "solvers/constrained/design_constraints.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/planning/precision_target.hpp"

namespace graybox {

enum class PrecisionQuestion : std::int8_t {
  kValue,    // v, to the gap asked for
  kWhether,  // whether v <= 1: stops as soon as the bounds tell
};

struct MinimaxOptions {
  PrecisionQuestion question = PrecisionQuestion::kValue;
  double gap = 1e-3;  // of v, relative
  int threads = 1;
  std::span<const double> start = {};  // mu to begin with; empty: all alike
};

struct MinimaxPrecision {
  double lower = 0.0;             // proven: v >= lower
  double upper = 0.0;             // of `efforts`; infinity where no design was found
  std::vector<double> efforts;    // x, Q numbers
  std::vector<double> mu;         // one a target, sum 1; `lower` is that of this mu
  bool infeasible = false;        // no x obeys the constraints; lower is infinite
  bool singular = false;          // M is singular for all x that do; lower is infinite
  bool failed = false;            // an inner problem was not solved; `lower` holds all the same
  std::vector<std::size_t> pool;  // candidates that some x_t runs, ascending
};

// Constraints have to fit the set (require_fits()). Throws Stopped when stop.hpp says so.
[[nodiscard]] MinimaxPrecision solve_minimax_precision(const InformationSet& set,
                                                       const DesignConstraints& constraints,
                                                       std::span<const PrecisionTarget> targets,
                                                       const MinimaxOptions& options = {});

// The matrix game min_alpha max_j sum_t alpha_t v_jt, with alpha and mu on their simplices.
// `ratios`: the v_jt of each t, positive. Empty shares where the linear programme fails.
struct TargetGame {
  double value = 0.0;
  std::vector<double> shares;  // alpha
  std::vector<double> mu;
};
[[nodiscard]] TargetGame solve_target_game(std::span<const std::vector<double>> ratios);

// v_j of a design.
[[nodiscard]] std::vector<double> target_ratios(const InformationSet& set,
                                                const DesignConstraints& constraints,
                                                std::span<const PrecisionTarget> targets,
                                                std::span<const double> efforts);

// L with W(mu).
[[nodiscard]] Criterion weighted_targets(std::span<const PrecisionTarget> targets,
                                         std::span<const double> mu, std::size_t dimension);

}  // namespace graybox
