#include "solvers/exact/branch_and_bound.hpp"

#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "solvers/exact/exact_certificate.hpp"
#include "solvers/exact/exchange.hpp"
#include "solvers/exact/local_exchange.hpp"
#include "solvers/exact/tree_checkpoint.hpp"
#include "solvers/exact_bounds/exact_screening.hpp"
#include "solvers/exact_bounds/node_relaxation.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kBatch = 32;
constexpr std::int64_t kExchangeEvery = 64;  // nodes, after the first that many
constexpr double kSecondsBetweenCheckpoints = 60.0;
constexpr double kShareOfGap = 0.99;  // the rest is for rounding in the final judgement

// Best first, then in order of creation: std::push_heap keeps the largest in front.
bool later(const TreeNode& a, const TreeNode& b) {
  return a.bound < b.bound || (a.bound == b.bound && a.number > b.number);
}

// The checker's figures of a design, in the coordinates of the set: double precision may be wrong
// by more than the gap.
struct CheckedLogDet {
  double log_det = -kInfinity;
  double at_most = -kInfinity;
};

CheckedLogDet checked_log_det(const InformationSet& set, const Relaxation& relaxation,
                              std::int64_t experiments, std::vector<std::int64_t> counts) {
  const ExactCertificate certificate =
      certify_exact(set, {std::move(counts)}, experiments, relaxation);
  if (certificate.status != CertificateStatus::kCertified) return {};
  return {certificate.log_det, certificate.log_det + certificate.rounding_bound};
}

// Bounds nodes and improves their designs, a batch at a time, each thread with its own workspace.
// Outcomes do not depend on the number of threads.
class NodeWorkers {
 public:
  NodeWorkers(const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
              const WhitenedPool& pool, double gap, const StopClock& clock)
      : set_(set), relaxation_(relaxation), options_(options), pool_(pool), clock_(clock) {
    for (int thread = 0; thread < options.threads; ++thread) {
      workers_.push_back(std::make_unique<Worker>(Worker{
          NodeRelaxation(pool, options.experiments, gap, clock), LocalExchange(pool, clock)}));
    }
  }

  // `held_to`: the log det below which a node is given up.
  void process(const std::vector<TreeNode>& batch, double held_to,
               std::vector<NodeOutcome>& outcomes) {
    const auto count = static_cast<std::ptrdiff_t>(batch.size());
#pragma omp parallel num_threads(options_.threads)
    {
      Worker& worker = *workers_[static_cast<std::size_t>(omp_get_thread_num())];
#pragma omp for schedule(dynamic, 1)
      for (std::ptrdiff_t k = 0; k < count; ++k) {
        const auto at = static_cast<std::size_t>(k);
        process(worker, batch[at], held_to, outcomes[at]);
      }
    }
  }

  [[nodiscard]] std::int64_t newton_steps() const {
    std::int64_t steps = 0;
    for (const auto& worker : workers_) steps += worker->relaxation.newton_steps();
    return steps;
  }

  // The outcome's design, a count for each candidate of the set.
  [[nodiscard]] std::vector<std::int64_t> counts_of(const NodeOutcome& outcome) const {
    std::vector<std::int64_t> counts(set_.candidate_count(), 0);
    for (const auto& [member, count] : outcome.design) counts[pool_.candidates()[member]] = count;
    return counts;
  }

 private:
  struct Worker {
    NodeRelaxation relaxation;
    LocalExchange exchange;
  };

  void process(Worker& worker, const TreeNode& node, double held_to, NodeOutcome& outcome) const {
    outcome = {};
    outcome.stopped = clock_.stops();
    if (outcome.stopped) return;
    outcome = worker.relaxation.process(node, held_to);
    if (outcome.stopped) return;
    if (outcome.is_one_design) {
      evaluate(held_to, outcome);
    } else if (node.number < kExchangeEvery || node.number % kExchangeEvery == 0) {
      improve(worker.exchange, outcome);
    }
  }

  // A node that is one design is bounded by that design's value.
  void evaluate(double held_to, NodeOutcome& outcome) const {
    const CheckedLogDet value =
        checked_log_det(set_, relaxation_, options_.experiments, counts_of(outcome));
    const double shift = pool_.log_det_shift();
    outcome.design_log_det = value.log_det - shift;
    const double at_most =
        value.at_most - shift + std::numeric_limits<double>::epsilon() * std::abs(shift);
    outcome.bound = std::min(outcome.bound, std::max(at_most, held_to));
  }

  void improve(LocalExchange& exchange, NodeOutcome& outcome) const {
    if (outcome.design.empty() || outcome.design_log_det == -kInfinity) return;
    std::vector<std::int64_t> counts(pool_.size(), 0);
    for (const auto& [member, count] : outcome.design) counts[member] = count;
    outcome.design_log_det = exchange.improve(counts);
    outcome.design.clear();
    for (std::size_t k = 0; k < counts.size(); ++k) {
      if (counts[k] == 0) continue;
      outcome.design.emplace_back(static_cast<std::uint32_t>(k),
                                  static_cast<std::int32_t>(counts[k]));
    }
  }

  const InformationSet& set_;
  const Relaxation& relaxation_;
  const ExactOptions& options_;
  const WhitenedPool& pool_;
  const StopClock& clock_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

class Tree {
 public:
  Tree(const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
       ExactObserver* observer)
      : set_(set),
        relaxation_(relaxation),
        options_(options),
        observer_(observer),
        dimension_(static_cast<double>(set.dimension())),
        tolerance_(kShareOfGap * dimension_ * std::log1p(options.gap)),
        start_(std::chrono::steady_clock::now()),
        limit_(options.time_limit - relaxation.seconds) {}

  ExactSolution run() {
    if (options_.resume) {
      state_ = read_checkpoint(options_.checkpoint, set_, options_);
      earlier_seconds_ = state_.seconds;
      earlier_newton_steps_ = state_.newton_steps;
    } else {
      find_incumbent();
    }
    std::optional<WhitenedPool> pool;
    try {
      pool.emplace(set_, relaxation_, state_.pool, options_.threads, clock_);
    } catch (const Stopped&) {
      return solution_without_tree();
    }
    pool_ = &*pool;
    if (!options_.resume) plant(*pool);
    for (const TreeNode& node : state_.open) bytes_ += bytes_of(node);
    workers_.emplace(set_, relaxation_, options_, *pool, 0.5 * tolerance_, clock_);
    const ExactStatus status = grow();
    if (!options_.checkpoint.empty()) save();
    return solution(status);
  }

 private:
  [[nodiscard]] double checked(std::vector<std::int64_t> counts) const {
    return checked_log_det(set_, relaxation_, options_.experiments, std::move(counts)).log_det;
  }

  void find_incumbent() {
    ExchangeResult found = search_by_exchange(set_, relaxation_, options_, observer_);
    state_.incumbent = std::move(found.counts);
    state_.incumbent_log_det = checked(state_.incumbent);
    screened_ = screen_counts(relaxation_, options_.experiments, state_.incumbent_log_det);
    drop_copies(set_, screened_);
    state_.pool = screened_.candidates;
  }

  // The root: the screened box, with the relaxed optimum as its start.
  void plant(const WhitenedPool& pool) {
    auto box = std::make_shared<CountBox>();
    for (std::size_t k = 0; k < pool.size(); ++k) {
      const double weight = relaxation_.weights[pool.candidates()[k]];
      box->push_back(
          {.member = static_cast<std::uint32_t>(k),
           .lower = 0,
           .upper = screened_.upper[k],
           .start = static_cast<float>(weight * static_cast<double>(options_.experiments))});
    }
    state_.incumbent_log_det -= pool.log_det_shift();
    push({.bound = relaxation_bound(), .number = state_.created++, .box = std::move(box)});
  }

  // Bounds inside the tree are in the coordinates of the pool.
  [[nodiscard]] double relaxation_bound() const {
    return relaxation_.log_det_bound(options_.experiments) - pool_->log_det_shift();
  }
  [[nodiscard]] double threshold() const { return state_.incumbent_log_det + tolerance_; }
  [[nodiscard]] double bound() const {
    const double open = state_.open.empty() ? -kInfinity : state_.open.front().bound;
    return std::min(relaxation_bound(),
                    std::max({open, state_.given_up_bound, state_.incumbent_log_det}));
  }
  [[nodiscard]] double efficiency() const {
    return std::exp(std::min(state_.incumbent_log_det - bound(), 0.0) / dimension_);
  }
  [[nodiscard]] double seconds_of_this_run() const {
    const std::chrono::duration<double> here = std::chrono::steady_clock::now() - start_;
    return relaxation_.seconds + here.count();
  }
  [[nodiscard]] double seconds() const { return earlier_seconds_ + seconds_of_this_run(); }
  static double bytes_of(const TreeNode& node) {
    return static_cast<double>(sizeof(TreeNode) + node.box->size() * sizeof(BoxEntry) / 2);
  }

  void push(TreeNode node) {
    bytes_ += bytes_of(node);
    state_.open.push_back(std::move(node));
    std::ranges::push_heap(state_.open, &later);
  }

  TreeNode pop() {
    std::ranges::pop_heap(state_.open, &later);
    TreeNode node = std::move(state_.open.back());
    state_.open.pop_back();
    bytes_ -= bytes_of(node);
    return node;
  }

  ExactStatus grow() {
    double next_checkpoint = seconds() + kSecondsBetweenCheckpoints;
    for (;;) {
      give_up_hopeless();
      mark();
      if (state_.open.empty()) return ExactStatus::kOptimal;
      if (clock_.stops() || seconds_of_this_run() >= options_.time_limit || !report()) {
        return ExactStatus::kTimeLimit;
      }
      if (bytes_ > options_.memory_limit) return ExactStatus::kMemoryLimit;
      if (!options_.checkpoint.empty() && seconds() >= next_checkpoint) {
        save();
        next_checkpoint = seconds() + kSecondsBetweenCheckpoints;
      }
      take_batch();
      held_to_ = threshold();
      workers_->process(batch_, held_to_, outcomes_);
      merge_batch();
    }
  }

  // Once the best open node is hopeless, all are.
  void give_up_hopeless() {
    if (state_.open.empty() || state_.open.front().bound > threshold()) return;
    state_.given_up_bound = std::max(state_.given_up_bound, state_.open.front().bound);
    state_.open.clear();
    bytes_ = 0.0;
  }

  void take_batch() {
    batch_.clear();
    while (batch_.size() < kBatch && !state_.open.empty() &&
           state_.open.front().bound > threshold()) {
      batch_.push_back(pop());
    }
    outcomes_.resize(batch_.size());
  }

  void merge_batch() {
    for (std::size_t k = 0; k < batch_.size(); ++k) {
      NodeOutcome& outcome = outcomes_[k];
      if (outcome.stopped) {
        push(std::move(batch_[k]));
        continue;
      }
      ++state_.nodes;
      if (outcome.design_log_det > state_.incumbent_log_det + 1e-12) adopt(outcome);
      if (outcome.box == nullptr) {
        state_.given_up_bound = std::max(state_.given_up_bound, outcome.bound);
        continue;
      }
      if (outcome.shrunk) state_.given_up_bound = std::max(state_.given_up_bound, held_to_);
      add_half(outcome, outcome.down_bound, 0, outcome.floor);
      add_half(outcome, outcome.up_bound, outcome.floor + 1,
               std::numeric_limits<std::int32_t>::max());
    }
  }

  void add_half(const NodeOutcome& outcome, double half_bound, std::int32_t lower,
                std::int32_t upper) {
    push({.bound = half_bound,
          .number = state_.created++,
          .box = outcome.box,
          .entry = outcome.entry,
          .lower = lower,
          .upper = upper});
  }

  void adopt(const NodeOutcome& outcome) {
    std::vector<std::int64_t> counts = workers_->counts_of(outcome);
    const double log_det = checked(counts) - pool_->log_det_shift();
    if (!(log_det > state_.incumbent_log_det)) return;  // it was better by rounding
    state_.incumbent_log_det = log_det;
    state_.incumbent = std::move(counts);
  }

  void mark() {
    if (efficiency() >= kMarkedEfficiency && !std::isfinite(state_.seconds_to_mark)) {
      state_.seconds_to_mark = seconds();
    }
  }

  bool report() {
    if (observer_ == nullptr) return true;
    return observer_->on_progress({.seconds = seconds(),
                                   .nodes = state_.nodes,
                                   .open = state_.open.size(),
                                   .survivors = state_.pool.size(),
                                   .log_det = state_.incumbent_log_det + pool_->log_det_shift(),
                                   .log_det_bound = bound() + pool_->log_det_shift(),
                                   .proven_efficiency = efficiency()});
  }

  void save() {
    state_.seconds = seconds();
    state_.newton_steps = newton_steps();
    write_checkpoint(options_.checkpoint, set_, options_, state_);
  }

  [[nodiscard]] std::int64_t newton_steps() const {
    return earlier_newton_steps_ + workers_->newton_steps();
  }

  // Time was up before there was a tree: what is known is the relaxation's bound.
  ExactSolution solution_without_tree() {
    ExactSolution answer;
    answer.design.counts = state_.incumbent;
    answer.log_det_bound = relaxation_.log_det_bound(options_.experiments);
    answer.open_nodes = std::max<std::size_t>(state_.open.size(), 1);  // the root
    answer.survivors = state_.pool.size();
    answer.seconds = seconds();
    judge_exact(set_, relaxation_, options_, answer);
    if (answer.status == ExactStatus::kFeasible) answer.status = ExactStatus::kTimeLimit;
    return answer;
  }

  ExactSolution solution(ExactStatus status) {
    ExactSolution answer;
    answer.design.counts = state_.incumbent;
    answer.log_det_bound = proven_bound(answer.design);
    answer.iterations = newton_steps();
    answer.nodes = state_.nodes;
    answer.open_nodes = state_.open.size();
    answer.survivors = state_.pool.size();
    answer.seconds = seconds();
    answer.seconds_to_mark = state_.seconds_to_mark;
    judge_exact(set_, relaxation_, options_, answer);
    if (answer.status == ExactStatus::kFeasible && status != ExactStatus::kOptimal) {
      answer.status = status;
    } else if (answer.status == ExactStatus::kFeasible) {
      answer.message = "the search is complete, but rounding hides the last of the gap";
    }
    if (answer.status == ExactStatus::kSingular) {
      answer.message = status == ExactStatus::kOptimal ? "no design of that many runs is regular"
                                                       : "no regular design was found";
    }
    return answer;
  }

  // bound() in the coordinates of the set, with the incumbent's own log det from the checker: the
  // tree's figure for it is not rounded upwards.
  [[nodiscard]] double proven_bound(const ExactDesign& incumbent) const {
    const ExactCertificate value =
        certify_exact(set_, incumbent, options_.experiments, relaxation_);
    const double shift = pool_->log_det_shift();
    double searched = std::max(state_.given_up_bound,
                               state_.open.empty() ? -kInfinity : state_.open.front().bound);
    searched += shift + 4.0 * std::numeric_limits<double>::epsilon() * std::abs(shift);
    return std::min(relaxation_.log_det_bound(options_.experiments),
                    std::max(searched, value.log_det + value.rounding_bound));
  }

  const InformationSet& set_;
  const Relaxation& relaxation_;
  const ExactOptions& options_;
  ExactObserver* observer_;
  double dimension_;
  double tolerance_;
  std::chrono::steady_clock::time_point start_;
  TimeLimit limit_;
  StopClock clock_;
  double earlier_seconds_ = 0.0;
  std::int64_t earlier_newton_steps_ = 0;
  CountLimits screened_;
  const WhitenedPool* pool_ = nullptr;
  TreeState state_;
  double bytes_ = 0.0;
  double held_to_ = 0.0;  // threshold of the present batch
  std::optional<NodeWorkers> workers_;
  std::vector<TreeNode> batch_;
  std::vector<NodeOutcome> outcomes_;
};

}  // namespace

ExactSolution BranchAndBound::solve(const InformationSet& set, const Relaxation& relaxation,
                                    const ExactOptions& options, ExactObserver* observer) const {
  require_exact_problem(set, relaxation, options);
  if (options.resume && options.checkpoint.empty()) {
    throw InputError("resume needs a checkpoint to resume from");
  }
  return Tree(set, relaxation, options, observer).run();
}

}  // namespace graybox
