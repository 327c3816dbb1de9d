#include "solvers/planning/cost_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/planning/whole_design_search.hpp"

namespace graybox {
namespace {

constexpr int kMostImprovements = 200;
constexpr double kShareOfTime = 0.3;  // of one tree

class CheapestSearch {
 public:
  CheapestSearch(const InformationSet& set, const ConstraintsOfBudget& constraints_of,
                 std::span<const double> costs, std::span<const PrecisionTarget> targets,
                 const CheapestPlanOptions& options)
      : set_(set),
        constraints_of_(constraints_of),
        costs_(costs),
        targets_(targets),
        options_(options),
        unit_(common_unit(costs)) {}

  CheapestPlan run() {
    const TimeLimit limit(options_.time_limit);
    try {
      if (!needs_nothing() && find_relaxed() && find_first()) {
        improve();
        prove();
      }
    } catch (const Stopped&) {
      plan_.message = "time was up";
    }
    return finish();
  }

 private:
  [[nodiscard]] WholeDesignSearch with(double budget) const {
    return {set_,
            constraints_of_(budget),
            targets_,
            {.seed = options_.seed, .threads = options_.threads}};
  }

  [[nodiscard]] bool excluded(double budget) {
    const MinimaxPrecision here = with(budget).relax(PrecisionQuestion::kWhether);
    return here.lower > 1.0 + kPlanMargin;
  }

  // Whether what is known already reaches every target.
  bool needs_nothing() {
    const std::optional<WholeDesign> none =
        nothing_needed(set_, constraints_of_(options_.budget), targets_);
    if (!none.has_value()) return false;
    (void)take(*none);
    plan_.message = "what is known already reaches every target";
    return true;
  }

  // The smallest budget that the relaxed problem does not exclude, to a part of the gap. False
  // where it excludes all.
  bool find_relaxed() {
    const double fine = 0.2 * options_.gap;
    const MinimaxPrecision most = with(options_.budget).relax(PrecisionQuestion::kValue);
    if (most.lower > 1.0 + kPlanMargin) {
      plan_.status = PlanStatus::kOutOfReach;
      plan_.least_cost = options_.budget;
      plan_.worst_ratio = std::sqrt(most.lower);
      if (most.infeasible) plan_.message = "no design obeys the constraints";
      return false;
    }
    enough_ = options_.budget;
    // Without earlier information variances fall as 1/budget: the first guesses.
    for (const double guess : {most.lower * (1.0 - fine), most.upper * (1.0 + fine)}) {
      const double budget = options_.budget * std::min(guess, 1.0);
      if (budget > plan_.least_cost && budget < enough_) split(budget);
    }
    while (enough_ - plan_.least_cost > fine * enough_) {
      split(plan_.least_cost + 0.5 * (enough_ - plan_.least_cost));
    }
    return true;
  }

  void split(double budget) { (excluded(budget) ? plan_.least_cost : enough_) = budget; }

  bool take(const WholeDesign& design) {
    if (design.counts.empty() || !(design.worst <= 1.0)) return false;
    double cost = 0.0;
    for (std::size_t i = 0; i < costs_.size(); ++i) {
      cost += static_cast<double>(design.counts[i]) * costs_[i];
    }
    if (best_.has_value() && !(cost < plan_.cost)) return false;
    best_ = design;
    plan_.cost = cost;
    return true;
  }

  [[nodiscard]] bool find(double budget) { return take(with(budget).find(1.0)); }

  // Any design, by budgets that grow from the relaxed one on.
  bool find_first() {
    for (double more = 0.0;; more = 2.0 * more + 0.01) {
      const double budget = std::min(enough_ * (1.0 + more), options_.budget);
      if (find(budget)) return true;
      if (budget >= options_.budget) break;
    }
    plan_.message =
        fmt::format("no whole numbers were found up to a budget of {:g}", options_.budget);
    return false;
  }

  // The largest budget that has to be excluded to prove the present cost.
  [[nodiscard]] double goal() const {
    return unit_ > options_.gap * plan_.cost ? plan_.cost - 0.5 * unit_
                                             : plan_.cost / (1.0 + options_.gap);
  }

  // Designs that exchanges find for less, by bisection.
  void improve() {
    double without = plan_.least_cost;  // none was found with this much
    for (int round = 0; round < kMostImprovements; ++round) {
      if (goal() - without <= options_.gap * plan_.cost) return;
      const double budget = without + 0.5 * (goal() - without);
      if (!find(budget)) without = budget;
    }
  }

  // Trees, from the present goal on; each design they meet lowers it. Where one leaves its budget
  // open, smaller ones may still be excluded.
  void prove() {
    double open = 0.0;
    while (goal() > plan_.least_cost && !stop_requested()) {
      const double budget =
          open == 0.0 ? goal() : plan_.least_cost + 0.5 * (open - plan_.least_cost);
      if (open != 0.0 && open - plan_.least_cost <= options_.gap * open) return;
      WholeDesignSearch search = with(budget);
      search.relax(PrecisionQuestion::kValue);
      WholeDesign found;
      const bool is_excluded = search.excludes(kShareOfTime * options_.time_limit, found);
      const bool is_cheaper = take(found);
      if (is_excluded) {
        plan_.least_cost = budget;
      } else if (!is_cheaper) {
        open = budget;
      }
      if (is_cheaper) open = 0.0;
    }
  }

  CheapestPlan finish() {
    if (!best_.has_value()) return std::move(plan_);
    plan_.counts = best_->counts;
    for (std::size_t j = 0; j < targets_.size(); ++j) {
      plan_.standard_errors.push_back(std::sqrt(best_->ratios[j]) * targets_[j].standard_error);
    }
    const bool is_least = plan_.cost == 0.0 || plan_.least_cost >= goal();
    plan_.status = is_least ? PlanStatus::kProven : PlanStatus::kReached;
    // Between the budget that is excluded and the cost lies no multiple of the unit.
    if (is_least && plan_.cost - plan_.least_cost < unit_) plan_.least_cost = plan_.cost;
    return std::move(plan_);
  }

  const InformationSet& set_;
  const ConstraintsOfBudget& constraints_of_;
  std::span<const double> costs_;
  std::span<const PrecisionTarget> targets_;
  CheapestPlanOptions options_;
  double unit_;
  double enough_ = 0.0;  // the smallest budget that the relaxed problem is known not to exclude
  std::optional<WholeDesign> best_;
  CheapestPlan plan_;
};

}  // namespace

std::int64_t CheapestPlan::experiments() const {
  return std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
}

double common_unit(std::span<const double> numbers) {
  double scale = 1.0;
  for (int decimals = 0; decimals <= 6; ++decimals, scale *= 10.0) {
    std::int64_t unit = 0;
    const bool whole = std::ranges::all_of(numbers, [&](double number) {
      const double scaled = number * scale;
      if (!(std::abs(scaled) < 1e15)) return false;
      const double rounded = std::round(scaled);
      unit = std::gcd(unit, static_cast<std::int64_t>(rounded));
      return std::abs(scaled - rounded) <= 1e-9 * std::max(std::abs(scaled), 1.0);
    });
    if (whole) return static_cast<double>(unit) / scale;
  }
  return 0.0;
}

CheapestPlan plan_cheapest(const InformationSet& set, const ConstraintsOfBudget& constraints_of,
                           std::span<const double> costs, std::span<const PrecisionTarget> targets,
                           const CheapestPlanOptions& options) {
  if (targets.empty()) throw InputError("target: say what is to be reached, as 'sd(k1) <= 0.02'");
  if (!(options.budget > 0.0) || !std::isfinite(options.budget)) {
    throw InputError("budget: what may be spent at most, a positive number");
  }
  if (!(options.gap > 0.0)) throw InputError("gap: a positive number");
  return CheapestSearch(set, constraints_of, costs, targets, options).run();
}

}  // namespace graybox
