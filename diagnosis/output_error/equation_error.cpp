#include "diagnosis/output_error/equation_error.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/output_error/stretch_fit.hpp"
#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {
namespace {

constexpr int kFilterOrder = 4;
// Cut-off frequencies as shares of the sample rate.
constexpr double kShares[] = {0.2, 0.1, 0.05, 0.02, 0.01, 0.004};

// Which output measures each mass; none unless all free masses are measured and all laws are
// forces.
std::optional<std::vector<std::size_t>> measuring_outputs(const OutputErrorProblem& problem) {
  const LumpedModel& model = problem.model();
  for (const Element& part : model.parts) {
    if (part.location.kind != LocationKind::kElement) return {};
  }
  for (const OutputErrorRecording& run : problem.data().recordings) {
    if (!run.even) return {};
  }
  std::vector<std::size_t> result;
  for (Eigen::Index mass = 0; mass < model.masses.size(); ++mass) {
    if (model.imposed[static_cast<std::size_t>(mass)]) return {};
    const auto measures = [&](const LumpedOutput& output, LumpedOutput::Quantity quantity) {
      return output.mass == mass && output.quantity == quantity;
    };
    auto found = std::ranges::find_if(model.outputs, [&](const LumpedOutput& output) {
      return measures(output, LumpedOutput::Quantity::kPosition);
    });
    if (found == model.outputs.end()) {
      found = std::ranges::find_if(model.outputs, [&](const LumpedOutput& output) {
        return measures(output, LumpedOutput::Quantity::kVelocity);
      });
    }
    if (found == model.outputs.end()) return {};
    result.push_back(static_cast<std::size_t>(found - model.outputs.begin()));
  }
  return result;
}

// The same masses and elements with all motion imposed and all forces measured.
LumpedModel inverse_model(const LumpedModel& model) {
  LumpedModel inverse = model;
  inverse.inputs.clear();
  inverse.outputs.clear();
  inverse.output_names.clear();
  inverse.imposed.assign(model.imposed.size(), true);
  for (Eigen::Index mass = 0; mass < model.masses.size(); ++mass) {
    using enum LumpedInput::Kind;
    for (const auto kind : {kPosition, kVelocity, kAcceleration}) {
      inverse.inputs.push_back({kind, mass});
    }
    inverse.outputs.push_back({LumpedOutput::Quantity::kForce, mass, 0});
    inverse.output_names.push_back("force on " + model.mass_names[static_cast<std::size_t>(mass)]);
  }
  return inverse;
}

Eigen::VectorXd running_integral(const Eigen::VectorXd& values, double step) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index k = 1; k < values.size(); ++k) {
    sum(k) = sum(k - 1) + 0.5 * step * (values(k - 1) + values(k));
  }
  return sum;
}

// Every `stride`-th row without the filter's ends.
Eigen::MatrixXd thinned(const Eigen::MatrixXd& values, Eigen::Index edge, Eigen::Index stride) {
  const Eigen::Index count = (values.rows() - 2 * edge - 1) / stride + 1;
  Eigen::MatrixXd result(count, values.cols());
  for (Eigen::Index k = 0; k < count; ++k) result.row(k) = values.row(edge + k * stride);
  return result;
}

std::optional<OutputErrorRecording> inverse_recording(const OutputErrorRecording& run,
                                                      const LumpedModel& model,
                                                      const std::vector<std::size_t>& measured,
                                                      double share) {
  const auto edge = static_cast<Eigen::Index>(std::ceil(1.0 / share));
  const auto stride = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(0.1 / share));
  const Eigen::Index samples = run.time.size();
  if (samples < 2 * edge + 20 * stride) return {};
  const double step = run.time(1) - run.time(0);
  const auto masses = static_cast<Eigen::Index>(measured.size());
  Eigen::MatrixXd motion(samples, 3 * masses), force = Eigen::MatrixXd::Zero(samples, masses);
  for (Eigen::Index i = 0; i < masses; ++i) {
    const std::size_t output = measured[static_cast<std::size_t>(i)];
    const Eigen::VectorXd signal = zero_phase_low_pass(
        run.outputs.col(static_cast<Eigen::Index>(output)), share, kFilterOrder);
    const bool is_position = model.outputs[output].quantity == LumpedOutput::Quantity::kPosition;
    const Eigen::VectorXd rate = time_derivative(run.time, signal);
    motion.col(3 * i) = is_position ? signal : running_integral(signal, step);
    motion.col(3 * i + 1) = is_position ? rate : signal;
    motion.col(3 * i + 2) = is_position ? time_derivative(run.time, rate) : rate;
  }
  for (std::size_t j = 0; j < model.inputs.size(); ++j) {
    if (model.inputs[j].kind != LumpedInput::Kind::kForce) continue;
    force.col(model.inputs[j].mass) += run.inputs.col(static_cast<Eigen::Index>(j));
  }
  for (Eigen::Index i = 0; i < masses; ++i) {
    force.col(i) = zero_phase_low_pass(force.col(i), share, kFilterOrder);
  }
  return OutputErrorRecording{.name = run.name,
                              .role = run.role,
                              .time = thinned(run.time, edge, stride),
                              .even = true,
                              .inputs = thinned(motion, edge, stride),
                              .outputs = thinned(force, edge, stride)};
}

}  // namespace

std::vector<EquationErrorEstimate> equation_error_estimates(const OutputErrorProblem& problem) {
  std::vector<EquationErrorEstimate> estimates;
  const auto measured = measuring_outputs(problem);
  if (!measured) return estimates;
  const OutputErrorData& data = problem.data();
  const LumpedModel inverse = inverse_model(problem.model());
  const Eigen::VectorXd& time = data.recordings.front().time;
  for (const double share : kShares) {
    OutputErrorData motion{.hold = InputHold::kFirst, .noise = {}, .recordings = {}, .remarks = {}};
    bool is_long_enough = true;
    for (const OutputErrorRecording& run : data.recordings) {
      if (run.role != ExperimentRole::kEstimation) continue;
      auto imposed = inverse_recording(run, problem.model(), *measured, share);
      is_long_enough = is_long_enough && imposed.has_value();
      if (imposed) motion.recordings.push_back(std::move(*imposed));
    }
    if (!is_long_enough) continue;
    const OutputErrorProblem imposed(inverse, std::move(motion));
    const auto stretches = imposed.whole_recordings(ExperimentRole::kEstimation);
    // One unit for all forces: those of masses without input are compared with zero.
    const Eigen::VectorXd deviation =
        Eigen::VectorXd::Constant(imposed.output_scale().size(), imposed.output_scale().maxCoeff());
    const StretchFit fit = fit_stretches(imposed, stretches, problem.start(), {}, deviation,
                                         {.iteration_limit = 50, .tolerance = 1e-8});
    if (fit.status == StretchFit::Status::kDiverged || !fit.theta.allFinite()) continue;
    estimates.push_back({share / (time(1) - time(0)), fit.theta});
  }
  return estimates;
}

}  // namespace graybox
