#include "diagnosis/prediction_error/search_start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/prediction_error/unsigned_outputs.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kConstant = 10.0;  // mean of a spring's deflection over its deviation
constexpr int kDecades = 3, kPerDecade = 2;
constexpr double kAsWell = 0.95;  // of the cost: what is stated does as well
constexpr double kMargin = 0.5;   // of the cost, for another factor than one
constexpr int kShortIterations = 15;
constexpr std::size_t kStarts = 3;      // that are fitted
constexpr double kClearlyBetter = 0.5;  // of the cost
constexpr double kErrors = 3.0;         // z

// Factors of what a lumped model states, by kind.
struct Factors {
  double masses = 1.0, dampings = 1.0, springs = 1.0;
  [[nodiscard]] double of(const LumpedParameter& parameter) const {
    if (parameter.unit.starts_with("kg")) return masses;
    const bool is_damping = parameter.unit.find(" s") != std::string::npos;  // N s/m, N m s/rad
    return is_damping ? dampings : springs;
  }
};

ExtendedLumpedModel scaled_by(const ExtendedLumpedModel& model, const Factors& factors) {
  ExtendedLumpedModel scaled = model;
  std::vector<double> values = model.values();
  const std::size_t own = model.own_parameters();
  for (std::size_t p = 0; p < own; ++p) {
    ParameterSpace& space = scaled.space[p];
    if (model.model.parameters[p].fixed || !space.logarithmic) continue;
    const double factor = factors.of(model.model.parameters[p]);
    for (double* const each : {&values[p], &space.scale}) *each *= factor;
    (factor < 1.0 ? space.low : space.high) *= factor;  // what is stated stays inside
  }
  return with_values(scaled, values);
}

// 1, 10^(-1/2), 10^(1/2), 10^-1, ... to 1000 either way.
double factor_of_step(int i) {
  const int step = i % 2 == 0 ? i / 2 : -(i + 1) / 2;  // 0, -1, 1, -2, 2, ...
  return std::pow(10.0, static_cast<double>(step) / kPerDecade);
}
constexpr int kFactors = 2 * kDecades * kPerDecade + 1;
constexpr int kLargestFactor = kFactors - 1;  // its step

// rms of what each output moves by within so many samples, in the recordings of the fit.
VectorXd motion_within(Index samples, const PredictionData& data) {
  VectorXd squares = VectorXd::Zero(data.output_count());
  double count = 0.0;
  for (const OutputErrorRecording& recording : data.recordings()) {
    const Index rows = recording.outputs.rows() - samples;
    if (recording.role != ExperimentRole::kEstimation || rows < 1) continue;
    squares += (recording.outputs.bottomRows(rows) - recording.outputs.topRows(rows))
                   .colwise()
                   .squaredNorm()
                   .transpose();
    count += static_cast<double>(rows);
  }
  return (squares / std::max(1.0, count)).cwiseSqrt();
}

// The first rung so far ahead that some output moves by twenty times its noise, else the last one:
// nearer, a prediction tells of the noise alone.
Index telling_horizon(const PredictionData& data) {
  constexpr double kMultiple = 20.0;
  Index horizon = data.first_horizon();
  for (const Index next : {3 * horizon, 10 * horizon, 30 * horizon, 100 * horizon}) {
    const VectorXd moved = motion_within(horizon, data);
    if ((moved.array() > kMultiple * data.noise().array()).any()) break;
    if (data.window_count(next) < kFewestHorizonWindows) break;
    horizon = next;
  }
  return horizon;
}

// The position output of each mass; none: not measured.
std::vector<std::optional<std::size_t>> position_outputs(const LumpedModel& model) {
  std::vector<std::optional<std::size_t>> outputs(model.mass_names.size());
  for (std::size_t k = 0; k < model.outputs.size(); ++k) {
    if (model.outputs[k].quantity != LumpedOutput::Quantity::kPosition) continue;
    outputs[static_cast<std::size_t>(model.outputs[k].mass)] = k;
  }
  return outputs;
}

struct Deflection {
  double mean = 0.0, deviation = 0.0;
};

// Of b'q by what the encoders say.
Deflection measured_deflection(const VectorXd& b,
                               const std::vector<std::optional<std::size_t>>& outputs,
                               const PredictionData& data) {
  double sum = 0.0, squares = 0.0, samples = 0.0;
  for (const OutputErrorRecording& recording : data.recordings()) {
    if (recording.role != ExperimentRole::kEstimation) continue;
    VectorXd z = VectorXd::Zero(recording.outputs.rows());
    for (Index i = 0; i < b.size(); ++i) {
      if (b(i) == 0.0) continue;
      z += b(i) * recording.outputs.col(static_cast<Index>(*outputs[static_cast<std::size_t>(i)]));
    }
    sum += z.sum();
    squares += z.squaredNorm();
    samples += static_cast<double>(z.size());
  }
  const double mean = sum / samples;
  return {mean, std::sqrt(std::max(0.0, squares / samples - mean * mean))};
}

// The last measured mass of a spring between several.
std::optional<Index> last_mass(const Element& spring,
                               const std::vector<std::optional<std::size_t>>& outputs) {
  const VectorXd& b = spring.location.output;
  const bool is_spring = spring.location.kind == LocationKind::kElement &&
                         spring.law_name == "stiffness" && (b.array() != 0.0).count() > 1;
  if (!is_spring) return {};
  std::optional<Index> last;
  for (Index i = 0; i < b.size(); ++i) {
    if (b(i) == 0.0) continue;
    if (!outputs[static_cast<std::size_t>(i)]) return {};
    last = i;
  }
  return last;
}

struct OneMass {
  double mass = 1.0, damping = 1.0;
};

// The rms velocity of the only mass over so many samples; none where it is not measured.
std::optional<double> velocity_within(Index samples, const LumpedModel& model,
                                      const PredictionData& data) {
  const VectorXd moved = motion_within(samples, data);
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    using enum LumpedOutput::Quantity;
    const auto at = static_cast<Index>(j);
    const double seconds = static_cast<double>(samples) * data.sample_time();
    if (model.outputs[j].quantity == kPosition) return moved(at) / seconds;
    const bool is_signed_speed =
        model.outputs[j].quantity == kVelocity && !never_negative(at, data);
    if (is_signed_speed) return data.output_scale()(at);
  }
  return {};
}

bool is_free(const LumpedModel& model, bool of_mass) {
  return std::ranges::any_of(model.parameters, [&](const LumpedParameter& parameter) {
    return parameter.unit.starts_with("kg") == of_mass && !parameter.fixed;
  });
}

std::optional<OneMass> sizes_by_data(const LumpedModel& model, Index horizon,
                                     const PredictionData& data) {
  if (!is_one_mass_alone(model) || !(model.masses(0) > 0.0)) return {};
  const double seconds = static_cast<double>(horizon) * data.sample_time();
  const std::optional<double> velocity = velocity_within(horizon, model, data);
  if (!velocity || !(*velocity > 0.0) || !(seconds > 0.0)) return {};
  const double damping =
      is_free(model, true) ? data.force_scale() / *velocity : model.masses(0) / seconds;
  if (!(damping > 0.0) || !std::isfinite(damping)) return {};
  return OneMass{damping * seconds, damping};
}

// What is fixed stays. A damping of zero stays, too: the model has none.
LumpedModel with_one_mass(const LumpedModel& model, const OneMass& sizes) {
  std::vector<double> values;
  for (const LumpedParameter& parameter : model.parameters) {
    const bool stays = parameter.fixed || !(parameter.value > 0.0);
    const bool is_mass = parameter.unit.starts_with("kg");
    values.push_back(stays ? parameter.value : is_mass ? sizes.mass : sizes.damping);
  }
  return with_parameters(model, values);
}

// After a few iterations.
double fitted_cost(const PredictionFitter& fitter, const ExtendedLumpedModel& start,
                   const PredictionData& data) {
  const PredictionFit fit = fitter.fit(start, data.output_scale(), {}, kShortIterations);
  return fit.usable ? fit.cost : std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<double> force_noise_intensities(const PredictionData& data) {
  const double unit = data.force_scale() * std::sqrt(data.sample_time());
  return {0.03 * unit, 0.3 * unit, 3.0 * unit};
}

IntensityFit best_intensity(const ExtendedLumpedModel& model, const PredictionData& data,
                            const PredictionTask& task, int iterations, int threads) {
  const std::vector<double> candidates = force_noise_intensities(data);
  IntensityFit best{{}, candidates[1]};
  for (const double intensity : candidates) {
    const PredictionFitter fitter(data, task, intensity, threads);
    PredictionFit fit = fitter.fit(model, data.output_scale(), {}, iterations, iterations > 0);
    if (!fit.usable || (best.fit.usable && !(fit.cost < best.fit.cost))) continue;
    best = {std::move(fit), intensity};
  }
  return best;
}

double start_intensity(const ExtendedLumpedModel& model, const PredictionData& data, int threads) {
  return best_intensity(model, data, data.windows(data.first_horizon()), 0, threads).intensity;
}

std::optional<LawExtension> missing_at_sensor(const LumpedModel& model, std::size_t output,
                                              const std::string& law,
                                              const PredictionHypotheses& hypotheses) {
  const bool is_there = std::ranges::any_of(model.parts, [&](const Element& part) {
    return part.location.kind == LocationKind::kSensor && part.law_name == law &&
           static_cast<std::size_t>(part.location.channel) == output;
  });
  const std::optional<std::size_t> hypothesis = hypotheses.at_sensor(output, law);
  if (is_there || !hypothesis) return {};
  LawExtension extension;
  extension.hypothesis = *hypothesis;
  extension.location = hypotheses.location(*hypothesis);
  extension.law = law;
  extension.base = {0.0};
  extension.direction = {1.0};
  extension.fixed = {false};
  return extension;
}

PredictionFit short_fit(const ExtendedLumpedModel& start, const PredictionData& data, int threads) {
  return best_intensity(start, data, data.windows(data.first_horizon()), kShortIterations, threads)
      .fit;
}

void limit_noise(PredictionData& data, const LumpedModel& model, int threads) {
  constexpr double kDoubtful = 0.001;  // of the signal; less is read well from differences
  const VectorXd& scale = data.output_scale();
  if ((data.noise().array() < kDoubtful * scale.array()).all()) return;
  VectorXd most = data.noise();
  for (const Index horizon : {Index{1}, data.first_horizon()}) {
    const PredictionTask task = data.windows(horizon);
    const IntensityFit ahead =
        best_intensity(as_given(model, kSearchFactor), data, task, kShortIterations, threads);
    if (!ahead.fit.usable) continue;
    const PredictionFitter fitter(data, task, ahead.intensity, threads);
    const VectorXd share =
        fitter.errors(ahead.fit, scale).cwiseQuotient(fitter.errors_by_noise(ahead.fit, scale));
    most = most.cwiseMin(data.noise().cwiseProduct(share));
  }
  data.limit_noise(most);
}

bool is_clearly_better(const PredictionFit& other, const PredictionFit& stated) {
  return other.usable && other.cost < kClearlyBetter * stated.cost &&
         z_between(stated, other) > kErrors;
}

ExtendedLumpedModel with_zeros(const LumpedModel& model, const PredictionData& data,
                               const PredictionHypotheses& hypotheses) {
  ExtendedLumpedModel result = as_given(model, kSearchFactor);
  const std::vector<std::optional<std::size_t>> outputs = position_outputs(model);
  for (const Element& part : model.parts) {
    const std::optional<Index> mass = last_mass(part, outputs);
    if (!mass) continue;
    const std::size_t output = *outputs[static_cast<std::size_t>(*mass)];
    std::optional<LawExtension> zero =
        missing_at_sensor(result.model, output, "offset", hypotheses);
    if (!zero) continue;
    const Deflection deflection = measured_deflection(part.location.output, outputs, data);
    if (std::abs(deflection.mean) < kConstant * deflection.deviation) continue;
    zero->unit = data.output_scale()(static_cast<Index>(output));
    result = extended(result, *zero, deflection.mean / part.location.output(*mass));
  }
  return result;
}

ExtendedLumpedModel scaled_to_predict(const ExtendedLumpedModel& model, const PredictionData& data,
                                      int threads) {
  const PredictionTask task = data.windows(data.first_horizon());
  const PredictionFitter fitter(data, task, force_noise_intensities(data)[1], threads);
  ExtendedLumpedModel best = model;
  double least = std::numeric_limits<double>::infinity();
  VectorXd residuals;
  for (int i = 0; i < kFactors; ++i) {
    const double factor = factor_of_step(i);
    ExtendedLumpedModel scaled = scaled_by(model, {factor, factor, factor});
    if (!fitter.residuals(scaled, data.output_scale(), fitter.measured_initials(scaled.model), {},
                          residuals)) {
      continue;
    }
    const double cost = residuals.squaredNorm();
    if (!(cost < (i == 0 || !std::isfinite(least) ? 1.0 : kMargin) * least)) continue;
    least = cost;
    best = std::move(scaled);
  }
  return best;
}

LumpedModel started_by_data(const LumpedModel& model, const PredictionData& all,
                            const SampleLimit& limit, int threads) {
  const std::optional<OneMass> sizes = sizes_by_data(model, telling_horizon(all), all);
  if (!sizes) return model;
  const PredictionData data = all.for_model(with_one_mass(model, *sizes), threads, limit);
  const PredictionTask task = data.windows(telling_horizon(data));
  if (task.counted() == 0) return model;
  struct Start {
    double cost = 0.0;
    int mass = 0, damping = 0;  // steps
  };
  const PredictionFitter fitter(data, task, force_noise_intensities(data)[1], threads);
  const auto model_at = [&](const Start& start) {
    return with_one_mass(model, {sizes->mass * factor_of_step(start.mass),
                                 sizes->damping * factor_of_step(start.damping)});
  };
  std::vector<Start> starts;
  const int masses = is_free(model, true) ? kFactors : 1;
  const int dampings = is_free(model, false) ? kFactors : 1;
  for (int i = 0; i < masses; ++i) {
    for (int k = 0; k < dampings; ++k) {
      Start start{0.0, i, k};
      const PredictionFit fit =
          fitter.fit(as_given(model_at(start), kSearchFactor), data.output_scale(), {}, 0, false);
      start.cost = fit.cost;
      if (fit.usable) starts.push_back(start);
    }
  }
  // What coasts or hardly moves, whatever the force.
  double cost_without_force = std::numeric_limits<double>::infinity();
  for (const Start& start : starts) {
    const bool is_unmoved = start.mass == kLargestFactor || start.damping == kLargestFactor;
    if (is_unmoved) cost_without_force = std::min(cost_without_force, start.cost);
  }
  std::ranges::stable_sort(starts, std::less{}, &Start::cost);
  LumpedModel best = model;
  const double stated = fitted_cost(fitter, as_given(model, kSearchFactor), data);
  double least = std::min(kMargin * cost_without_force, kAsWell * stated);
  for (std::size_t s = 0; s < std::min<std::size_t>(kStarts, starts.size()); ++s) {
    const LumpedModel start = model_at(starts[s]);
    const double cost = fitted_cost(fitter, as_given(start, kSearchFactor), data);
    if (!(cost < least)) continue;
    least = cost;
    best = start;
  }
  return best;
}

ExtendedLumpedModel started_to_predict(const ExtendedLumpedModel& model, const PredictionData& data,
                                       int threads) {
  const PredictionTask task = data.windows(telling_horizon(data));
  if (task.runs.empty() || task.counted() == 0) return model;
  struct Start {
    double cost = 0.0;
    Factors factors;
  };
  std::vector<Start> starts;
  const PredictionFitter fitter(data, task, force_noise_intensities(data)[1], threads);
  for (int i = 0; i < kFactors; ++i) {
    for (int k = 0; k < kFactors; ++k) {
      const double masses = factor_of_step(i), dampings = factor_of_step(k);
      const PredictionFit fit = fitter.fit(scaled_by(model, {masses, dampings, masses}),
                                           data.output_scale(), {}, 0, false);
      if (fit.usable) starts.push_back({fit.cost, {masses, dampings, masses}});
      if (i == 0 && k == 0) starts.resize(1, {std::numeric_limits<double>::infinity(), {}});
    }
  }
  const Start given = starts.front();
  std::ranges::stable_sort(starts, std::less{}, &Start::cost);
  ExtendedLumpedModel best = model;
  double least = kMargin * fitted_cost(fitter, model, data);
  for (std::size_t s = 0; s < std::min<std::size_t>(kStarts, starts.size()); ++s) {
    if (!(starts[s].cost < given.cost)) break;
    ExtendedLumpedModel start = scaled_by(model, starts[s].factors);
    const double cost = fitted_cost(fitter, start, data);
    if (!(cost < least)) continue;
    least = cost;
    best = std::move(start);
  }
  return best;
}

}  // namespace graybox
