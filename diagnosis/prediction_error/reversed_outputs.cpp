#include "diagnosis/prediction_error/reversed_outputs.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/signals/drive_work.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

constexpr std::size_t kMostOutputs = 4;
constexpr double kTogether = 0.5;  // correlation of two outputs that have one sign
constexpr double kGeared = 0.995;  // of two that a gear ties together
constexpr double kSmallestGear = 1.5;

// Whether several masses that move by themselves are measured, and nothing else is.
bool has_coupled_sensors(const LumpedModel& model) {
  if (model.has_imposed_motion() || model.outputs.size() > kMostOutputs) return false;
  std::vector<Eigen::Index> masses;
  for (const LumpedOutput& output : model.outputs) {
    using enum LumpedOutput::Quantity;
    if (output.quantity == kForce || output.quantity == kElementForce) return false;
    if (std::ranges::find(masses, output.mass) == masses.end()) masses.push_back(output.mass);
  }
  return masses.size() > 1;
}

// Whether one force drives masses whose motion is measured, and nothing else is.
bool has_one_force(const LumpedModel& model) {
  if (model.has_imposed_motion() || model.inputs.size() != 1 || model.outputs.empty()) return false;
  return std::ranges::all_of(model.outputs, [](const LumpedOutput& output) {
    using enum LumpedOutput::Quantity;
    return output.quantity != kForce && output.quantity != kElementForce;
  });
}

// With a spring at every free mass that has none, and a constant force if one is asked for.
PredictionFit with_springs(const PredictionFit& stated, const PredictionData& data,
                           const PredictionHypotheses& hypotheses, bool with_force, int threads) {
  constexpr double kStart = 0.01;  // of the forces that act
  const PredictionTask task = data.windows(data.first_horizon());
  const PredictionFitter fitter(data, task, force_noise_intensities(data)[1], threads);
  ExtendedLumpedModel model = stated.model;
  for (const LawExtension& law : hypotheses.extensions(stated.model, fitter.motion(stated))) {
    const bool is_of_mass = (law.location.output.array() != 0.0).count() == 1;
    const bool is_asked = law.law == "stiffness" || (with_force && law.law == "offset");
    if (is_asked && is_of_mass) model = extended(model, law, kStart * law.unit);
  }
  return short_fit(model, data, threads);
}

// The best short fit under a pattern of signs.
PredictionFit fitted(const LumpedModel& model, const PredictionData& data,
                     const PredictionHypotheses& hypotheses, int threads) {
  return short_fit(scaled_to_predict(with_zeros(model, data, hypotheses), data, threads), data,
                   threads);
}

// -1 for the outputs whose bit is set.
VectorXd signs_of(std::size_t number, std::size_t outputs) {
  VectorXd signs = VectorXd::Ones(static_cast<Eigen::Index>(outputs));
  for (std::size_t j = 0; j < outputs; ++j) {
    if ((number >> j & 1U) != 0) signs(static_cast<Eigen::Index>(j)) = -1.0;
  }
  return signs;
}

// Two outputs of one quantity, each about its mean in every recording of the fit.
struct OutputPair {
  Eigen::Index first = 0, second = 0;
  double correlation = 0.0;
  double ratio = 1.0;  // rms of the second over that of the first
};

std::vector<OutputPair> pairs_of_outputs(const LumpedModel& model, const PredictionData& data) {
  const Eigen::Index outputs = data.output_count();
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(outputs, outputs);
  for (const OutputErrorRecording& recording : data.recordings()) {
    if (recording.role != ExperimentRole::kEstimation) continue;
    const Eigen::MatrixXd moved =
        recording.outputs.rowwise() - recording.outputs.colwise().mean().eval();
    products += moved.transpose() * moved;
  }
  const VectorXd norms = products.diagonal().cwiseSqrt();
  std::vector<OutputPair> pairs;
  for (Eigen::Index i = 0; i < outputs; ++i) {
    for (Eigen::Index j = i + 1; j < outputs; ++j) {
      const LumpedOutput &first = model.outputs[static_cast<std::size_t>(i)],
                         &second = model.outputs[static_cast<std::size_t>(j)];
      if (first.quantity != second.quantity || !(norms(i) > 0.0) || !(norms(j) > 0.0)) continue;
      pairs.push_back({i, j, products(i, j) / (norms(i) * norms(j)), norms(j) / norms(i)});
    }
  }
  return pairs;
}

// Whether one of two outputs that move together is turned and the other is not.
bool parts_a_pair(const VectorXd& signs, const std::vector<OutputPair>& pairs) {
  return std::ranges::any_of(pairs, [&](const OutputPair& pair) {
    return pair.correlation > kTogether && signs(pair.first) != signs(pair.second);
  });
}

double share_left(const PredictionFit& fit, const PredictionData& data) {
  const PredictionTask task = data.windows(data.first_horizon());
  const VectorXd& scale = data.output_scale();
  const VectorXd error = PredictionFitter(data, task, 0.0, 1).errors(fit, scale);
  return std::sqrt((error.array() / scale.array()).square().mean());
}

// `message` without what mends it.
ChannelFault fault_of(std::vector<std::string> channels, const std::string& message,
                      const std::string& preprocess, const PredictionFit& before,
                      const PredictionFit& after, const PredictionData& data) {
  ChannelFault fault;
  fault.channels = std::move(channels);
  fault.message = fmt::format("{} (preprocess: [{{{}}}])", message, preprocess);
  fault.measure = "error of the prediction over the signal";
  fault.dissimilarity_before = share_left(before, data);
  fault.dissimilarity_after = share_left(after, data);
  return fault;
}

ChannelFault fault_of_signs(const std::vector<std::string>& channels, const std::string& reason,
                            const PredictionFit& before, const PredictionFit& after,
                            const PredictionData& data) {
  return fault_of(channels,
                  fmt::format("{} {} the wrong sign: {}", fmt::join(channels, " and "),
                              channels.size() == 1 ? "has" : "have", reason),
                  fmt::format("kind: sign, of: [{}]", fmt::join(channels, ", ")), before, after,
                  data);
}

// The output that measures the mass on which the force acts; none where no output does.
std::optional<std::size_t> driven_output(const LumpedModel& model) {
  if (model.inputs.front().kind != LumpedInput::Kind::kForce) return {};
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    using enum LumpedOutput::Quantity;
    const LumpedOutput& output = model.outputs[j];
    const bool is_motion = output.quantity == kPosition || output.quantity == kVelocity;
    if (is_motion && output.mass == model.inputs.front().mass) return j;
  }
  return {};
}

// The work of the force on the mass that it acts on.
DriveWorkBothWays work_of_force(const LumpedModel& model, const PredictionData& data) {
  const std::optional<std::size_t> output = driven_output(model);
  DriveWorkBothWays work;
  if (!output) return work;
  for (const OutputErrorRecording& recording : data.recordings()) {
    if (recording.role != ExperimentRole::kEstimation) continue;
    work += drive_work(recording.inputs.col(0),
                       recording.outputs.col(static_cast<Eigen::Index>(*output)),
                       model.outputs[*output].quantity == LumpedOutput::Quantity::kVelocity);
  }
  return work;
}

// How much less the reversed force must leave than any fit with the stated one, where blocks alone
// do not tell: a single start moves in few of them.
double share_that_tells(const DriveWorkBothWays& work) {
  constexpr double kAnyway = 0.2, kAgainstMotion = 0.5;
  if (takes_energy_both_ways(work)) return 1.0;
  return takes_energy(work) ? kAgainstMotion : kAnyway;
}

// All outputs reversed against the stated signs, with springs and constant forces as well.
std::vector<ChannelFault> find_reversed_force(const LumpedModel& model, const PredictionData& data,
                                              const PredictionHypotheses& hypotheses,
                                              const PredictionFit& stated, int threads) {
  if (!has_one_force(model) || !stated.usable) return {};
  const PredictionData turned =
      data.with_factors(model, VectorXd::Constant(data.output_count(), -1.0), threads);
  const PredictionFit reversed = fitted(model, turned, hypotheses, threads);
  const DriveWorkBothWays work = work_of_force(model, data);
  const bool takes_both_ways = takes_energy_both_ways(work);
  const double share = share_that_tells(work);
  const auto is_better = [&](const PredictionFit& other) {
    return is_clearly_better(reversed, other) ||
           (reversed.usable && reversed.cost < share * other.cost);
  };
  if (!is_better(stated)) return {};
  for (const bool with_force : {false, true}) {
    if (takes_both_ways) break;  // that no spring and no constant force does
    const PredictionFit sprung = with_springs(stated, data, hypotheses, with_force, threads);
    if (sprung.usable && !is_better(sprung)) return {};
  }
  const std::string reason =
      takes_both_ways
          ? "it acts against the motion both ways, which takes energy out of the machine that no "
            "friction, spring or weight has; else a hand or another machine moves it"
          : fmt::format("the motion goes against it, and the other sign predicts {} samples ahead",
                        data.first_horizon());
  // Turning all outputs is the same.
  const std::string &force = model.input_names.front(),
                    outputs = fmt::format("{}", fmt::join(model.output_names, ", "));
  return {
      fault_of({force},
               fmt::format("{} has the wrong sign, or {} {}: {}", force,
                           fmt::join(model.output_names, " and "),
                           model.output_names.size() == 1 ? "has" : "have", reason),
               fmt::format("kind: sign, of: [{}]}}]; or [{{kind: sign, of: [{}]", force, outputs),
               stated, reversed, data)};
}

// Sensors of two masses that a gear ties together, which the model lacks: they move alike, but not
// as far.
std::vector<ChannelFault> find_gears(const LumpedModel& model, const PredictionData& data,
                                     const PredictionHypotheses& hypotheses,
                                     const std::vector<OutputPair>& pairs,
                                     const PredictionFit& stated, int threads) {
  std::vector<ChannelFault> faults;
  if (!stated.usable) return faults;
  for (const OutputPair& pair : pairs) {
    const bool is_geared =
        pair.correlation > kGeared && std::max(pair.ratio, 1.0 / pair.ratio) > kSmallestGear;
    if (!is_geared) continue;
    VectorXd factors = VectorXd::Ones(data.output_count());
    factors(pair.second) = 1.0 / pair.ratio;
    const PredictionData scaled = data.with_factors(model, factors, threads);
    const PredictionFit fit = fitted(model, scaled, hypotheses, threads);
    if (!is_clearly_better(fit, stated)) continue;
    const bool is_rivalled = std::ranges::any_of(std::array{false, true}, [&](bool with_force) {
      const PredictionFit sprung = with_springs(stated, data, hypotheses, with_force, threads);
      return is_clearly_better(sprung, fit);
    });
    if (is_rivalled) continue;
    const std::string& moved = model.output_names[static_cast<std::size_t>(pair.second)];
    faults.push_back(fault_of(
        {moved},
        fmt::format("{} moves {:.3g} times as far as {}, always alike: a gear or a belt? State it "
                    "by a scale",
                    moved, pair.ratio, model.output_names[static_cast<std::size_t>(pair.first)]),
        fmt::format("kind: scale, of: [{}], factor: {:.4g}", moved, 1.0 / pair.ratio), stated, fit,
        data));
  }
  return faults;
}

}  // namespace

std::vector<ChannelFault> find_reversed_outputs(const LumpedModel& model,
                                                const PredictionData& data,
                                                const PredictionHypotheses& hypotheses,
                                                int threads) {
  const bool is_coupled = has_coupled_sensors(model);
  if (!is_coupled && !has_one_force(model)) return {};
  const PredictionFit stated = fitted(model, data, hypotheses, threads);
  if (!is_coupled) return find_reversed_force(model, data, hypotheses, stated, threads);
  const std::vector<OutputPair> pairs = pairs_of_outputs(model, data);
  const std::size_t outputs = model.outputs.size();
  PredictionFit best = stated;
  VectorXd reversed;
  const std::size_t all = (std::size_t{1} << outputs) - 1;
  for (std::size_t number = 1; number < all; ++number) {
    const VectorXd signs = signs_of(number, outputs);
    if (parts_a_pair(signs, pairs)) continue;
    const PredictionData turned = data.with_factors(model, signs, threads);
    PredictionFit fit = fitted(model, turned, hypotheses, threads);
    if (!fit.usable || (best.usable && !(fit.cost < best.cost))) continue;
    best = std::move(fit);
    reversed = signs;
  }
  if (!stated.usable) return {};
  if (reversed.size() == 0 || !is_clearly_better(best, stated)) {
    std::vector<ChannelFault> gears = find_gears(model, data, hypotheses, pairs, stated, threads);
    if (!gears.empty()) return gears;
    return find_reversed_force(model, data, hypotheses, stated, threads);
  }
  std::vector<std::string> channels;
  for (std::size_t j = 0; j < outputs; ++j) {
    if (reversed(static_cast<Eigen::Index>(j)) < 0.0) channels.push_back(model.output_names[j]);
  }
  return {fault_of_signs(
      channels, fmt::format("the other one is predicted {} samples ahead", data.first_horizon()),
      stated, best, data)};
}

std::optional<double> error_with_force_reversed(const LumpedModel& model,
                                                const PredictionData& data,
                                                const PredictionHypotheses& hypotheses,
                                                Eigen::Index horizon, int threads) {
  constexpr int kIterations = 25;
  if (!has_one_force(model)) return {};
  const PredictionData turned =
      data.with_factors(model, VectorXd::Constant(data.output_count(), -1.0), threads);
  const PredictionFit start = fitted(model, turned, hypotheses, threads);
  if (!start.usable) return {};
  const PredictionTask task = turned.windows(horizon);
  const PredictionFitter fitter(turned, task, force_noise_intensities(turned)[1], threads);
  const VectorXd& scale = turned.output_scale();
  const PredictionFit fit = fitter.fit(start.model, scale, {}, kIterations);
  if (!fit.usable) return {};
  const VectorXd error = fitter.errors(fit, scale);
  return std::sqrt((error.array() / scale.array()).square().mean());
}

}  // namespace graybox
