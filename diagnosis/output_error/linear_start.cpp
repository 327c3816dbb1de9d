#include "diagnosis/output_error/linear_start.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <vector>

#include "diagnosis/output_error/stretch_fit.hpp"

namespace graybox {
namespace {

// Of each of the model's parameters: masses first, then those of each part.
std::vector<bool> is_linear(const LumpedModel& model) {
  std::vector<bool> linear(static_cast<std::size_t>((model.masses.array() != 0.0).count()), true);
  for (const Element& part : model.parts) {
    const bool at_signal = part.location.kind != LocationKind::kElement;
    const bool follows_motion = !at_signal && (part.law == nullptr || part.law->state_count() == 0);
    for (const LawParameter& parameter : find_law(part.law_name, at_signal)->parameters) {
      linear.push_back(follows_motion && (parameter.is_linear || part.use == LawUse::kInertia));
    }
  }
  return linear;
}

// Places in theta.
std::vector<Eigen::Index> linear_places(const OutputErrorProblem& problem) {
  const std::vector<bool> linear = is_linear(problem.model());
  std::vector<Eigen::Index> places;
  for (std::size_t i = 0; i < problem.free_parameters().size(); ++i) {
    if (linear[problem.free_parameters()[i]]) places.push_back(static_cast<Eigen::Index>(i));
  }
  return places;
}

bool in_range(const OutputErrorProblem& problem, const Eigen::VectorXd& theta) {
  for (Eigen::Index i = 0; i < theta.size(); ++i) {
    using enum ParameterRange;
    const std::size_t parameter = problem.free_parameters()[static_cast<std::size_t>(i)];
    const ParameterRange range = problem.model().parameters[parameter].range;
    if (range == kPositive && !(theta(i) > 0.0)) return false;
    if (range == kNonNegative && !(theta(i) >= 0.0)) return false;
  }
  return theta.allFinite();
}

}  // namespace

Eigen::VectorXd with_linear_optimum(const OutputErrorProblem& problem, const Eigen::VectorXd& theta,
                                    const Eigen::VectorXd& deviation) {
  const std::vector<Eigen::Index> places = linear_places(problem);
  if (problem.initial_size() > 0 || places.empty()) return theta;
  const auto whole = problem.whole_recordings(ExperimentRole::kEstimation);
  std::vector<Simulated> runs;
  problem.simulate(theta, whole, {}, true, runs);
  if (!std::ranges::all_of(runs, &Simulated::finite)) return theta;
  Eigen::Index rows = 0;
  for (const Simulated& run : runs) rows += run.outputs.rows();
  Eigen::MatrixXd slopes(rows, static_cast<Eigen::Index>(places.size()));
  Eigen::VectorXd missing(rows);
  Eigen::Index first = 0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Rows& outputs = runs[k].outputs;
    const Eigen::VectorXd weights =
        deviation.cwiseInverse().replicate(outputs.rows() / deviation.size(), 1);
    missing.segment(first, outputs.rows()) =
        weights.cwiseProduct(problem.measured(whole[k]) - outputs.col(0));
    for (std::size_t i = 0; i < places.size(); ++i) {
      slopes.col(static_cast<Eigen::Index>(i)).segment(first, outputs.rows()) =
          weights.cwiseProduct(outputs.col(1 + places[i]));
    }
    first += outputs.rows();
  }
  Eigen::VectorXd found = theta;
  found(places) += slopes.completeOrthogonalDecomposition().solve(missing);
  if (!in_range(problem, found)) return theta;
  const bool is_better = stretch_cost(problem, whole, found, {}, deviation) <=
                         stretch_cost(problem, whole, theta, {}, deviation);
  return is_better ? found : theta;  // sensors' laws may not be linear
}

}  // namespace graybox
