#include "solvers/planning/experiment_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/constrained_exact/constrained_exact.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMargin = 1e-8;   // relative: of a variance that reaches its limit
constexpr int kReweightings = 12;  // of the targets, while designs are looked for
constexpr int kTreeRounds = 60;
constexpr double kShortSearch = 1.0;  // seconds of a tree that only has to find a design

struct WholeDesign {
  std::vector<std::int64_t> counts;
  std::vector<double> ratios;  // v_j
  double worst = kInfinity;    // the largest
};

// Ends a tree once it has shown that no design reaches all targets.
class UntilExcluded : public ExactObserver {
 public:
  explicit UntilExcluded(const StopClock& clock) : clock_(clock) {}
  bool on_progress(const ExactProgress& progress) override {
    return progress.log_det_bound >= -kMargin && !clock_.stops();
  }

 private:
  const StopClock& clock_;
};

// All questions about one number of experiments.
class OneNumber {
 public:
  OneNumber(const InformationSet& set, DesignConstraints constraints,
            std::span<const PrecisionTarget> targets, const PlanOptions& options)
      : set_(set), constraints_(std::move(constraints)), targets_(targets), options_(options) {
    constraints_.rows.front().lower = -kInfinity;
  }

  // Bounds of the relaxed problem.
  const MinimaxPrecision& relax(PrecisionQuestion question) {
    relaxed_ =
        solve_minimax_precision(set_, constraints_, targets_,
                                {.question = question, .gap = 1e-3, .threads = options_.threads});
    return *relaxed_;
  }

  // The best whole numbers that rounding, exchanges and a short tree find; any with no v_j above
  // `enough` will do.
  WholeDesign find(double enough) {
    if (!relaxed_.has_value()) relax(PrecisionQuestion::kValue);
    if (relaxed_->infeasible || relaxed_->efforts.empty()) return {};
    WholeDesign best;
    std::vector<std::int64_t> counts = rounded();
    if (!obeys(constraints_, counts) || !std::isfinite(measure(counts).worst)) {
      take(search(relaxed_->mu, kShortSearch).designs, best);
      if (best.counts.empty()) return best;
      counts = best.counts;
    }
    improve(std::move(counts), enough, best);
    return best;
  }

  // Whether branch and bound shows that no whole numbers reach every target; designs that it meets
  // on its way are taken. Where the weights mu of the relaxed problem leave it open, the next are
  // those of the game (minimax_precision.hpp) among the whole designs met so far. Once a mixture of
  // these reaches every target no weights exclude the number.
  bool excludes(double seconds, WholeDesign& best) {
    std::vector<double> mu = relaxed_->mu;
    std::vector<std::vector<double>> met;
    const TimeLimit limit(seconds);
    for (int round = 0; round < kTreeRounds && !stop_requested(); ++round) {
      const ConstrainedExactSolution solution = search(mu, seconds);
      take(solution.designs, best);
      if (solution.value_bound < -kMargin) return true;
      if (best.worst <= 1.0 || solution.designs.empty() || mu.size() == 1) return false;
      met.push_back(measure(solution.designs.front().counts).ratios);
      if (met.size() == 1) met.push_back(best.ratios);
      const TargetGame game = solve_target_game(met);
      if (game.shares.empty() || game.value <= 1.0) return false;
      mu = game.mu;
    }
    return false;
  }

 private:
  [[nodiscard]] WholeDesign measure(std::span<const std::int64_t> counts) const {
    const std::vector<double> efforts(counts.begin(), counts.end());
    WholeDesign design{.counts = {counts.begin(), counts.end()},
                       .ratios = target_ratios(set_, constraints_, targets_, efforts),
                       .worst = 0.0};
    design.worst = *std::ranges::max_element(design.ratios);
    return design;
  }

  static void reweight(std::span<const double> ratios, std::span<double> mu) {
    double sum = 0.0;
    for (std::size_t j = 0; j < mu.size(); ++j) sum += mu[j] *= ratios[j];
    for (double& share : mu) share /= sum;
  }

  void take(const std::vector<RankedDesign>& designs, WholeDesign& best) const {
    for (const RankedDesign& design : designs) take(measure(design.counts), best);
  }
  static void take(WholeDesign design, WholeDesign& best) {
    if (design.worst < best.worst) best = std::move(design);
  }

  // Whole parts, then one more of the largest rests as long as the constraints allow it.
  [[nodiscard]] std::vector<std::int64_t> rounded() const {
    const std::vector<double>& x = relaxed_->efforts;
    std::vector<std::int64_t> counts(x.size());
    std::vector<std::pair<double, std::size_t>> rests;
    for (std::size_t i = 0; i < x.size(); ++i) {
      counts[i] = static_cast<std::int64_t>(std::floor(x[i] + 1e-9));
      if (x[i] > static_cast<double>(counts[i])) {
        rests.emplace_back(static_cast<double>(counts[i]) - x[i], i);
      }
    }
    std::ranges::sort(rests);
    for (const auto& [rest, i] : rests) {
      ++counts[i];
      if (!obeys(constraints_, counts)) --counts[i];
    }
    return counts;
  }

  // Exchanges for weights that grow where a target is missed.
  void improve(std::vector<std::int64_t> counts, double enough, WholeDesign& best) const {
    std::vector<double> mu = relaxed_->mu;
    for (int round = 0; round < kReweightings && best.worst > enough; ++round) {
      stop_if_requested();
      const Criterion criterion = weighted_targets(targets_, mu, set_.dimension());
      DesignValue value(set_, constraints_, criterion);
      improve_by_exchange(constraints_, relaxed_->pool, value, counts);
      const WholeDesign design = measure(counts);
      if (!std::isfinite(design.worst)) return;
      reweight(design.ratios, mu);
      take(design, best);
    }
  }

  [[nodiscard]] ConstrainedExactSolution search(std::span<const double> mu, double seconds) const {
    const TimeLimit limit(seconds);
    const StopClock clock;
    UntilExcluded observer(clock);
    return solve_constrained_exact(set_, constraints_,
                                   {.gap = 1e-6,
                                    .time_limit = seconds,
                                    .seed = options_.seed,
                                    .threads = options_.threads,
                                    .criterion = weighted_targets(targets_, mu, set_.dimension()),
                                    .top = 1},
                                   &observer);
  }

  const InformationSet& set_;
  DesignConstraints constraints_;
  std::span<const PrecisionTarget> targets_;
  PlanOptions options_;
  std::optional<MinimaxPrecision> relaxed_;
};

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
      if (find_relaxed()) find_whole();
    } catch (const Stopped&) {
      plan_.message = "time was up";
      if (!plan_.counts.empty()) plan_.status = PlanStatus::kReached;
    }
    return std::move(plan_);
  }

 private:
  [[nodiscard]] OneNumber number(std::int64_t experiments) const {
    return {set_, constraints_of_(experiments), targets_, options_};
  }

  // The smallest N that the relaxed problem does not exclude, by bisection. False where it excludes
  // all.
  bool find_relaxed() {
    std::int64_t low = 0, high = options_.at_most;
    const MinimaxPrecision most = number(high).relax(PrecisionQuestion::kWhether);
    if (most.lower > 1.0 + kMargin) {
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
      (here.lower > 1.0 + kMargin ? low : high) = middle;
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
      OneNumber here = number(n);
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
  bool targets_left(OneNumber& here, WholeDesign& best) const {
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
    OneNumber here(set, constraints_of(n), targets, options);
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
