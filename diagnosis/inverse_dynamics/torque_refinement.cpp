#include "graybox/diagnosis/inverse_dynamics/torque_refinement.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>

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

RefinementResult refine_parameters(
    const Eigen::VectorXd& start, const std::vector<ParameterRange>& ranges,
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals, int max_steps,
    const std::function<bool()>& keep_going) {
  const Scaling scaling(start, ranges);
  std::vector<double> moved(static_cast<std::size_t>(start.size()), 0.0);
  ceres::NumericDiffOptions differences;
  differences.relative_step_size = kDifference;
  auto cost =
      std::make_unique<ceres::DynamicNumericDiffCostFunction<ProjectedResidual, ceres::CENTRAL>>(
          new ProjectedResidual{&scaling, &residuals}, ceres::TAKE_OWNERSHIP, differences);
  cost->AddParameterBlock(static_cast<int>(start.size()));
  cost->SetNumResiduals(static_cast<int>(residuals(start).size()));
  ceres::Problem problem;
  problem.AddResidualBlock(cost.release(), nullptr, moved.data());
  scaling.bound(problem, moved.data());
  StopOnRequest stop(keep_going);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_steps;
  options.function_tolerance = kTolerance;
  options.parameter_tolerance = kTolerance;
  options.logging_type = ceres::SILENT;
  options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  RefinementResult result{scaling.values(moved.data()), std::vector<bool>(moved.size()),
                          summary.termination_type == ceres::CONVERGENCE,
                          summary.termination_type == ceres::USER_FAILURE};
  for (std::size_t k = 0; k < moved.size(); ++k) {
    result.at_limit[k] = scaling.is_at_limit(moved.data(), static_cast<Index>(k));
  }
  return result;
}

}  // namespace graybox
