#include "solvers/multiplicative/multiplicative_accelerated.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "problems/kernels/kernels.hpp"
#include "solvers/column_generation/screening.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/multiplicative/reweigh_pass.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 1'000'000;
constexpr std::int64_t kStallWindow = 10'000;
constexpr double kLargestExponent = 50.0;  // of one extrapolation, either way
constexpr double kWorthCompacting = 0.1;   // share of the survivors that must be deletable
constexpr double kNegligibleShare = 1e-17;

// The candidates that are not deleted: their matrices and their places in the set.
struct Survivors {
  Survivors(const double* matrices, std::size_t count, double gap)
      : data(matrices), index(count), target_gap(gap) {
    std::iota(index.begin(), index.end(), std::size_t{0});
  }

  const double* data;
  AlignedArray copy;  // of the matrices, once some are deleted
  std::vector<std::size_t> index;
  double target_gap;  // at which all candidates are looked at
};

// A step along the path of the plain steps.
struct Extrapolation {
  std::vector<double> increment, weights, information;
  double length = 1.0, cap = 4.0;
};

struct Deletion {
  std::vector<char> keep;
  std::vector<double> scratch;
  double last_frobenius_gap = 1.0;
};

// The stall rule: log det M must have gained more than rounding in each window of iterations.
struct StallWatch {
  double last_log_det = -std::numeric_limits<double>::infinity();
  std::int64_t next_check = kStallWindow;

  [[nodiscard]] bool gains(std::int64_t iteration, double log_det) {
    if (iteration < next_check) return true;
    const double rounding =
        4.0 * std::numeric_limits<double>::epsilon() * std::max(1.0, std::abs(log_det));
    const bool has_gained = log_det > last_log_det + rounding;
    last_log_det = log_det;
    next_check = iteration + kStallWindow;
    return has_gained;
  }
};

class AcceleratedRun {
 public:
  AcceleratedRun(const InformationSet& set, const SolveOptions& options, SolveObserver* observer)
      : options_(options),
        tracer_(set, options, observer),
        conditioned_(set, kSensitivityAccuracy * options.duality_gap, tracer_),
        dimension_(static_cast<double>(set.dimension())),
        survivors_(conditioned_.set().data(), set.candidate_count(), options.duality_gap),
        weights_(set.candidate_count(), 1.0 / static_cast<double>(set.candidate_count())),
        information_(conditioned_.uniform_information().begin(),
                     conditioned_.uniform_information().end()),
        factor_(set.dimension()),
        pass_(set.dimension(), options.threads) {
    former_ = w_ = second_w_ = weights_;
    trial_.information = information_;
    if (!options.start.empty() && begin_from_start()) return;
    if (!factor_.factor(information_)) message_ = "the uniform design is singular";
  }

  Solution solve() {
    const std::int64_t limit =
        options_.iteration_limit > 0 ? options_.iteration_limit : kDefaultIterationLimit;
    while (message_.empty()) {
      std::ranges::copy(weights_, former_.begin());
      plain_step(w_);
      const double largest = *std::ranges::max_element(w_);
      const double gap = largest / dimension_ - 1.0;
      tracer_.record(gap, iteration_);
      if (gap <= std::min(survivors_.target_gap, stop_at()) && confirm()) {
        Claim claim = claim_at(options_.duality_gap, rounding());
        message_ = std::move(claim.message);
        return finish(claim.status);
      }
      if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
      if (iteration_ == limit) return finish(SolveStatus::kIterationLimit);
      ++iteration_;
      delete_candidates(largest, gap);
      if (!message_.empty()) break;
      if (std::exchange(warm_, false)) {
        blend(uniform_share(gap));
      } else {
        advance();
      }
    }
    return finish(SolveStatus::kNumericalFailure);
  }

 private:
  [[nodiscard]] std::size_t count() const { return survivors_.index.size(); }
  // The factor is that of former_; information_ has moved on by one plain step, which changes
  // little.
  [[nodiscard]] double rounding() const {
    return gap_rounding(information_, factor_.trace_dual(), conditioned_.set().dimension());
  }
  [[nodiscard]] double stop_at() const { return gap_to_stop_at(options_.duality_gap, rounding()); }
  [[nodiscard]] std::size_t packed() const { return information_.size(); }

  // lambda <- F(lambda) and its M; w: the sensitivities before the step. The factor stays behind.
  void plain_step(std::vector<double>& w) {
    pass_.run(survivors_.data, factor_.trace_dual(), weights_, w, information_);
    tracer_.count_candidates(count());
  }

  // False, with nothing changed, where the start's information matrix is singular.
  bool begin_from_start() {
    std::vector<double> first = simplex_start(options_.start);
    information_matrix(conditioned_.set(), first, trial_.information);
    tracer_.count_candidates(static_cast<std::size_t>(
        std::ranges::count_if(first, [](double weight) { return weight > 0.0; })));
    warm_ = factor_.factor(trial_.information);
    start_unused_ = !warm_;
    if (warm_) {
      weights_ = std::move(first);
      information_ = trial_.information;
    }
    return warm_;
  }

  // `share` of equal weights on the survivors, for weights of zero stay zero (warm_start.hpp).
  void blend(double share) {
    const double each = share / static_cast<double>(count());
    for (double& weight : weights_) weight = (1.0 - share) * weight + each;
    accumulate_information();
    factorise();
  }

  void accumulate_information() {
    std::ranges::fill(information_, 0.0);
    kernels().accumulate(survivors_.data, count(), packed(), weights_.data(), information_.data());
    tracer_.count_candidates(count());
  }

  void factorise() {
    if (!factor_.factor(information_)) message_ = "the information matrix became singular";
  }

  // The second plain step and the extrapolation from former_ through both.
  void advance() {
    factorise();
    if (!message_.empty()) return;
    plain_step(second_w_);
    factorise();
    if (!message_.empty()) return;
    const double plain_log_det = factor_.log_det();
    if (!stall_.gains(iteration_, plain_log_det)) {
      message_ = "no step gains in double precision any more";
    }
    if (!extrapolate()) return;
    if (factor_.factor(trial_.information) && factor_.log_det() >= plain_log_det) {
      std::swap(weights_, trial_.weights);
      std::swap(information_, trial_.information);
      if (trial_.length >= trial_.cap) trial_.cap *= 2.0;
    } else {
      trial_.cap = std::max(1.0, 0.5 * trial_.length);
      if (trial_.cap < 2.0) trial_.cap = 2.0;
      factorise();
    }
  }

  // Writes the trial; false if there is nothing to extrapolate.
  bool extrapolate() {
    trial_.weights.resize(count());
    trial_.increment.resize(count());
    double first = 0.0, second = 0.0;
    constexpr double kTiny = std::numeric_limits<double>::min();
    for (std::size_t i = 0; i < count(); ++i) {
      const double w = std::max(w_[i], kTiny), next = std::max(second_w_[i], kTiny);
      trial_.increment[i] = std::log(w / dimension_);
      trial_.weights[i] = std::log(next / w);
      first += former_[i] * trial_.increment[i] * trial_.increment[i];
      second += former_[i] * trial_.weights[i] * trial_.weights[i];
    }
    trial_.length = second > 0.0 ? std::sqrt(first / second) : trial_.cap;
    if (!(trial_.length > 1.0)) return false;
    trial_.length = std::min(trial_.length, trial_.cap);
    double total = 0.0;
    for (std::size_t i = 0; i < count(); ++i) {
      const double exponent =
          trial_.length * (2.0 * trial_.increment[i] + trial_.length * trial_.weights[i]);
      const double bounded = std::clamp(exponent, -kLargestExponent, kLargestExponent);
      trial_.weights[i] = std::max(former_[i] * std::exp(bounded), kSmallestWeight);
      total += trial_.weights[i];
    }
    for (double& weight : trial_.weights) weight /= total;
    std::ranges::fill(trial_.information, 0.0);
    kernels().accumulate(survivors_.data, count(), packed(), trial_.weights.data(),
                         trial_.information.data());
    tracer_.count_candidates(count());
    return true;
  }

  // Marks what the rules can delete by the sensitivities of former_, whose factor is at hand.
  std::size_t mark_deletable(double largest, double gap) {
    const auto d = conditioned_.set().dimension();
    const double threshold = harman_pronzato_threshold(largest, d);
    deletion_.keep.assign(count(), 1);
    std::size_t deletable = 0;
    for (std::size_t i = 0; i < count(); ++i) {
      if (w_[i] >= threshold) continue;
      deletion_.keep[i] = 0;
      ++deletable;
    }
    if (gap > 0.5 * deletion_.last_frobenius_gap) return deletable;
    deletion_.last_frobenius_gap = gap;
    const FrobeniusRule rule(largest, d);
    deletion_.scratch.resize(2 * d * d);
    std::size_t read = 0;
    for (std::size_t i = 0; i < count(); ++i) {
      // The norm is at least that of (w_i/d) I: if even that is not deletable, none is.
      if (deletion_.keep[i] == 0 || !rule.deletable(w_[i], w_[i] * w_[i] / dimension_)) continue;
      ++read;
      const double norm = squared_whitened_norm(survivors_.data + i * packed(),
                                                factor_.inverse_factor(), d, deletion_.scratch);
      if (!rule.deletable(w_[i], norm)) continue;
      deletion_.keep[i] = 0;
      ++deletable;
    }
    tracer_.count_candidates(read);
    return deletable;
  }

  void delete_candidates(double largest, double gap) {
    const std::size_t deletable = mark_deletable(largest, gap);
    if (static_cast<double>(deletable) < kWorthCompacting * static_cast<double>(count())) return;
    if (deletable == 0) return;
    compact(count() - deletable);
    double total = 0.0;
    for (const double weight : weights_) total += weight;
    for (double& weight : weights_) weight /= total;
    accumulate_information();
  }

  void compact(std::size_t survivors) {
    if (survivors_.copy.empty()) survivors_.copy = AlignedArray(survivors * packed());
    std::size_t to = 0;
    for (std::size_t from = 0; from < count(); ++from) {
      if (deletion_.keep[from] == 0) continue;
      std::copy_n(survivors_.data + from * packed(), packed(),
                  survivors_.copy.data() + to * packed());
      survivors_.index[to] = survivors_.index[from];
      weights_[to] = weights_[from];
      former_[to] = former_[from];
      w_[to] = w_[from];
      ++to;
    }
    survivors_.data = survivors_.copy.data();
    survivors_.index.resize(to);
    weights_.resize(to);
    former_.resize(to);
    w_.resize(to);
    second_w_.resize(to);
  }

  // The gap over all candidates, of the weights former_ whose factor is at hand.
  bool confirm() {
    const InformationSet& set = conditioned_.set();
    if (count() == set.candidate_count()) return true;
    all_w_.resize(set.candidate_count());
    sensitivities(set, factor_.trace_dual(), all_w_);
    tracer_.count_passes(1.0);
    const double gap = *std::ranges::max_element(all_w_) / dimension_ - 1.0;
    tracer_.record(gap, iteration_);
    if (gap <= stop_at()) return true;
    survivors_.target_gap *= 0.25;
    return false;
  }

  Solution finish(SolveStatus status) {
    // lambda_i H_i <= lambda_i w_i M: a weight with a negligible bound does not show in M.
    Design design{std::vector<double>(conditioned_.set().candidate_count(), 0.0)};
    double total = 0.0;
    for (std::size_t i = 0; i < count(); ++i) {
      if (former_[i] * std::max(w_[i], 1.0) > kNegligibleShare) total += former_[i];
    }
    for (std::size_t i = 0; i < count(); ++i) {
      if (former_[i] * std::max(w_[i], 1.0) > kNegligibleShare) {
        design.weights[survivors_.index[i]] = former_[i] / total;
      }
    }
    if (start_unused_) message_ = without_start(message_);
    return tracer_.finish(std::move(design), status, iteration_, std::move(message_));
  }

  const SolveOptions& options_;
  Tracer tracer_;
  const ConditionedSet conditioned_;
  const double dimension_;
  Survivors survivors_;
  std::vector<double> weights_;
  std::vector<double> information_;
  InverseCholesky factor_;
  ReweighPass pass_;
  std::vector<double> former_;    // weights before the iteration's first step
  std::vector<double> w_;         // their sensitivities
  std::vector<double> second_w_;  // sensitivities after the first step
  Extrapolation trial_;
  Deletion deletion_;
  StallWatch stall_;
  std::vector<double> all_w_;
  std::int64_t iteration_ = 0;
  bool warm_ = false;          // the weights are those of the start
  bool start_unused_ = false;  // it was asked for, but is singular
  std::string message_;
};

}  // namespace

Solution MultiplicativeAccelerated::solve(const InformationSet& set, const SolveOptions& options,
                                          SolveObserver* observer) const {
  return AcceleratedRun(set, options, observer).solve();
}

}  // namespace graybox
