// WholeDesignSearch: all questions of a plan about one size of the campaign, which is a number of
// experiments or a budget. What do real numbers of experiments reach, which whole numbers reach
// every target, and can it be excluded that some do?
//
//   v_j(m) = c_j^T M(m)^-1 c_j / s_j^2 <= 1 for all j      (precision_target.hpp)
//
// Whole numbers come from rounding the relaxed design, from exchanges whose weights mu grow where a
// target is missed, and from short trees. None are left where branch and bound
// (constrained_exact.hpp) shows tr(W(mu) M^-1) > 1 for all designs and one mu.
//
//   WholeDesignSearch search(set, constraints, targets, {.seed = 1, .threads = 1});
//   search.relax(PrecisionQuestion::kValue);
//   WholeDesign best = search.find(1.0);
//   const bool none = best.worst > 1.0 && search.excludes(20.0, best);
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "solvers/constrained_exact/constrained_exact.hpp"
#include "solvers/planning/minimax_precision.hpp"

namespace graybox {

inline constexpr double kPlanMargin = 1e-8;  // relative: of a variance that reaches its limit

struct WholeDesign {
  std::vector<std::int64_t> counts;
  std::vector<double> ratios;                              // v_j
  double worst = std::numeric_limits<double>::infinity();  // the largest
};

struct WholeSearchOptions {
  std::uint64_t seed = 1;
  int threads = 1;
};

// The design without any experiments, where it obeys the constraints and what is known already
// reaches every target.
[[nodiscard]] std::optional<WholeDesign> nothing_needed(const InformationSet& set,
                                                        const DesignConstraints& constraints,
                                                        std::span<const PrecisionTarget> targets);

class WholeDesignSearch {
 public:
  // Keeps references to set and targets.
  WholeDesignSearch(const InformationSet& set, DesignConstraints constraints,
                    std::span<const PrecisionTarget> targets, const WholeSearchOptions& options);

  // Bounds of the relaxed problem.
  const MinimaxPrecision& relax(PrecisionQuestion question);

  // The best whole numbers that are found; any with no v_j above `enough` will do.
  [[nodiscard]] WholeDesign find(double enough);

  // Whether no whole numbers reach every target, in so many seconds; relax() comes first. Designs
  // met on the way that are better than `best` take its place.
  [[nodiscard]] bool excludes(double seconds, WholeDesign& best);

 private:
  bool excludes_by_one_mu(double seconds, WholeDesign& best);
  [[nodiscard]] WholeDesign measure(std::span<const std::int64_t> counts) const;
  void take(const std::vector<RankedDesign>& designs, WholeDesign& best) const;
  [[nodiscard]] std::vector<std::int64_t> rounded() const;
  void improve(std::vector<std::int64_t> counts, double enough, WholeDesign& best) const;
  [[nodiscard]] ConstrainedExactSolution search(std::span<const double> mu, double seconds) const;

  const InformationSet& set_;
  DesignConstraints constraints_;
  std::span<const PrecisionTarget> targets_;
  WholeSearchOptions options_;
  std::optional<MinimaxPrecision> relaxed_;
};

}  // namespace graybox
