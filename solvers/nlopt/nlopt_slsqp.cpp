#include "solvers/nlopt/nlopt_slsqp.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/nlopt/nlopt_handle.hpp"
#include "solvers/restricted_problem/nonnegative_quadratic.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Matrix = Eigen::MatrixXd;

constexpr std::size_t kLargestVariableCount = 500;
constexpr std::int64_t kDefaultEvaluationLimit = 100000;
constexpr std::int64_t kEvaluationsOfARound = 2000;
constexpr int kMultiplicativeSteps = 10;
constexpr int kRoundsWithoutProgress = 3;
constexpr double kSmallestDiagonal = 1e-8;  // of L
constexpr double kFeasibility = 1e-12;      // of a constraint scaled to tr(L L^T C_i)/tr(C_i)

// The best weights that were priced, with their M, packed, and their gap.
struct PricedBest {
  std::vector<double> weights, matrix = {};
  double gap = std::numeric_limits<double>::infinity();
};

class SlsqpRun {
 public:
  SlsqpRun(const InformationSet& set, const SolveOptions& options, SolveObserver* observer)
      : options_(options),
        tracer_(set, options, observer),
        normalized_(set, {.scale_rows = false, .threads = options.threads}),
        count_(set.candidate_count()),
        dimension_(static_cast<Index>(set.dimension())),
        evaluation_limit_(options.iteration_limit > 0 ? options.iteration_limit
                                                      : kDefaultEvaluationLimit),
        factor_(Matrix::Zero(dimension_, dimension_)),
        product_(factor_),
        matrix_(set.packed_size()),
        weights_(count_, 1.0 / static_cast<double>(count_)),
        sensitivities_(count_),
        in_working_set_(count_, 0),
        best_{.weights = weights_} {
    tracer_.count_passes(normalized_.passes());
  }

  Solution solve();

 private:
  static double objective(unsigned, const double* x, double* gradient, void* run) {
    return static_cast<SlsqpRun*>(run)->evaluate_objective(x, gradient);
  }
  static void constraints(unsigned, double* values, unsigned, const double* x, double* gradient,
                          void* run) {
    static_cast<SlsqpRun*>(run)->evaluate_constraints(x, values, gradient);
  }
  double evaluate_objective(const double* x, double* gradient);
  void evaluate_constraints(const double* x, double* values, double* gradient);
  void read_factor(const double* x);

  void start_multiplicatively();
  [[nodiscard]] bool begin_from_start();
  bool price();               // M and w at weights_, the gap; false where M is singular
  bool extend_working_set();  // false if there was nothing to add

  bool change_coordinates();   // C_i for M at the best weights
  nlopt_result solve_round();  // leaves L in factor_
  bool recover_weights();      // z from L
  [[nodiscard]] bool met() const { return best_.gap <= options_.duality_gap; }

  // Calls visit(row, column) for the lower triangle in the order of the variables.
  template <typename Visit>
  void for_each_entry(Visit visit) const {
    for (Index column = 0; column < dimension_; ++column) {
      for (Index row = column; row < dimension_; ++row) visit(row, column);
    }
  }

  const SolveOptions& options_;
  Tracer tracer_;
  NormalizedSet normalized_;
  std::size_t count_;
  Index dimension_;
  std::int64_t evaluation_limit_;
  std::int64_t evaluations_ = 0;
  Matrix factor_;  // L
  Matrix product_;
  std::vector<double> matrix_;  // M, packed
  InverseFactor inverse_;
  std::vector<double> weights_;
  std::vector<double> sensitivities_;
  std::vector<char> in_working_set_;
  std::vector<std::size_t> working_set_;
  std::vector<Matrix> constraints_;  // C_0, then C_i of the working set, each over its trace
  std::vector<double> limits_;       // d over the same traces
  NonnegativeQuadratic least_squares_;
  PricedBest best_;
  nlopt_opt running_ = nullptr;
};

void SlsqpRun::read_factor(const double* x) {
  for_each_entry([&](Index row, Index column) { factor_(row, column) = *x++; });
}

double SlsqpRun::evaluate_objective(const double* x, double* gradient) {
  ++evaluations_;
  if (tracer_.out_of_time() || evaluations_ >= evaluation_limit_) nlopt_force_stop(running_);
  double value = 0.0;
  for_each_entry([&](Index row, Index column) {
    if (row == column) value -= 2.0 * std::log(*x);
    if (gradient != nullptr) *gradient++ = row == column ? -2.0 / *x : 0.0;
    ++x;
  });
  return value;
}

void SlsqpRun::evaluate_constraints(const double* x, double* values, double* gradient) {
  read_factor(x);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    product_.noalias() = constraints_[i] * factor_;
    values[i] = product_.cwiseProduct(factor_).sum() - limits_[i];
    if (gradient == nullptr) continue;
    for_each_entry([&](Index row, Index column) { *gradient++ = 2.0 * product_(row, column); });
  }
}

bool SlsqpRun::price() {
  std::ranges::fill(matrix_, 0.0);
  kernels().accumulate(normalized_.rows(), count_, matrix_.size(), weights_.data(), matrix_.data());
  if (!invert(matrix_, normalized_.dimension(), inverse_)) return false;
  kernels().price(normalized_.rows(), count_, matrix_.size(), inverse_.trace_dual.data(),
                  sensitivities_.data());
  tracer_.count_passes(2.0);
  const double largest = *std::ranges::max_element(sensitivities_);
  const double gap = largest / static_cast<double>(dimension_) - 1.0;
  tracer_.record(gap, evaluations_);
  if (gap < best_.gap) {
    best_.gap = gap;
    best_.weights = weights_;
    best_.matrix = matrix_;
  }
  return true;
}

// lambda_i <- lambda_i w_i / d (Silvey, Titterington and Torsney 1978): far from the optimum a few
// of these do what would take SQP hundreds of evaluations.
void SlsqpRun::start_multiplicatively() {
  for (int step = 0; step < kMultiplicativeSteps && price() && !met(); ++step) {
    for (std::size_t i = 0; i < count_; ++i) {
      // A candidate that is not positive semidefinite may have a negative sensitivity.
      weights_[i] *= std::max(0.0, sensitivities_[i]) / static_cast<double>(dimension_);
    }
    const double sum = std::accumulate(weights_.begin(), weights_.end(), 0.0);
    for (double& weight : weights_) weight /= sum;
    if (tracer_.out_of_time()) return;
  }
}

// The start's weights; equal ones and false where its information matrix is singular.
bool SlsqpRun::begin_from_start() {
  weights_ = simplex_start(options_.start);
  std::ranges::fill(matrix_, 0.0);
  kernels().accumulate(normalized_.rows(), count_, matrix_.size(), weights_.data(), matrix_.data());
  tracer_.count_passes(1.0);
  if (invert(matrix_, normalized_.dimension(), inverse_)) return true;
  std::ranges::fill(weights_, 1.0 / static_cast<double>(count_));
  return false;
}

bool SlsqpRun::extend_working_set() {
  std::vector<std::size_t> violated;
  for (std::size_t i = 0; i < count_; ++i) {
    if (!in_working_set_[i] && sensitivities_[i] > static_cast<double>(dimension_)) {
      violated.push_back(i);
    }
  }
  std::ranges::stable_sort(violated, std::ranges::greater(),
                           [&](std::size_t i) { return sensitivities_[i]; });
  const std::size_t before = working_set_.size();
  const std::size_t wanted = before + 2 * static_cast<std::size_t>(dimension_);
  for (const std::size_t i : violated) {
    if (working_set_.size() == wanted) break;
    // Exact duplicates stand side by side in this order; one of them is enough.
    if (working_set_.size() > before &&
        std::ranges::equal(normalized_.row(i), normalized_.row(working_set_.back()))) {
      continue;
    }
    in_working_set_[i] = 1;
    working_set_.push_back(i);
  }
  return working_set_.size() > before;
}

bool SlsqpRun::change_coordinates() {
  Matrix full(dimension_, dimension_);
  unpack(best_.matrix.data(), normalized_.dimension(), full.data());
  const Eigen::LLT<Matrix> cholesky(full);
  if (cholesky.info() != Eigen::Success) return false;
  constraints_.clear();
  limits_.clear();
  const auto add = [&](Matrix& candidate) {
    cholesky.matrixL().solveInPlace(candidate);
    cholesky.matrixU().solveInPlace<Eigen::OnTheRight>(candidate);
    const double trace = candidate.trace();
    constraints_.push_back(candidate / trace);
    limits_.push_back(static_cast<double>(dimension_) / trace);
  };
  full.setIdentity();
  add(full);
  for (const std::size_t i : working_set_) {
    unpack(normalized_.row(i).data(), normalized_.dimension(), full.data());
    add(full);
  }
  return true;
}

nlopt_result SlsqpRun::solve_round() {
  const std::size_t variables = matrix_.size();
  const nlopt::Handle handle = nlopt::make_handle(NLOPT_LD_SLSQP, variables);
  running_ = handle.get();
  std::vector<double> lower, start;
  // L = I / sqrt(1 + gap) satisfies every constraint.
  const double shrink = 1.0 / std::sqrt(1.0 + best_.gap);
  for_each_entry([&](Index row, Index column) {
    lower.push_back(row == column ? kSmallestDiagonal : -HUGE_VAL);
    start.push_back(row == column ? shrink : 0.0);
  });
  nlopt_set_lower_bounds(running_, lower.data());
  nlopt_set_min_objective(running_, objective, this);
  const std::vector<double> tolerances(constraints_.size(), kFeasibility);
  nlopt_add_inequality_mconstraint(running_, static_cast<unsigned>(constraints_.size()),
                                   constraints, this, tolerances.data());
  nlopt_set_xtol_rel(running_, 1e-13);
  nlopt_set_maxeval(
      running_, static_cast<int>(std::min(kEvaluationsOfARound, evaluation_limit_ - evaluations_)));
  double value = 0.0;
  const nlopt_result result = nlopt_optimize(running_, start.data(), &value);
  read_factor(start.data());
  return result;
}

bool SlsqpRun::recover_weights() {
  const auto size = static_cast<Index>(constraints_.size());
  Matrix columns(static_cast<Index>(matrix_.size()), size);
  std::vector<double> linear, multipliers;
  for (Index i = 0; i < size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    product_.noalias() = factor_.transpose() * constraints_[k] * factor_;
    const double slack = std::max(0.0, limits_[k] - product_.trace());
    linear.push_back(product_.trace() - slack);
    // Constraints at their limit are the guess for the free set.
    multipliers.push_back(slack <= 1e-6 * limits_[k] ? 1.0 : 0.0);
    double* entry = columns.col(i).data();
    for_each_entry([&](Index row, Index column) {
      *entry++ = (row == column ? 1.0 : std::numbers::sqrt2) * product_(row, column);
    });
  }
  Matrix gram = columns.transpose() * columns;
  gram.diagonal() *= 1.0 + 1e-13;  // duplicates share their weight
  gram.diagonal().array() += 1e-15;
  least_squares_.reserve(constraints_.size());
  if (!least_squares_.solve({gram.data(), static_cast<std::size_t>(gram.size())}, linear,
                            multipliers)) {
    return false;
  }
  // The constraints were divided by their traces, d / limit.
  for (std::size_t k = 0; k < multipliers.size(); ++k) {
    multipliers[k] = std::max(0.0, multipliers[k] * limits_[k]);
  }
  const double sum = std::accumulate(multipliers.begin(), multipliers.end(), 0.0);
  if (!(sum > 0.0) || !std::isfinite(sum)) return false;
  std::ranges::fill(weights_, multipliers[0] / sum / static_cast<double>(count_));
  for (std::size_t k = 0; k < working_set_.size(); ++k) {
    weights_[working_set_[k]] += multipliers[k + 1] / sum;
  }
  return true;
}

Solution SlsqpRun::solve() {
  bool start_unused = false;
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    if (start_unused) message = without_start(message);
    return tracer_.finish({std::move(best_.weights)}, status, evaluations_, std::move(message));
  };
  if (!normalized_.regular()) {
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit, normalized_.message());
    best_.weights.clear();
    return finish(SolveStatus::kUnsupported, normalized_.message());
  }
  if (!options_.start.empty()) start_unused = !begin_from_start();
  if (options_.start.empty() || start_unused) start_multiplicatively();
  nlopt_result result = NLOPT_SUCCESS;
  double gap_to_halve = std::numeric_limits<double>::infinity();
  for (int rounds_without_progress = 0;;) {
    const bool regular = price();
    if (met()) return finish(SolveStatus::kSolved);
    if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (evaluations_ >= evaluation_limit_) return finish(SolveStatus::kIterationLimit);
    const bool progress = best_.gap <= 0.5 * gap_to_halve;
    if (progress) gap_to_halve = best_.gap;
    rounds_without_progress = progress ? 0 : rounds_without_progress + 1;
    if (!regular) break;
    const bool extended = extend_working_set();
    if (!extended && rounds_without_progress > kRoundsWithoutProgress) break;
    if (!change_coordinates()) break;
    result = solve_round();
    if (result == NLOPT_OUT_OF_MEMORY) throw std::bad_alloc();
    if (!recover_weights()) break;
  }
  return finish(SolveStatus::kNumericalFailure,
                fmt::format("{}, but the duality gap is {:.2g}", nlopt::reason(result), best_.gap));
}

}  // namespace

Solution NloptSlsqp::solve(const InformationSet& set, const SolveOptions& options,
                           SolveObserver* observer) const {
  if (set.packed_size() > kLargestVariableCount) {
    Solution solution;
    solution.status = SolveStatus::kUnsupported;
    solution.message = fmt::format("{} variables are too many for dense SQP; at most {}",
                                   set.packed_size(), kLargestVariableCount);
    return solution;
  }
  return SlsqpRun(set, options, observer).solve();
}

}  // namespace graybox
