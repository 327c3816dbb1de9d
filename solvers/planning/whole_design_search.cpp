#include "solvers/planning/whole_design_search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"
#include "solvers/planning/target_tree.hpp"

namespace graybox {
namespace {

constexpr int kReweightings = 12;  // of the targets, while designs are looked for
constexpr int kTreeRounds = 60;
constexpr double kShareOfOneMu = 0.2;  // of the time to exclude something
constexpr double kShortSearch = 1.0;   // seconds of a tree that only has to find a design

// Ends a tree once it has shown that no design reaches all targets.
class UntilExcluded : public ExactObserver {
 public:
  explicit UntilExcluded(const StopClock& clock) : clock_(clock) {}
  bool on_progress(const ExactProgress& progress) override {
    return progress.log_det_bound >= -kPlanMargin && !clock_.stops();
  }

 private:
  const StopClock& clock_;
};

void reweight(std::span<const double> ratios, std::span<double> mu) {
  double sum = 0.0;
  for (std::size_t j = 0; j < mu.size(); ++j) sum += mu[j] *= ratios[j];
  for (double& share : mu) share /= sum;
}

void take_better(WholeDesign design, WholeDesign& best) {
  if (design.worst < best.worst) best = std::move(design);
}

}  // namespace

std::optional<WholeDesign> nothing_needed(const InformationSet& set,
                                          const DesignConstraints& constraints,
                                          std::span<const PrecisionTarget> targets) {
  WholeDesign design;
  design.counts.assign(set.candidate_count(), 0);
  DesignConstraints any_number = constraints;
  any_number.rows.front().lower = -std::numeric_limits<double>::infinity();
  if (constraints.prior.empty() || !obeys(any_number, design.counts)) return std::nullopt;
  const std::vector<double> efforts(design.counts.begin(), design.counts.end());
  design.ratios = target_ratios(set, constraints, targets, efforts);
  design.worst = *std::ranges::max_element(design.ratios);
  if (!(design.worst <= 1.0)) return std::nullopt;
  return design;
}

WholeDesignSearch::WholeDesignSearch(const InformationSet& set, DesignConstraints constraints,
                                     std::span<const PrecisionTarget> targets,
                                     const WholeSearchOptions& options)
    : set_(set), constraints_(std::move(constraints)), targets_(targets), options_(options) {
  constraints_.rows.front().lower = -std::numeric_limits<double>::infinity();
}

const MinimaxPrecision& WholeDesignSearch::relax(PrecisionQuestion question) {
  relaxed_ =
      solve_minimax_precision(set_, constraints_, targets_,
                              {.question = question, .gap = 1e-3, .threads = options_.threads});
  if (relaxed_->singular) {
    throw InputError(
        "prior and candidates together are singular: no design can estimate all parameters");
  }
  return *relaxed_;
}

WholeDesign WholeDesignSearch::find(double enough) {
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

// One mu for the whole tree first, then, with several targets, a mu for each node.
bool WholeDesignSearch::excludes(double seconds, WholeDesign& best) {
  const bool is_one = targets_.size() == 1;
  if (excludes_by_one_mu(is_one ? seconds : kShareOfOneMu * seconds, best)) return true;
  if (best.worst <= 1.0 || is_one || stop_requested()) return false;
  const TimeLimit limit((1.0 - kShareOfOneMu) * seconds);
  const TargetTreeResult tree =
      search_target_tree(set_, constraints_, targets_, relaxed_->mu, options_.threads);
  if (tree.answer == TreeAnswer::kFound) take_better(measure(tree.counts), best);
  return tree.answer == TreeAnswer::kNone;
}

// Whether branch and bound shows that no whole numbers reach every target; designs that it meets
// on its way are taken. Where the weights mu of the relaxed problem leave it open, the next are
// those of the game (minimax_precision.hpp) among the whole designs met so far. Once a mixture of
// these reaches every target no weights exclude the number.
bool WholeDesignSearch::excludes_by_one_mu(double seconds, WholeDesign& best) {
  std::vector<double> mu = relaxed_->mu;
  std::vector<std::vector<double>> met;
  const TimeLimit limit(seconds);
  for (int round = 0; round < kTreeRounds && !stop_requested(); ++round) {
    const ConstrainedExactSolution solution = search(mu, seconds);
    take(solution.designs, best);
    if (solution.value_bound < -kPlanMargin) return true;
    if (best.worst <= 1.0 || solution.designs.empty() || mu.size() == 1) return false;
    met.push_back(measure(solution.designs.front().counts).ratios);
    if (met.size() == 1) met.push_back(best.ratios);
    const TargetGame game = solve_target_game(met);
    if (game.shares.empty() || game.value <= 1.0) return false;
    mu = game.mu;
  }
  return false;
}

WholeDesign WholeDesignSearch::measure(std::span<const std::int64_t> counts) const {
  const std::vector<double> efforts(counts.begin(), counts.end());
  WholeDesign design{.counts = {counts.begin(), counts.end()},
                     .ratios = target_ratios(set_, constraints_, targets_, efforts),
                     .worst = 0.0};
  design.worst = *std::ranges::max_element(design.ratios);
  return design;
}

void WholeDesignSearch::take(const std::vector<RankedDesign>& designs, WholeDesign& best) const {
  for (const RankedDesign& design : designs) take_better(measure(design.counts), best);
}

// Whole parts, then one more of the largest rests as long as the constraints allow it.
std::vector<std::int64_t> WholeDesignSearch::rounded() const {
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
void WholeDesignSearch::improve(std::vector<std::int64_t> counts, double enough,
                                WholeDesign& best) const {
  std::vector<double> mu = relaxed_->mu;
  for (int round = 0; round < kReweightings && best.worst > enough; ++round) {
    stop_if_requested();
    const Criterion criterion = weighted_targets(targets_, mu, set_.dimension());
    DesignValue value(set_, constraints_, criterion);
    improve_by_exchange(constraints_, relaxed_->pool, value, counts);
    const WholeDesign design = measure(counts);
    if (!std::isfinite(design.worst)) return;
    reweight(design.ratios, mu);
    take_better(design, best);
  }
}

ConstrainedExactSolution WholeDesignSearch::search(std::span<const double> mu,
                                                   double seconds) const {
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

}  // namespace graybox
