#include "diagnosis/output_error/stretch_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "diagnosis/estimation/quiet_ceres.hpp"

namespace graybox {
namespace {

// Logarithms beyond this are no numbers of use: the parameter has lost its effect.
constexpr double kLargest = 500.0;

// Between a parameter and the number that Ceres moves: its logarithm where it must be positive.
struct ParameterTransform {
  explicit ParameterTransform(const OutputErrorProblem& problem) {
    for (const std::size_t k : problem.free_parameters()) {
      ranges.push_back(problem.model().parameters[k].range);
    }
  }
  [[nodiscard]] Eigen::VectorXd inner(const Eigen::VectorXd& theta) const {
    Eigen::VectorXd result = theta;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      auto& value = result(static_cast<Eigen::Index>(i));
      if (ranges[i] == ParameterRange::kPositive) value = std::log(value);
    }
    return result;
  }
  [[nodiscard]] Eigen::VectorXd outer(const Eigen::VectorXd& inside) const {
    Eigen::VectorXd result = inside;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      auto& value = result(static_cast<Eigen::Index>(i));
      if (ranges[i] == ParameterRange::kPositive)
        value = std::exp(std::clamp(value, -kLargest, kLargest));
    }
    return result;
  }
  // dtheta / dinner.
  [[nodiscard]] double slope(Eigen::Index i, double theta) const {
    return ranges[static_cast<std::size_t>(i)] == ParameterRange::kPositive ? theta : 1.0;
  }

  std::vector<ParameterRange> ranges;
};

// Simulates all stretches once for each point that Ceres looks at.
//
// Ceres eliminates the initial states in the order of their addresses, and the order of its sums
// decides the last digits. So they lie in one array: apart, each run of a program might order them
// differently.
class SharedSimulation final : public ceres::EvaluationCallback {
 public:
  SharedSimulation(const OutputErrorProblem& problem, std::span<const StretchOf> stretches,
                   Eigen::VectorXd inner, std::vector<Eigen::VectorXd> initial)
      : scale(problem),
        inner_theta(std::move(inner)),
        initial_states(std::move(initial)),
        initial_size_(static_cast<std::size_t>(problem.initial_size())),
        initial_numbers_(initial_size_ * initial_states.size()),
        problem_(problem),
        stretches_(stretches) {
    for (std::size_t k = 0; k < initial_states.size(); ++k) {
      std::ranges::copy(initial_states[k], initial_block(k));
    }
  }

  // The numbers of one initial state that Ceres moves.
  [[nodiscard]] double* initial_block(std::size_t stretch) {
    return initial_numbers_.data() + stretch * initial_size_;
  }
  // The initial states of those numbers.
  void take_initial_states() {
    for (std::size_t k = 0; k < initial_states.size(); ++k) {
      std::copy_n(initial_block(k), initial_size_, initial_states[k].begin());
    }
  }

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_point) override {
    if (!new_point && (has_derivatives_ || !evaluate_jacobians)) return;
    has_derivatives_ = evaluate_jacobians;
    theta = scale.outer(inner_theta);
    take_initial_states();
    if (!theta.allFinite()) {
      for (Simulated& run : runs) run.finite = false;
      return;
    }
    problem_.simulate(theta, stretches_, initial_states, evaluate_jacobians, runs);
  }

  ParameterTransform scale;
  Eigen::VectorXd inner_theta, theta;
  std::vector<Eigen::VectorXd> initial_states;
  std::vector<Simulated> runs;

 private:
  std::size_t initial_size_;
  std::vector<double> initial_numbers_;
  const OutputErrorProblem& problem_;
  std::span<const StretchOf> stretches_;
  bool has_derivatives_ = false;
};

class StretchResiduals final : public ceres::CostFunction {
 public:
  StretchResiduals(const SharedSimulation& simulation, std::size_t stretch,
                   Eigen::VectorXd measured, Eigen::VectorXd weights)
      : simulation_(simulation),
        stretch_(stretch),
        measured_(std::move(measured)),
        weights_(std::move(weights)) {
    set_num_residuals(static_cast<int>(measured_.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(simulation.inner_theta.size()));
    if (!simulation.initial_states.empty()) {
      mutable_parameter_block_sizes()->push_back(
          static_cast<int>(simulation.initial_states[stretch].size()));
    }
  }

  bool Evaluate(double const* const* /*parameters*/, double* residuals,
                double** jacobians) const override {
    const Simulated& run = simulation_.runs[stretch_];
    if (!run.finite) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, measured_.size()) =
        weights_.cwiseProduct(run.outputs.col(0) - measured_);
    if (jacobians == nullptr) return true;
    Eigen::Index first = 1;
    const auto& sizes = parameter_block_sizes();
    for (std::size_t block = 0; block < sizes.size(); ++block) {
      const Eigen::Index count = sizes[block];
      if (jacobians[block] != nullptr) {
        Eigen::Map<Rows> jacobian(jacobians[block], measured_.size(), count);
        jacobian = weights_.asDiagonal() * run.outputs.middleCols(first, count);
        for (Eigen::Index i = 0; block == 0 && i < count; ++i) {
          jacobian.col(i) *= simulation_.scale.slope(i, simulation_.theta(i));
        }
      }
      first += count;
    }
    return true;
  }

 private:
  const SharedSimulation& simulation_;
  std::size_t stretch_;
  Eigen::VectorXd measured_, weights_;
};

class Interruption final : public ceres::IterationCallback {
 public:
  explicit Interruption(std::function<bool()> keep_going) : keep_going_(std::move(keep_going)) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return !keep_going_ || keep_going_() ? ceres::SOLVER_CONTINUE
                                         : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  std::function<bool()> keep_going_;
};

Eigen::VectorXd weights_of(const Eigen::VectorXd& deviation, Eigen::Index size) {
  return deviation.cwiseInverse().replicate(size / deviation.size(), 1);
}

void bound_parameters(const ParameterTransform& scale, double* inner, ceres::Problem& problem) {
  for (std::size_t i = 0; i < scale.ranges.size(); ++i) {
    const int at = static_cast<int>(i);
    const bool is_unit = scale.ranges[i] == ParameterRange::kUnitInterval;
    if (is_unit || scale.ranges[i] == ParameterRange::kNonNegative) {
      problem.SetParameterLowerBound(inner, at, 0.0);
    }
    if (is_unit) problem.SetParameterUpperBound(inner, at, 1.0);
  }
}

ceres::Solver::Options solver_options(const StretchFitOptions& options) {
  ceres::Solver::Options result;
  result.max_num_iterations = options.iteration_limit;
  result.function_tolerance = options.tolerance;
  result.parameter_tolerance = 1e-12;
  result.gradient_tolerance = 1e-14;
  result.initial_trust_region_radius = 100.0;
  result.logging_type = ceres::SILENT;
  result.max_num_consecutive_invalid_steps = 20;
  // Cubic interpolation asks for all derivatives again at each step that is searched along its
  // line.
  result.line_search_interpolation_type = ceres::QUADRATIC;
  return result;
}

}  // namespace

StretchFit fit_stretches(const OutputErrorProblem& problem, std::span<const StretchOf> stretches,
                         const Eigen::VectorXd& theta, std::vector<Eigen::VectorXd> initial,
                         const Eigen::VectorXd& deviation, const StretchFitOptions& options) {
  const bool has_initial = !initial.empty() && problem.initial_size() > 0;
  if (!has_initial) initial.clear();
  const ParameterTransform scale(problem);
  SharedSimulation shared(problem, stretches, scale.inner(theta), std::move(initial));
  StretchFit result;
  result.theta = theta;
  result.initial = shared.initial_states;
  shared.PrepareForEvaluation(true, true);
  if (!std::ranges::all_of(shared.runs, &Simulated::finite)) return result;
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &shared;
  ceres::Problem minimised(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t k = 0; k < stretches.size(); ++k) {
    const Eigen::VectorXd measured = problem.measured(stretches[k]);
    std::vector<double*> blocks{shared.inner_theta.data()};
    if (has_initial) blocks.push_back(shared.initial_block(k));
    minimised.AddResidualBlock(
        new StretchResiduals(shared, k, measured, weights_of(deviation, measured.size())), nullptr,
        blocks);
    if (!has_initial) continue;
    ordering->AddElementToGroup(blocks[1], 0);
    if (!options.free_initial) minimised.SetParameterBlockConstant(blocks[1]);
  }
  ordering->AddElementToGroup(shared.inner_theta.data(), 1);
  if (options.free_parameters) {
    bound_parameters(scale, shared.inner_theta.data(), minimised);
  } else {
    minimised.SetParameterBlockConstant(shared.inner_theta.data());
  }
  ceres::Solver::Options solver = solver_options(options);
  const bool by_schur = has_initial && options.free_initial && options.free_parameters;
  solver.linear_solver_type = by_schur ? ceres::DENSE_SCHUR : ceres::DENSE_QR;
  if (by_schur) solver.linear_solver_ordering = ordering;
  Interruption interruption(options.keep_going);
  solver.callbacks.push_back(&interruption);
  ceres::Solver::Summary summary;
  silence_ceres();
  ceres::Solve(solver, &minimised, &summary);
  result.iterations = static_cast<int>(summary.iterations.size());
  result.theta = options.free_parameters ? scale.outer(shared.inner_theta) : theta;
  shared.take_initial_states();
  result.initial = shared.initial_states;
  result.cost = summary.final_cost;
  using enum StretchFit::Status;
  if (summary.termination_type == ceres::FAILURE) {
    result.status = kDiverged;
  } else if (options.keep_going && !options.keep_going()) {
    result.status = kInterrupted;
  } else {
    result.status =
        summary.termination_type == ceres::NO_CONVERGENCE ? kIterationLimit : kConverged;
  }
  return result;
}

double stretch_cost(const OutputErrorProblem& problem, std::span<const StretchOf> stretches,
                    const Eigen::VectorXd& theta, std::span<const Eigen::VectorXd> initial,
                    const Eigen::VectorXd& deviation) {
  std::vector<Simulated> runs;
  problem.simulate(theta, stretches, initial, false, runs);
  double cost = 0.0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    if (!runs[k].finite) return std::numeric_limits<double>::infinity();
    const Eigen::VectorXd measured = problem.measured(stretches[k]);
    cost += 0.5 * weights_of(deviation, measured.size())
                      .cwiseProduct(runs[k].outputs.col(0) - measured)
                      .squaredNorm();
  }
  return cost;
}

}  // namespace graybox
