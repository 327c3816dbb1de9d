#include "solvers/planning/target_tree.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/stop.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"

namespace graybox {
namespace {

constexpr double kReach = 1e-8;  // relative: of a variance that reaches its limit
constexpr double kWhole = 1e-6;  // a count that is this close to a whole number is one
constexpr std::size_t kMostOpen = 200'000;

// Limits of single candidates, within those of the tree.
struct CountBox {
  std::vector<std::pair<std::size_t, double>> lower, upper;
  std::vector<double> mu;
};

class TreeSearch {
 public:
  TreeSearch(const InformationSet& set, const DesignConstraints& constraints,
             std::span<const PrecisionTarget> targets, int threads)
      : set_(set), constraints_(constraints), targets_(targets), threads_(threads) {
    const std::size_t count = set.candidate_count();
    lower_.resize(count);
    upper_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      lower_[i] = std::ceil(constraints.lower_of(i) - kWhole);
      upper_[i] = std::floor(constraints.largest_effort(i) + kWhole);
    }
  }

  TargetTreeResult run(std::span<const double> mu) {
    open_.push_back({{}, {}, {mu.begin(), mu.end()}});
    try {
      while (!open_.empty() && result_.counts.empty()) {
        stop_if_requested();
        if (open_.size() > kMostOpen) return std::move(result_);
        const CountBox box = std::move(open_.back());
        open_.pop_back();
        ++result_.nodes;
        visit(box);
      }
    } catch (const Stopped&) {
      return std::move(result_);
    }
    result_.answer = result_.counts.empty() ? TreeAnswer::kNone : TreeAnswer::kFound;
    return std::move(result_);
  }

 private:
  void visit(const CountBox& box) {
    DesignConstraints here = constraints_;
    here.lower = lower_;
    here.upper = upper_;
    for (const auto& [i, value] : box.lower) here.lower[i] = std::max(here.lower[i], value);
    for (const auto& [i, value] : box.upper) here.upper[i] = std::min(here.upper[i], value);
    for (std::size_t i = 0; i < here.lower.size(); ++i) {
      if (here.lower[i] > here.upper[i]) return;
    }
    const bool any = std::ranges::any_of(here.lower, [](double l) { return l > 0.0; });
    const DesignConstraints box_limits = here;
    if (!any) here.lower.clear();
    MinimaxPrecision relaxed = solve_minimax_precision(set_, here, targets_,
                                                       {.question = PrecisionQuestion::kWhether,
                                                        .gap = 1e-3,
                                                        .threads = threads_,
                                                        .start = box.mu});
    if (relaxed.infeasible || relaxed.singular || relaxed.lower > 1.0 + kReach) return;
    if (relaxed.efforts.empty()) return halve(box, box_limits);
    if (takes_rounded(relaxed.efforts)) return;
    branch(box, box_limits, relaxed);
  }

  // Whether whole parts, and one more of the largest rests as long as the constraints allow it,
  // reach the targets.
  bool takes_rounded(std::span<const double> efforts) {
    std::vector<std::int64_t> counts(efforts.size());
    std::vector<std::pair<double, std::size_t>> rests;
    for (std::size_t i = 0; i < efforts.size(); ++i) {
      counts[i] = static_cast<std::int64_t>(std::floor(efforts[i] + kWhole));
      const double rest = efforts[i] - static_cast<double>(counts[i]);
      if (rest > kWhole) rests.emplace_back(-rest, i);
    }
    std::ranges::sort(rests);
    for (const auto& [rest, i] : rests) {
      ++counts[i];
      if (!obeys(constraints_, counts)) --counts[i];
    }
    if (!obeys(constraints_, counts)) return false;
    const std::vector<double> whole(counts.begin(), counts.end());
    const std::vector<double> ratios = target_ratios(set_, constraints_, targets_, whole);
    if (!(*std::ranges::max_element(ratios) <= 1.0)) return false;
    result_.counts = std::move(counts);
    return true;
  }

  // Where the relaxed problem was not solved: a box of one design is tried, others are cut in two.
  void halve(const CountBox& box, const DesignConstraints& limits) {
    std::size_t widest = 0;
    for (std::size_t i = 0; i < limits.lower.size(); ++i) {
      const double width = limits.upper[i] - limits.lower[i];
      if (width > limits.upper[widest] - limits.lower[widest]) widest = i;
    }
    if (limits.upper[widest] == limits.lower[widest]) {
      (void)takes_rounded(limits.lower);
      return;
    }
    const double middle = std::floor(0.5 * (limits.lower[widest] + limits.upper[widest]));
    CountBox below = box, above = box;
    below.upper.emplace_back(widest, middle);
    above.lower.emplace_back(widest, middle + 1.0);
    open_.push_back(std::move(above));
    open_.push_back(std::move(below));
  }

  // The half that the relaxed design is closer to is visited first.
  void branch(const CountBox& box, const DesignConstraints& limits,
              const MinimaxPrecision& relaxed) {
    std::size_t split = 0;
    double farthest = kWhole;
    for (std::size_t i = 0; i < relaxed.efforts.size(); ++i) {
      const double distance = std::abs(relaxed.efforts[i] - std::round(relaxed.efforts[i]));
      if (distance > farthest) {
        farthest = distance;
        split = i;
      }
    }
    if (farthest == kWhole) return branch_at_whole(box, limits, relaxed);
    const double value = relaxed.efforts[split];
    CountBox below = box, above = box;
    below.mu = above.mu = relaxed.mu;
    below.upper.emplace_back(split, std::floor(value));
    above.lower.emplace_back(split, std::ceil(value));
    const bool above_first = value - std::floor(value) > 0.5;
    open_.push_back(above_first ? std::move(below) : std::move(above));
    open_.push_back(above_first ? std::move(above) : std::move(below));
  }

  // A whole design that misses a target by less than the relaxed bound tells: it, and what differs
  // from it in one count.
  void branch_at_whole(const CountBox& box, const DesignConstraints& limits,
                       const MinimaxPrecision& relaxed) {
    for (std::size_t i = 0; i < limits.lower.size(); ++i) {
      if (limits.lower[i] == limits.upper[i]) continue;
      const double value = std::round(relaxed.efforts[i]);
      CountBox same = box;
      same.mu = relaxed.mu;
      CountBox below = same, above = same;
      below.upper.emplace_back(i, value - 1.0);
      above.lower.emplace_back(i, value + 1.0);
      same.lower.emplace_back(i, value);
      same.upper.emplace_back(i, value);
      open_.push_back(std::move(below));
      open_.push_back(std::move(above));
      open_.push_back(std::move(same));
      return;
    }
  }

  const InformationSet& set_;
  const DesignConstraints& constraints_;
  std::span<const PrecisionTarget> targets_;
  int threads_;
  std::vector<double> lower_, upper_;
  std::vector<CountBox> open_;
  TargetTreeResult result_;
};

}  // namespace

TargetTreeResult search_target_tree(const InformationSet& set, const DesignConstraints& constraints,
                                    std::span<const PrecisionTarget> targets,
                                    std::span<const double> mu, int threads) {
  return TreeSearch(set, constraints, targets, threads).run(mu);
}

}  // namespace graybox
