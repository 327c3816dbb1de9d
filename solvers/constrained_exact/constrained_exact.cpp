#include "solvers/constrained_exact/constrained_exact.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/constrained/multiplier_bound.hpp"
#include "solvers/constrained_exact/constrained_exchange.hpp"
#include "solvers/core/candidate_region.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kIntegral = 1e-6;   // an effort this close to a whole number is one
constexpr double kRounding = 1e-10;  // what (1) is raised by at least
constexpr double kNodeGap = 1e-5;    // of the relaxed problems, or a tenth of the gap asked for
constexpr double kRootGap = 1e-8;
constexpr double kBarrierGap = 1e-6;  // of the root's with E or G in the criterion
constexpr std::size_t kBatch = 16;
constexpr std::size_t kExchangePool = 400;
constexpr std::int64_t kExchangeEvery = 16;  // nodes
constexpr int kMostRoundings = 400;          // of one dive
constexpr std::size_t kMostOpen = 2'000'000;

// Limits of counts, one pair a candidate of the pool.
struct Box {
  std::vector<double> lower, upper;
};

struct Node {
  double bound = kInfinity;
  std::int64_t number = 0;
  std::shared_ptr<const Box> box;
  std::size_t entry = 0;
  double lower = 0.0, upper = kInfinity;  // of the entry
};

bool later(const Node& a, const Node& b) {
  return a.bound < b.bound || (a.bound == b.bound && a.number > b.number);
}

struct Relaxed {
  bool infeasible = false;
  bool stopped = false;
  double bound = kInfinity;   // (1)
  double value = -kInfinity;  // log Phi at the relaxed point
  std::vector<double> efforts;
  std::vector<double> reduced;  // r_i, under the logarithm
  double sum = 1.0;             // tr(G P) + bound(y)
  double rounding = kRounding;  // what (1) is raised by
};

bool has_barrier(const Criterion& criterion) {
  const auto is_smoothed = [](const Criterion& one) {
    return one.kind() == CriterionKind::kE || one.kind() == CriterionKind::kG;
  };
  return is_smoothed(criterion) ||
         std::ranges::any_of(criterion.parts(), [&](const CriterionPart& part) {
           return is_smoothed(part.criterion);
         });
}

// Whole numbers between the limits; the rows as they are.
DesignConstraints whole_limits(const DesignConstraints& constraints, std::size_t count) {
  DesignConstraints out = constraints;
  out.lower.resize(count, 0.0);
  out.upper.resize(count, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    out.lower[i] = std::ceil(constraints.lower_of(i) - kIntegral);
    out.upper[i] = std::floor(constraints.largest_effort(i) + kIntegral);
    if (out.lower[i] > out.upper[i]) {
      throw InputError(fmt::format(
          "candidate {} can be run {:g} to {:g} times, and no whole number lies between", i,
          constraints.lower_of(i), constraints.largest_effort(i)));
    }
  }
  return out;
}

DesignConstraints subset_of(const DesignConstraints& constraints,
                            std::span<const std::size_t> candidates) {
  const auto pick = [&](const std::vector<double>& values) {
    std::vector<double> out;
    for (const std::size_t i : candidates) out.push_back(values[i]);
    return out;
  };
  DesignConstraints out{.rows = {},
                        .lower = pick(constraints.lower),
                        .upper = pick(constraints.upper),
                        .prior = constraints.prior};
  for (const LinearConstraint& row : constraints.rows) {
    out.rows.push_back({row.name, pick(row.coefficients), row.lower, row.upper});
  }
  return out;
}

// The relaxed problem of a box, with its bound.
Relaxed relax(const InformationSet& set, const DesignConstraints& constraints,
              const SolveOptions& options) {
  Relaxed out;
  const ConstrainedSolution solution = try_constrained(set, constraints, options);
  out.stopped = solution.status == SolveStatus::kTimeLimit;
  // Where prior and box are singular together there is no regular design in it either.
  out.infeasible = solution.status == SolveStatus::kUnsupported;
  if (out.infeasible || solution.efforts.empty()) return out;
  out.efforts = solution.efforts;
  DesignValue value(set, constraints, options.criterion);
  out.value = value(std::span<const double>(out.efforts));
  const std::span<const double> dual = value.trace_dual(solution.sharpness);
  if (dual.empty()) return out;
  std::vector<double> gains(set.candidate_count());
  for (std::size_t i = 0; i < gains.size(); ++i) {
    const auto h = set.information(i);
    gains[i] = std::inner_product(h.begin(), h.end(), dual.begin(), 0.0);
  }
  std::vector<double> y = solution.multipliers;
  y.resize(constraints.rows.size(), 0.0);
  out.reduced.resize(gains.size());
  const auto bound = multiplier_bound<double>(constraints, {}, gains, y, out.reduced);
  const double raised = bound.multipliers[0] - (y.empty() ? 0.0 : y[0]);
  for (std::size_t i = 0; i < gains.size(); ++i) {
    out.reduced[i] -= std::max(raised, 0.0) * constraints.rows[0].coefficients[i];
  }
  out.sum = value.prior_gain() + bound.value;
  out.rounding = std::max(kRounding, value.rounding());
  out.bound = out.value + std::log(std::max(out.sum, 1e-300)) + out.rounding;
  return out;
}

// Limits that no design better than `threshold` leaves, by the reduced gains.
void tighten(const Relaxed& relaxed, double threshold, std::vector<double>& lower,
             std::vector<double>& upper) {
  const double least = std::exp(threshold - relaxed.value - relaxed.rounding);
  const double slack = relaxed.sum - least;
  if (!(slack >= 0.0) || !std::isfinite(least)) return;
  for (std::size_t i = 0; i < lower.size(); ++i) {
    const double r = relaxed.reduced[i];
    if (r < 0.0) upper[i] = std::min(upper[i], lower[i] + std::floor(slack / -r + kIntegral));
    if (r > 0.0) lower[i] = std::max(lower[i], upper[i] - std::floor(slack / r + kIntegral));
  }
}

std::size_t widest(const std::vector<double>& lower, const std::vector<double>& upper) {
  std::size_t chosen = 0;
  for (std::size_t i = 1; i < lower.size(); ++i) {
    if (upper[i] - lower[i] > upper[chosen] - lower[chosen]) chosen = i;
  }
  return chosen;
}

std::optional<std::size_t> most_fractional(std::span<const double> efforts) {
  std::optional<std::size_t> chosen;
  double most = kIntegral;
  for (std::size_t i = 0; i < efforts.size(); ++i) {
    const double fraction = std::abs(efforts[i] - std::round(efforts[i]));
    if (fraction > most) {
      most = fraction;
      chosen = i;
    }
  }
  return chosen;
}

class ConstrainedTree {
 public:
  ConstrainedTree(const InformationSet& set, const DesignConstraints& constraints,
                  const ConstrainedExactOptions& options, ExactObserver* observer)
      : set_(set),
        original_(constraints),
        whole_(whole_limits(constraints, set.candidate_count())),
        options_(options),
        observer_(observer),
        start_(std::chrono::steady_clock::now()),
        limit_(options.time_limit) {}

  ConstrainedExactSolution run();

 private:
  struct Outcome {
    bool stopped = false, done = false;
    double bound = kInfinity;
    std::shared_ptr<Box> box;
    std::size_t entry = 0;
    double floor = 0.0;
    std::optional<RankedDesign> design;  // of the pool
  };

  [[nodiscard]] SolveOptions relaxed_options() const {
    SolveOptions options;
    options.duality_gap = std::max(1e-9, std::min(kNodeGap, 0.1 * options_.gap));
    options.criterion = options_.criterion;
    options.seed = options_.seed;
    return options;
  }
  [[nodiscard]] double tolerance() const { return 0.99 * std::log1p(options_.gap); }
  // The value of the K-th best, which the tree has to beat.
  [[nodiscard]] double worst_kept() const {
    return designs_.size() < options_.top ? -kInfinity : designs_.back().value;
  }
  [[nodiscard]] double threshold() const { return worst_kept() + tolerance(); }
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  [[nodiscard]] bool is_regular(const std::vector<std::int64_t>& counts) const;
  void offer(RankedDesign design);
  std::optional<std::vector<std::int64_t>> dive(const InformationSet& set,
                                                DesignConstraints constraints,
                                                std::vector<double> efforts) const;
  void find_first(const Relaxed& root);
  void plant(const Relaxed& root);
  [[nodiscard]] RankedDesign widened(const RankedDesign& of_pool) const;
  Outcome process(const Node& node) const;
  void improve(Outcome& outcome, const Box& box, std::span<const double> efforts,
               std::int64_t number) const;
  void take_whole(const Relaxed& relaxed, Outcome& outcome) const;
  bool report();
  void grow();
  void merge(Node& node, Outcome& outcome);
  ConstrainedExactSolution finish();

  const InformationSet& set_;
  const DesignConstraints& original_;
  DesignConstraints whole_;
  const ConstrainedExactOptions& options_;
  ExactObserver* observer_;
  std::chrono::steady_clock::time_point start_;
  TimeLimit limit_;
  StopClock clock_;
  double root_bound_ = kInfinity;
  double given_up_ = -kInfinity;  // largest bound of what was given up
  std::vector<RankedDesign> designs_;
  std::vector<std::size_t> pool_;
  std::unique_ptr<InformationSet> pool_set_;
  DesignConstraints pool_constraints_;
  std::vector<std::size_t> exchange_pool_;
  std::vector<Node> open_;
  std::int64_t created_ = 0, nodes_ = 0;
  bool stopped_ = false;
};

// Double precision finds some singular sums regular.
bool ConstrainedTree::is_regular(const std::vector<std::int64_t>& counts) const {
  std::vector<std::size_t> run;
  std::vector<Extended> weights;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    run.push_back(i);
    weights.push_back(static_cast<Extended>(counts[i]));
  }
  const std::size_t p = set_.packed_size();
  AlignedArray packed((run.size() + 1) * p, 0.0);
  for (std::size_t k = 0; k < run.size(); ++k) {
    std::ranges::copy(set_.information(run[k]), packed.data() + k * p);
  }
  std::ranges::copy(whole_.prior, packed.data() + run.size() * p);
  weights.push_back(1);
  const InformationSet support(set_.dimension(), std::move(packed));
  return ExtendedInformation(support, weights).regular();
}

// Keeps the K best, all different.
void ConstrainedTree::offer(RankedDesign design) {
  if (!std::isfinite(design.value) || !is_regular(design.counts)) return;
  for (const RankedDesign& kept : designs_) {
    if (kept.counts == design.counts) return;
  }
  designs_.push_back(std::move(design));
  std::ranges::stable_sort(designs_, std::ranges::greater(), &RankedDesign::value);
  if (designs_.size() > options_.top) designs_.pop_back();
}

// Rounds one count at a time, the most nearly whole first, and solves again after each.
std::optional<std::vector<std::int64_t>> ConstrainedTree::dive(const InformationSet& set,
                                                               DesignConstraints constraints,
                                                               std::vector<double> efforts) const {
  SolveOptions rough = relaxed_options();
  rough.duality_gap = 1e-3;
  for (int tries = 0; tries < kMostRoundings && !clock_.stops(); ++tries) {
    std::optional<std::size_t> chosen;
    double nearest = 1.0;
    for (std::size_t i = 0; i < efforts.size(); ++i) {
      const double fraction = std::abs(efforts[i] - std::round(efforts[i]));
      if (constraints.lower[i] == constraints.upper[i] || fraction <= kIntegral) continue;
      const double distance = 1.0 - std::max(efforts[i] - std::floor(efforts[i]), fraction);
      if (distance < nearest) {
        nearest = distance;
        chosen = i;
      }
    }
    if (!chosen) {
      std::vector<std::int64_t> counts;
      for (const double x : efforts) counts.push_back(std::llround(x));
      if (obeys(constraints, counts)) return counts;
      return std::nullopt;
    }
    const double x = efforts[*chosen];
    const double up = std::ceil(x), down = std::floor(x);
    const double lower = constraints.lower[*chosen], upper = constraints.upper[*chosen];
    bool solved = false;
    for (const double count : {up, down}) {  // a run more is rounded up to first
      constraints.lower[*chosen] = count == up ? count : lower;
      constraints.upper[*chosen] = count == up ? upper : count;
      const ConstrainedSolution next = try_constrained(set, constraints, rough);
      if (next.infeasible || next.efforts.empty()) continue;
      efforts = next.efforts;
      solved = true;
      break;
    }
    if (!solved) return std::nullopt;
  }
  return std::nullopt;
}

// A design from the root's relaxed point, on the candidates that matter there.
void ConstrainedTree::find_first(const Relaxed& root) {
  const std::size_t count = set_.candidate_count();
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto worth = [&](std::size_t i) {
    return root.efforts[i] > 0.0 || whole_.lower[i] > 0.0 ? kInfinity : root.reduced[i];
  };
  const auto run = static_cast<std::size_t>(
      std::ranges::count_if(root.efforts, [](double x) { return x > 0.0; }));
  const std::size_t wanted = std::min(count, 2 * run + 8 * set_.dimension());
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return worth(a) > worth(b); });
  order.resize(wanted);
  std::ranges::sort(order);
  const InformationSet few = set_.subset(order);
  const DesignConstraints constraints = subset_of(whole_, order);
  std::vector<double> efforts;
  for (const std::size_t i : order) efforts.push_back(root.efforts[i]);
  auto counts = dive(few, constraints, std::move(efforts));
  if (!counts) return;
  std::vector<std::size_t> all(order.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  DesignValue value(few, constraints, options_.criterion);
  RankedDesign design{.counts = std::vector<std::int64_t>(count, 0), .value = 0.0};
  design.value = improve_by_exchange(constraints, all, value, *counts);
  for (std::size_t k = 0; k < order.size(); ++k) design.counts[order[k]] = (*counts)[k];
  offer(std::move(design));
}

// What the root leaves: the pool, its constraints, and the first node.
void ConstrainedTree::plant(const Relaxed& root) {
  if (std::isfinite(worst_kept())) {
    const double given_up = threshold();
    std::vector<double> lower = whole_.lower, upper = whole_.upper;
    tighten(root, given_up, lower, upper);
    if (lower != whole_.lower || upper != whole_.upper) given_up_ = given_up;
    whole_.lower = std::move(lower);
    whole_.upper = std::move(upper);
  }
  for (std::size_t i = 0; i < set_.candidate_count(); ++i) {
    if (whole_.upper[i] > 0.0) pool_.push_back(i);
  }
  if (pool_.empty()) return;
  pool_set_ = std::make_unique<InformationSet>(set_.subset(pool_));
  pool_constraints_ = subset_of(whole_, pool_);
  std::vector<std::size_t> order(pool_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return root.reduced[pool_[a]] > root.reduced[pool_[b]];
  });
  order.resize(std::min(order.size(), kExchangePool));
  exchange_pool_ = order;
  auto box = std::make_shared<Box>(Box{pool_constraints_.lower, pool_constraints_.upper});
  open_.push_back({.bound = root_bound_, .number = created_++, .box = std::move(box)});
}

RankedDesign ConstrainedTree::widened(const RankedDesign& of_pool) const {
  RankedDesign out{.counts = std::vector<std::int64_t>(set_.candidate_count(), 0),
                   .value = of_pool.value};
  for (std::size_t k = 0; k < pool_.size(); ++k) out.counts[pool_[k]] = of_pool.counts[k];
  return out;
}

// A design near the relaxed point of a node: rounded within the box, then exchanged within all.
void ConstrainedTree::improve(Outcome& outcome, const Box& box, std::span<const double> efforts,
                              std::int64_t number) const {
  if (number >= kExchangeEvery && number % kExchangeEvery != 0) return;
  DesignConstraints constraints = pool_constraints_;
  constraints.lower = box.lower;
  constraints.upper = box.upper;
  auto counts = dive(*pool_set_, constraints, {efforts.begin(), efforts.end()});
  if (!counts) return;
  DesignValue value(*pool_set_, pool_constraints_, options_.criterion);
  const double reached = improve_by_exchange(pool_constraints_, exchange_pool_, value, *counts);
  outcome.design = RankedDesign{std::move(*counts), reached};
}

ConstrainedTree::Outcome ConstrainedTree::process(const Node& node) const {
  Outcome outcome;
  outcome.box = std::make_shared<Box>(*node.box);
  Box& box = *outcome.box;
  box.lower[node.entry] = std::max(box.lower[node.entry], node.lower);
  box.upper[node.entry] = std::min(box.upper[node.entry], node.upper);
  DesignConstraints constraints = pool_constraints_;
  constraints.lower = box.lower;
  constraints.upper = box.upper;
  const Relaxed relaxed = relax(*pool_set_, constraints, relaxed_options());
  outcome.stopped = relaxed.stopped || clock_.stops();
  outcome.bound = std::min(node.bound, relaxed.infeasible ? -kInfinity : relaxed.bound);
  outcome.done = relaxed.infeasible || outcome.bound <= threshold();
  if (outcome.stopped || outcome.done) return outcome;
  if (relaxed.efforts.empty()) {  // no bound: halved where it is widest
    outcome.entry = widest(box.lower, box.upper);
    outcome.floor = std::floor(0.5 * (box.lower[outcome.entry] + box.upper[outcome.entry]));
    outcome.done = box.upper[outcome.entry] <= box.lower[outcome.entry];
    return outcome;
  }
  tighten(relaxed, threshold(), box.lower, box.upper);
  if (const std::optional<std::size_t> entry = most_fractional(relaxed.efforts)) {
    outcome.entry = *entry;
    improve(outcome, box, relaxed.efforts, node.number);
  } else {
    outcome.entry = widest(box.lower, box.upper);
    take_whole(relaxed, outcome);
  }
  const double lower = box.lower[outcome.entry], upper = box.upper[outcome.entry];
  outcome.floor = std::clamp(std::floor(relaxed.efforts[outcome.entry] + kIntegral), lower,
                             std::max(lower, upper - 1.0));
  return outcome;
}

// A relaxed point of whole numbers: the best of its box, but perhaps not the only one wanted.
void ConstrainedTree::take_whole(const Relaxed& relaxed, Outcome& outcome) const {
  std::vector<std::int64_t> counts;
  for (const double x : relaxed.efforts) counts.push_back(std::llround(x));
  DesignValue value(*pool_set_, pool_constraints_, options_.criterion);
  const double reached = value(std::span<const std::int64_t>(counts));
  if (obeys(pool_constraints_, counts)) outcome.design = RankedDesign{std::move(counts), reached};
  const bool alone = outcome.box->upper[outcome.entry] <= outcome.box->lower[outcome.entry];
  const bool proven = outcome.design && outcome.bound <= reached + tolerance();
  if (alone) {
    const double left = outcome.design ? reached + kRounding : -kInfinity;
    outcome.bound = std::min(outcome.bound, left);
  }
  outcome.done = alone || (proven && options_.top == 1);
}

bool ConstrainedTree::report() {
  if (observer_ == nullptr) return true;
  const double best = designs_.empty() ? -kInfinity : designs_.front().value;
  const double d = static_cast<double>(set_.dimension());
  const double bound = open_.empty() ? best : open_.front().bound;
  return observer_->on_progress({.seconds = seconds(),
                                 .nodes = nodes_,
                                 .open = open_.size(),
                                 .survivors = pool_.size(),
                                 .log_det = d * best,
                                 .log_det_bound = d * bound,
                                 .proven_efficiency = std::exp(std::min(best - bound, 0.0))});
}

void ConstrainedTree::merge(Node& node, Outcome& outcome) {
  if (outcome.stopped) {
    open_.push_back(std::move(node));
    std::ranges::push_heap(open_, &later);
    return;
  }
  ++nodes_;
  if (outcome.design) offer(widened(*outcome.design));
  if (outcome.done) {
    given_up_ = std::max(given_up_, outcome.bound);
    return;
  }
  // What the limits of the box gave up may be as good as the threshold that they were held to.
  given_up_ = std::max(given_up_, std::min(outcome.bound, threshold()));
  for (const bool upper : {false, true}) {
    Node half{
        .bound = outcome.bound, .number = created_++, .box = outcome.box, .entry = outcome.entry};
    (upper ? half.lower : half.upper) = outcome.floor + (upper ? 1.0 : 0.0);
    open_.push_back(std::move(half));
    std::ranges::push_heap(open_, &later);
  }
}

void ConstrainedTree::grow() {
  std::vector<Node> batch;
  std::vector<Outcome> outcomes;
  while (!open_.empty() && open_.front().bound > threshold()) {
    if (clock_.stops() || !report() || open_.size() > kMostOpen) {
      stopped_ = true;
      return;
    }
    batch.clear();
    while (batch.size() < kBatch && !open_.empty() && open_.front().bound > threshold()) {
      std::ranges::pop_heap(open_, &later);
      batch.push_back(std::move(open_.back()));
      open_.pop_back();
    }
    outcomes.assign(batch.size(), {});
    const auto count = static_cast<std::ptrdiff_t>(batch.size());
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic, 1)
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const auto at = static_cast<std::size_t>(k);
      if (clock_.stops()) {
        outcomes[at].stopped = true;
      } else {
        outcomes[at] = process(batch[at]);
      }
    }
    for (std::size_t k = 0; k < batch.size(); ++k) merge(batch[k], outcomes[k]);
  }
  if (!open_.empty()) given_up_ = std::max(given_up_, open_.front().bound);
  open_.clear();
}

ConstrainedExactSolution ConstrainedTree::finish() {
  ConstrainedExactSolution out;
  out.nodes = nodes_;
  out.open_nodes = open_.size();
  out.survivors = pool_.size();
  const double searched = std::max(given_up_, open_.empty() ? -kInfinity : open_.front().bound);
  out.last_bound = std::min(root_bound_, searched);
  const double best = designs_.empty() ? -kInfinity : designs_.front().value;
  out.value_bound = std::min(root_bound_, std::max(searched, best + kRounding));
  out.designs = std::move(designs_);
  out.seconds = seconds();
  if (out.designs.empty()) {
    out.status = stopped_ ? ExactStatus::kTimeLimit : ExactStatus::kSingular;
    out.message = stopped_ ? "no design was found in time"
                           : "no whole numbers of experiments obey the constraints and are regular";
  } else if (out.value_bound <= best + std::log1p(options_.gap)) {
    out.status = ExactStatus::kOptimal;
  } else {
    out.status = open_.size() > kMostOpen ? ExactStatus::kMemoryLimit : ExactStatus::kTimeLimit;
  }
  return out;
}

ConstrainedExactSolution ConstrainedTree::run() {
  SolveOptions options = relaxed_options();
  options.duality_gap = has_barrier(options_.criterion) ? kBarrierGap : kRootGap;
  options.threads = options_.threads;
  const ConstrainedSolution first = try_constrained(set_, whole_, options);
  if (first.infeasible) {
    options.criterion = {};
    (void)solve_constrained(set_, original_, options);  // names what contradicts each other
    ConstrainedExactSolution none;
    none.message = "no whole numbers of experiments obey the constraints";
    return none;
  }
  const Relaxed root = relax(set_, whole_, options);
  if (root.reduced.empty()) {
    ConstrainedExactSolution none;
    none.status = root.stopped ? ExactStatus::kTimeLimit : ExactStatus::kSingular;
    none.message = root.stopped ? "time was up before the first bound"
                                : "prior and candidates together are singular";
    return none;
  }
  root_bound_ = root.bound;
  find_first(root);
  plant(root);
  grow();
  return finish();
}

}  // namespace

ConstrainedExactSolution solve_constrained_exact(const InformationSet& set,
                                                 const DesignConstraints& constraints,
                                                 const ConstrainedExactOptions& options,
                                                 ExactObserver* observer) {
  options.criterion.require_fits(set);
  require_fits(constraints, set);
  if (!(options.gap >= 1e-9) || options.top < 1) {
    throw InputError("gap must be at least 1e-9, and top at least 1");
  }
  ConstrainedExactOptions with_regions = options;
  with_regions.criterion = over_candidates(options.criterion, set);
  return ConstrainedTree(set, constraints, with_regions, observer).run();
}

}  // namespace graybox
