#include "diagnosis/inverse_dynamics/torque_refinement.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "diagnosis/estimation/quiet_ceres.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kTolerance = 1e-10;
constexpr double kLargestFactor = 1000.0;
constexpr double kDifference = 1e-5;  // of the scaled parameters

// theta from the numbers that Ceres moves, which start at zero.
class Scaling {
 public:
  Scaling(Eigen::VectorXd start, std::vector<ParameterRange> ranges)
      : start_(std::move(start)), ranges_(std::move(ranges)) {}

  [[nodiscard]] Eigen::VectorXd values(const double* moved) const {
    Eigen::VectorXd theta(start_.size());
    for (Index k = 0; k < theta.size(); ++k) {
      theta(k) =
          is_logarithmic(k) ? start_(k) * std::exp(moved[k]) : start_(k) + scale(k) * moved[k];
    }
    return theta;
  }
  void bound(ceres::Problem& problem, double* moved) const {
    for (Index k = 0; k < start_.size(); ++k) {
      const ParameterRange range = ranges_[static_cast<std::size_t>(k)];
      const auto index = static_cast<int>(k);
      if (is_logarithmic(k)) {
        problem.SetParameterLowerBound(moved, index, -std::log(kLargestFactor));
        problem.SetParameterUpperBound(moved, index, std::log(kLargestFactor));
        continue;
      }
      if (range == ParameterRange::kAny) continue;
      problem.SetParameterLowerBound(moved, index, -start_(k) / scale(k));
      if (range == ParameterRange::kUnitInterval) {
        problem.SetParameterUpperBound(moved, index, (1.0 - start_(k)) / scale(k));
      }
    }
  }

  [[nodiscard]] Index size() const { return start_.size(); }
  // d theta / d moved.
  [[nodiscard]] double slope(const Eigen::VectorXd& theta, Index k) const {
    return is_logarithmic(k) ? theta(k) : scale(k);
  }

  [[nodiscard]] bool is_at_limit(const double* moved, Index k) const {
    return is_logarithmic(k) && std::abs(moved[k]) > 0.999 * std::log(kLargestFactor);
  }

 private:
  [[nodiscard]] bool is_logarithmic(Index k) const {
    const ParameterRange range = ranges_[static_cast<std::size_t>(k)];
    return range == ParameterRange::kPositive ||
           (range == ParameterRange::kNonNegative && start_(k) > 0.0);
  }
  [[nodiscard]] double scale(Index k) const { return start_(k) == 0.0 ? 1.0 : std::abs(start_(k)); }

  Eigen::VectorXd start_;
  std::vector<ParameterRange> ranges_;
};

struct ProjectedResidual {
  const Scaling* scaling;
  const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>* residuals;

  bool operator()(double const* const* moved, double* result) const {
    const Eigen::VectorXd values = (*residuals)(scaling->values(moved[0]));
    if (!values.allFinite()) return false;
    std::ranges::copy(values, result);
    return true;
  }
};

// Residuals that bring their derivatives by theta.
class SlopedResidual : public ceres::CostFunction {
 public:
  SlopedResidual(const Scaling& scaling, const ProjectedResiduals& residuals, Index count)
      : scaling_(scaling), residuals_(residuals) {
    set_num_residuals(static_cast<int>(count));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(scaling.size()));
  }
  bool Evaluate(double const* const* moved, double* values, double** slopes) const override {
    const Eigen::VectorXd theta = scaling_.values(moved[0]);
    const bool wanted = slopes != nullptr && slopes[0] != nullptr;
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
    if (!residuals_(theta, residuals, wanted ? &jacobian : nullptr)) return false;
    std::ranges::copy(residuals, values);
    if (!wanted) return true;
    for (Index k = 0; k < theta.size(); ++k) jacobian.col(k) *= scaling_.slope(theta, k);
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        slopes[0], jacobian.rows(), jacobian.cols()) = jacobian;
    return true;
  }

 private:
  const Scaling& scaling_;
  const ProjectedResiduals& residuals_;
};

class StopOnRequest : public ceres::IterationCallback {
 public:
  explicit StopOnRequest(const std::function<bool()>& keep_going) : keep_going_(keep_going) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return keep_going_ && !keep_going_() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::function<bool()>& keep_going_;
};

}  // namespace

namespace {

RefinementResult solve_problem(std::unique_ptr<ceres::CostFunction> cost, const Scaling& scaling,
                               int max_steps, double tolerance,
                               const std::function<bool()>& keep_going) {
  std::vector<double> moved(static_cast<std::size_t>(scaling.size()), 0.0);
  ceres::Problem problem;
  problem.AddResidualBlock(cost.release(), nullptr, moved.data());
  scaling.bound(problem, moved.data());
  StopOnRequest stop(keep_going);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_steps;
  options.function_tolerance = tolerance;
  options.parameter_tolerance = tolerance;
  options.logging_type = ceres::SILENT;
  // A step that leaves its bounds ends on them; a search along each line would take as long again.
  options.max_num_line_search_step_size_iterations = 0;
  options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  silence_ceres();
  ceres::Solve(options, &problem, &summary);
  RefinementResult result{scaling.values(moved.data()), std::vector<bool>(moved.size()),
                          summary.termination_type == ceres::CONVERGENCE,
                          summary.termination_type == ceres::USER_FAILURE};
  for (std::size_t k = 0; k < moved.size(); ++k) {
    result.at_limit[k] = scaling.is_at_limit(moved.data(), static_cast<Index>(k));
  }
  return result;
}

}  // namespace

RefinementResult refine_parameters(
    const Eigen::VectorXd& start, const std::vector<ParameterRange>& ranges,
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals, int max_steps,
    const std::function<bool()>& keep_going) {
  const Scaling scaling(start, ranges);
  ceres::NumericDiffOptions differences;
  differences.relative_step_size = kDifference;
  auto cost =
      std::make_unique<ceres::DynamicNumericDiffCostFunction<ProjectedResidual, ceres::CENTRAL>>(
          new ProjectedResidual{&scaling, &residuals}, ceres::TAKE_OWNERSHIP, differences);
  cost->AddParameterBlock(static_cast<int>(start.size()));
  cost->SetNumResiduals(static_cast<int>(residuals(start).size()));
  return solve_problem(std::move(cost), scaling, max_steps, kTolerance, keep_going);
}

RefinementResult refine_parameters(const Eigen::VectorXd& start,
                                   const std::vector<ParameterRange>& ranges,
                                   const ProjectedResiduals& residuals, int max_steps,
                                   double tolerance, const std::function<bool()>& keep_going) {
  const Scaling scaling(start, ranges);
  Eigen::VectorXd first;
  if (!residuals(start, first, nullptr)) {
    return {start, std::vector<bool>(static_cast<std::size_t>(start.size())), false, false};
  }
  return solve_problem(std::make_unique<SlopedResidual>(scaling, residuals, first.size()), scaling,
                       max_steps, tolerance, keep_going);
}

}  // namespace graybox
