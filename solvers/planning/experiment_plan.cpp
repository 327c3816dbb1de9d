#include "solvers/planning/experiment_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/planning/whole_design_search.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void require_targets(std::span<const PrecisionTarget> targets) {
  if (targets.empty()) throw InputError("target: say what is to be reached, as 'sd(k1) <= 0.02'");
}

class PlanSearch {
 public:
  PlanSearch(const InformationSet& set, const ConstraintsOf& constraints_of,
             std::span<const PrecisionTarget> targets, const PlanOptions& options)
      : set_(set), constraints_of_(constraints_of), targets_(targets), options_(options) {}

  ExperimentPlan run() {
    const TimeLimit limit(options_.time_limit);
    try {
      if (!needs_nothing() && find_relaxed()) find_whole();
    } catch (const Stopped&) {
      plan_.message = "time was up";
      if (!plan_.counts.empty()) plan_.status = PlanStatus::kReached;
    }
    return std::move(plan_);
  }

 private:
  [[nodiscard]] WholeDesignSearch number(std::int64_t experiments) const {
    return {set_,
            constraints_of_(experiments),
            targets_,
            {.seed = options_.seed, .threads = options_.threads}};
  }

  // Whether what is known already reaches every target.
  bool needs_nothing() {
    const auto none = nothing_needed(set_, constraints_of_(1), targets_);
    if (!none.has_value()) return false;
    accept(*none);
    plan_.least = 0;
    plan_.status = PlanStatus::kProven;
    plan_.message = "what is known already reaches every target";
    return true;
  }

  // The smallest N that the relaxed problem does not exclude, by bisection. False where it excludes
  // all.
  bool find_relaxed() {
    std::int64_t low = 0, high = options_.at_most;
    const MinimaxPrecision most = number(high).relax(PrecisionQuestion::kWhether);
    if (most.lower > 1.0 + kPlanMargin) {
      plan_.status = PlanStatus::kOutOfReach;
      plan_.least = high + 1;
      plan_.worst_ratio = std::sqrt(most.lower);
      if (most.infeasible) plan_.message = "no design obeys the constraints";
      return false;
    }
    // Without earlier information variances fall as 1/N: the first guess.
    auto guess = static_cast<std::int64_t>(static_cast<double>(high) * std::min(most.upper, 1.0));
    while (high - low > 1) {
      const std::int64_t middle = std::clamp(guess, low + 1, high - 1);
      const MinimaxPrecision here = number(middle).relax(PrecisionQuestion::kWhether);
      (here.lower > 1.0 + kPlanMargin ? low : high) = middle;
      plan_.least = low + 1;
      guess = low + (high - low) / 2;
    }
    plan_.least = high;
    return true;
  }

  // Numbers from there on, one by one, until whole numbers do.
  void find_whole() {
    bool all_excluded = true;
    for (std::int64_t n = plan_.least; n <= options_.at_most; ++n) {
      WholeDesignSearch here = number(n);
      here.relax(PrecisionQuestion::kValue);
      WholeDesign best = here.find(1.0);
      if (best.worst > 1.0 && all_excluded && targets_left(here, best)) {
        plan_.least = n + 1;
        continue;
      }
      if (best.worst <= 1.0) {
        accept(best);
        plan_.status = all_excluded ? PlanStatus::kProven : PlanStatus::kReached;
        return;
      }
      all_excluded = false;
    }
    plan_.message = fmt::format("no whole numbers were found up to {}", options_.at_most);
  }

  // Whether `here` is excluded, in a share of the time that is left.
  bool targets_left(WholeDesignSearch& here, WholeDesign& best) const {
    return here.excludes(0.3 * options_.time_limit, best) && best.worst > 1.0;
  }

  void accept(const WholeDesign& design) {
    plan_.counts = design.counts;
    plan_.experiments = 0;
    for (const std::int64_t count : design.counts) plan_.experiments += count;
    for (std::size_t j = 0; j < targets_.size(); ++j) {
      plan_.standard_errors.push_back(std::sqrt(design.ratios[j]) * targets_[j].standard_error);
    }
  }

  const InformationSet& set_;
  const ConstraintsOf& constraints_of_;
  std::span<const PrecisionTarget> targets_;
  PlanOptions options_;
  ExperimentPlan plan_;
};

}  // namespace

std::string_view to_string(PlanStatus status) {
  switch (status) {
    case PlanStatus::kProven:
      return "proven";
    case PlanStatus::kReached:
      return "reached";
    case PlanStatus::kOutOfReach:
      return "out_of_reach";
    case PlanStatus::kNotFound:
      break;
  }
  return "not_found";
}

ExperimentPlan plan_experiments(const InformationSet& set, const ConstraintsOf& constraints_of,
                                std::span<const PrecisionTarget> targets,
                                const PlanOptions& options) {
  require_targets(targets);
  if (options.at_most < 1) throw InputError("at_most: at least one experiment");
  return PlanSearch(set, constraints_of, targets, options).run();
}

std::vector<PrecisionPoint> precision_curve(const InformationSet& set,
                                            const ConstraintsOf& constraints_of,
                                            std::span<const PrecisionTarget> targets,
                                            std::span<const std::int64_t> experiments,
                                            const PlanOptions& options) {
  require_targets(targets);
  const TimeLimit limit(options.time_limit);
  std::vector<PrecisionPoint> points;
  for (const std::int64_t n : experiments) {
    if (stop_requested()) break;
    WholeDesignSearch here(set, constraints_of(n), targets,
                           {.seed = options.seed, .threads = options.threads});
    const MinimaxPrecision& relaxed = here.relax(PrecisionQuestion::kValue);
    PrecisionPoint point{.experiments = n,
                         .least_ratio = std::sqrt(relaxed.lower),
                         .ratio = kInfinity,
                         .standard_errors = {}};
    const WholeDesign best = here.find(0.0);
    point.ratio = std::sqrt(best.worst);
    for (std::size_t j = 0; j < best.ratios.size(); ++j) {
      point.standard_errors.push_back(std::sqrt(best.ratios[j]) * targets[j].standard_error);
    }
    points.push_back(std::move(point));
  }
  return points;
}

}  // namespace graybox
