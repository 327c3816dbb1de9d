#include "solvers/nlopt/nlopt_weights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <utility>
#include <vector>

#include "problems/kernels/kernels.hpp"
#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/nlopt/nlopt_handle.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultEvaluationLimit = 200000;
constexpr std::int64_t kEvaluationsWithoutProgress = 2000;
constexpr unsigned kLbfgsVectors = 10;

class WeightRun {
 public:
  WeightRun(const InformationSet& set, const SolveOptions& options, SolveObserver* observer)
      : options_(options),
        tracer_(set, options, observer),
        normalized_(set, {.scale_rows = false, .threads = options.threads}),
        count_(set.candidate_count()),
        evaluation_limit_(options.iteration_limit > 0 ? options.iteration_limit
                                                      : kDefaultEvaluationLimit),
        roots_(count_),
        squares_(count_),
        sensitivities_(count_),
        matrix_(set.packed_size()),
        best_(count_, 1.0 / static_cast<double>(count_)) {
    tracer_.count_passes(normalized_.passes());
  }

  Solution solve(nlopt_algorithm algorithm);

 private:
  static double objective(unsigned, const double* roots, double* gradient, void* run) {
    return static_cast<WeightRun*>(run)->evaluate(roots, gradient);
  }
  double evaluate(const double* roots, double* gradient);
  void judge(double sum);
  [[nodiscard]] bool begin_from_start();
  [[nodiscard]] nlopt_result start(nlopt_algorithm algorithm);
  [[nodiscard]] bool met() const { return best_gap_ <= options_.duality_gap; }
  [[nodiscard]] bool limited() const {
    return evaluations_ >= evaluation_limit_ || tracer_.out_of_time();
  }

  const SolveOptions& options_;
  Tracer tracer_;
  NormalizedSet normalized_;
  std::size_t count_;
  std::int64_t evaluation_limit_;
  std::int64_t evaluations_ = 0;
  std::int64_t last_progress_ = 0;  // evaluation at which the gap had last fallen by a tenth
  double progress_gap_ = std::numeric_limits<double>::infinity();
  std::vector<double> roots_;  // u
  std::vector<double> squares_;
  std::vector<double> sensitivities_;
  std::vector<double> matrix_;
  InverseFactor inverse_;
  std::vector<double> best_;
  double best_gap_ = std::numeric_limits<double>::infinity();
  nlopt_opt running_ = nullptr;
};

double WeightRun::evaluate(const double* roots, double* gradient) {
  if (evaluations_ >= evaluation_limit_) {
    // A method may finish its line search before it looks at the request to stop.
    if (gradient != nullptr) std::fill_n(gradient, count_, 0.0);
    return std::numeric_limits<double>::infinity();
  }
  ++evaluations_;
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    squares_[i] = roots[i] * roots[i];
    sum += squares_[i];
  }
  std::ranges::fill(matrix_, 0.0);
  kernels().accumulate(normalized_.rows(), count_, matrix_.size(), squares_.data(), matrix_.data());
  tracer_.count_passes(1.0);
  double value = std::numeric_limits<double>::infinity();
  if (invert(matrix_, normalized_.dimension(), inverse_)) {
    kernels().price(normalized_.rows(), count_, matrix_.size(), inverse_.trace_dual.data(),
                    sensitivities_.data());
    tracer_.count_passes(1.0);
    judge(sum);
    const auto d = static_cast<double>(normalized_.dimension());
    value = d * std::log(sum) - inverse_.log_det;
    for (std::size_t i = 0; gradient != nullptr && i < count_; ++i) {
      gradient[i] = 2.0 * roots[i] * (d / sum - sensitivities_[i]);
    }
  } else if (gradient != nullptr) {
    std::fill_n(gradient, count_, 0.0);
  }
  const bool stalled = evaluations_ - last_progress_ > kEvaluationsWithoutProgress;
  if (running_ != nullptr && (met() || stalled || limited())) nlopt_force_stop(running_);
  return value;
}

void WeightRun::judge(double sum) {
  const double largest = *std::ranges::max_element(sensitivities_);
  const double gap = sum * largest / static_cast<double>(normalized_.dimension()) - 1.0;
  tracer_.record(gap, evaluations_);
  if (!(gap < best_gap_)) return;
  best_gap_ = gap;
  for (std::size_t i = 0; i < count_; ++i) best_[i] = squares_[i] / sum;
  if (gap < 0.9 * progress_gap_) {
    progress_gap_ = gap;
    last_progress_ = evaluations_;
  }
}

// The start becomes the best design so far, from which start() begins, as at every restart. False
// where its information matrix is singular.
bool WeightRun::begin_from_start() {
  const std::vector<double> weights = simplex_start(options_.start);
  std::ranges::transform(weights, roots_.begin(), [](double weight) { return std::sqrt(weight); });
  evaluate(roots_.data(), nullptr);
  return std::isfinite(best_gap_);
}

nlopt_result WeightRun::start(nlopt_algorithm algorithm) {
  // Candidates that vanished too early get a little weight, too little to matter for the gap. The
  // length of u is 1: L-BFGS stops at an absolute gradient of 1e-8.
  const double floor = 1e-3 * std::min(1.0, best_gap_) / static_cast<double>(count_);
  for (std::size_t i = 0; i < count_; ++i) roots_[i] = std::sqrt(std::max(best_[i], floor));
  const nlopt::Handle handle = nlopt::make_handle(algorithm, count_);
  running_ = handle.get();
  last_progress_ = evaluations_;
  nlopt_set_min_objective(running_, objective, this);
  if (algorithm == NLOPT_LD_LBFGS) nlopt_set_vector_storage(running_, kLbfgsVectors);
  double value = 0.0;
  return nlopt_optimize(running_, roots_.data(), &value);
}

Solution WeightRun::solve(nlopt_algorithm algorithm) {
  bool start_unused = false;
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    if (start_unused) message = without_start(message);
    return tracer_.finish({std::move(best_)}, status, evaluations_, std::move(message));
  };
  if (!normalized_.regular()) {
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit, normalized_.message());
    best_.clear();
    return finish(SolveStatus::kUnsupported, normalized_.message());
  }
  if (!options_.start.empty()) start_unused = !begin_from_start();
  if (met()) return finish(SolveStatus::kSolved);
  for (;;) {
    const double before = best_gap_;
    const nlopt_result result = start(algorithm);
    if (met()) return finish(SolveStatus::kSolved);
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (evaluations_ >= evaluation_limit_) return finish(SolveStatus::kIterationLimit);
    if (result == NLOPT_OUT_OF_MEMORY) throw std::bad_alloc();
    if (before <= 2.0 * best_gap_) {
      return finish(SolveStatus::kNumericalFailure, fmt::format("{}, but the duality gap is {:.2g}",
                                                                nlopt::reason(result), best_gap_));
    }
  }
}

}  // namespace

Solution NloptLbfgs::solve(const InformationSet& set, const SolveOptions& options,
                           SolveObserver* observer) const {
  return WeightRun(set, options, observer).solve(NLOPT_LD_LBFGS);
}

Solution NloptMma::solve(const InformationSet& set, const SolveOptions& options,
                         SolveObserver* observer) const {
  return WeightRun(set, options, observer).solve(NLOPT_LD_MMA);
}

Solution NloptCcsa::solve(const InformationSet& set, const SolveOptions& options,
                          SolveObserver* observer) const {
  return WeightRun(set, options, observer).solve(NLOPT_LD_CCSAQ);
}

}  // namespace graybox
