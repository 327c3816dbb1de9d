#include "diagnosis/output_error/output_error_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/output_error/equation_error.hpp"
#include "diagnosis/output_error/linear_start.hpp"
#include "diagnosis/output_error/output_error_covariance.hpp"
#include "diagnosis/output_error/stretch_fit.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Initial = std::vector<Eigen::VectorXd>;

Initial initial_states(const OutputErrorProblem& problem, std::span<const StretchOf> stretches,
                       InitialState kind) {
  Initial initial;
  if (problem.initial_size() == 0) return initial;
  for (const StretchOf& stretch : stretches) {
    initial.push_back(kind == InitialState::kRest
                          ? Eigen::VectorXd::Zero(problem.initial_size()).eval()
                          : problem.measured_initial(stretch));
  }
  return initial;
}

// ---- starts -------------------------------------------------------------------------------------

// Every value off by a factor up to `spread` either way; zeros stay.
Eigen::VectorXd random_start(const OutputErrorProblem& problem, const OutputErrorOptions& options,
                             std::size_t number) {
  Random random(options.seed * 1000003U + number);
  Eigen::VectorXd theta = problem.start();
  for (Eigen::Index i = 0; i < theta.size(); ++i) {
    const auto range =
        problem.model().parameters[problem.free_parameters()[static_cast<std::size_t>(i)]].range;
    theta(i) *= std::pow(options.start_spread, 2.0 * random.uniform() - 1.0);
    if (range == ParameterRange::kUnitInterval) theta(i) = std::min(theta(i), 1.0);
  }
  return theta;
}

std::vector<OutputErrorStart> all_starts(const OutputErrorProblem& problem,
                                         const OutputErrorOptions& options) {
  std::vector<OutputErrorStart> starts;
  if (options.equation_error) {
    for (const auto& estimate : equation_error_estimates(problem)) {
      starts.push_back(
          {fmt::format("equation error at {:.3g} Hz", estimate.frequency), estimate.theta});
    }
  }
  starts.push_back({.origin = "model", .theta = problem.start()});
  for (int k = 0; k < options.starts; ++k) {
    starts.push_back({"random", random_start(problem, options, static_cast<std::size_t>(k))});
  }
  return starts;
}

// ---- the way down -------------------------------------------------------------------------------

bool has_law_states(const LumpedModel& model) {
  return std::ranges::any_of(model.parts, [](const Element& part) {
    return part.law != nullptr && part.law->state_count() > 0;
  });
}

Eigen::Index longest(const OutputErrorProblem& problem) {
  Eigen::Index samples = 0;
  for (const StretchOf& stretch : problem.whole_recordings(ExperimentRole::kEstimation)) {
    samples = std::max(samples, stretch.stretch.count);
  }
  return samples;
}

class Search {
 public:
  Search(OutputErrorProblem& problem, const OutputErrorOptions& options)
      : problem_(problem),
        options_(options),
        whole_(problem.whole_recordings(ExperimentRole::kEstimation)),
        whole_initial_(initial_states(problem, whole_, options.initial_state)),
        deviation_(problem.output_scale()) {
    for (Eigen::Index j = 0; j < deviation_.size(); ++j) {
      const double noise = problem.data().noise(j);
      if (noise > 0.0) deviation_(j) = noise;
    }
  }

  [[nodiscard]] const std::vector<StretchOf>& whole() const { return whole_; }
  [[nodiscard]] const Eigen::VectorXd& deviation() const { return deviation_; }
  std::vector<OutputErrorStart>& starts() { return starts_; }
  [[nodiscard]] int iterations() const { return iterations_; }

  // The best that is found; status kDiverged if nothing is.
  StretchFit run() {
    starts_ = all_starts(problem_, options_);
    const bool by_windows = problem_.initial_size() > 0 && !has_law_states(problem_.model());
    const std::vector<Eigen::VectorXd> candidates = fit_starts(by_windows);
    StretchFit best;
    best.cost = kInfinity;
    for (const Eigen::VectorXd& theta : candidates) {
      StretchFit fit = fit_whole(theta, by_windows);
      if (fit.status != StretchFit::Status::kDiverged && fit.cost < best.cost)
        best = std::move(fit);
      if (best.status == StretchFit::Status::kInterrupted) break;
    }
    estimate_noise(best);
    return best;
  }

  // Once more over whole recordings, from where `fit` is: after a change of the integrator's steps.
  StretchFit again(const StretchFit& fit) { return fit_once(whole_, fit.theta, fit.initial, true); }

 private:
  StretchFit fit_once(std::span<const StretchOf> stretches, const Eigen::VectorXd& theta,
                      Initial initial, bool whole) {
    const bool free_initial = !whole || options_.initial_state == InitialState::kFree;
    StretchFit fit = fit_stretches(problem_, stretches, theta, std::move(initial), deviation_,
                                   {.free_initial = free_initial,
                                    .iteration_limit = whole ? options_.iteration_limit : 30,
                                    .tolerance = whole ? 1e-10 : 1e-6,
                                    .keep_going = options_.keep_going});
    iterations_ += fit.iterations;
    return fit;
  }

  // Fits the starts of least error; the two best ends that differ.
  std::vector<Eigen::VectorXd> fit_starts(bool by_windows) {
    constexpr Eigen::Index kSamples = 4000;
    const Eigen::Index length = std::clamp<Eigen::Index>(longest(problem_) / 20, 50, 1000);
    const auto stretches = by_windows ? problem_.windows(length, kSamples) : whole_;
    const Initial initial =
        by_windows ? initial_states(problem_, stretches, InitialState::kMeasured) : whole_initial_;
    for (OutputErrorStart& start : starts_) {
      start.theta = with_linear_optimum(problem_, start.theta, deviation_);
      start.cost = stretch_cost(problem_, stretches, start.theta, initial, deviation_);
    }
    std::ranges::stable_sort(starts_, {}, &OutputErrorStart::cost);
    std::vector<std::pair<double, Eigen::VectorXd>> ends;
    const auto count = std::min<std::size_t>(
        starts_.size(), static_cast<std::size_t>(std::max(1, options_.window_fits)));
    for (std::size_t k = 0; k < count && starts_[k].cost < kInfinity; ++k) {
      const StretchFit fit = fit_once(stretches, starts_[k].theta, initial, false);
      if (fit.status == StretchFit::Status::kDiverged) continue;
      starts_[k].fitted = fit.cost;
      starts_[k].end = fit.theta;
      ends.emplace_back(fit.cost, fit.theta);
      if (fit.status == StretchFit::Status::kInterrupted) break;
    }
    std::ranges::stable_sort(ends, {}, [](const auto& end) { return end.first; });
    // Equal costs: the same end.
    std::vector<Eigen::VectorXd> result;
    double last = -1.0;
    for (const auto& [cost, theta] : ends) {
      if (result.size() < 2 && cost > last * (1.0 + 1e-4)) result.push_back(theta);
      last = cost;
    }
    return result;
  }

  StretchFit fit_whole(Eigen::VectorXd theta, bool by_windows) {
    if (by_windows &&
        !(stretch_cost(problem_, whole_, theta, whole_initial_, deviation_) < kInfinity)) {
      theta = fit_longer_windows(theta);
    }
    return fit_once(whole_, theta, whole_initial_, true);
  }

  Eigen::VectorXd fit_longer_windows(Eigen::VectorXd theta) {
    const Eigen::Index samples = longest(problem_);
    for (Eigen::Index length = samples / 10; length < samples; length = length * 2 + 1) {
      const auto stretches = problem_.windows(length, 4 * samples);
      const StretchFit fit = fit_once(
          stretches, theta, initial_states(problem_, stretches, InitialState::kMeasured), false);
      if (fit.status == StretchFit::Status::kDiverged) break;
      theta = fit.theta;
    }
    return theta;
  }

  // Several outputs of unknown noise: each error over its own rms, until that settles.
  void estimate_noise(StretchFit& fit) {
    const Eigen::VectorXd& stated = problem_.data().noise;
    if (fit.status == StretchFit::Status::kDiverged || stated.minCoeff() > 0.0) return;
    for (int round = 0; round < (stated.size() > 1 ? 3 : 1); ++round) {
      const Eigen::VectorXd rms = residual_rms(fit);
      for (Eigen::Index j = 0; j < stated.size(); ++j) {
        if (stated(j) == 0.0) deviation_(j) = std::max(rms(j), 1e-12 * problem_.output_scale()(j));
      }
      if (stated.size() > 1) fit = again(fit);
    }
    if (stated.size() == 1) {
      fit.cost = stretch_cost(problem_, whole_, fit.theta, fit.initial, deviation_);
    }
  }

  [[nodiscard]] Eigen::VectorXd residual_rms(const StretchFit& fit) const {
    std::vector<Simulated> runs;
    problem_.simulate(fit.theta, whole_, fit.initial, false, runs);
    const Eigen::Index ny = deviation_.size();
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(ny);
    Eigen::Index samples = 0;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const Eigen::VectorXd error = runs[k].outputs.col(0) - problem_.measured(whole_[k]);
      for (Eigen::Index i = 0; i < error.size(); ++i) squares(i % ny) += error(i) * error(i);
      samples += error.size() / ny;
    }
    return (squares / static_cast<double>(samples)).cwiseSqrt();
  }

  OutputErrorProblem& problem_;
  const OutputErrorOptions& options_;
  std::vector<StretchOf> whole_;
  Initial whole_initial_;
  Eigen::VectorXd deviation_;
  std::vector<OutputErrorStart> starts_;
  int iterations_ = 0;
};

// ---- scores -------------------------------------------------------------------------------------

class ScoreSum {
 public:
  explicit ScoreSum(Eigen::Index outputs)
      : error_square_(Eigen::VectorXd::Zero(outputs)),
        error_(error_square_),
        square_(error_square_),
        sum_(error_square_) {}

  void add(const Eigen::VectorXd& simulated, const Eigen::VectorXd& measured) {
    const Eigen::Index ny = sum_.size();
    for (Eigen::Index i = 0; i < measured.size(); ++i) {
      const double error = simulated(i) - measured(i);
      error_square_(i % ny) += error * error;
      error_(i % ny) += error;
      square_(i % ny) += measured(i) * measured(i);
      sum_(i % ny) += measured(i);
    }
    samples_ += static_cast<double>(measured.size() / ny);
  }
  void fail() { finite_ = false; }

  [[nodiscard]] OutputErrorScore score(std::string name, ExperimentRole role) const {
    OutputErrorScore result;
    result.name = std::move(name);
    result.role = role;
    result.finite = finite_ && samples_ > 0.0;
    if (!result.finite) return result;
    const Eigen::VectorXd variance = (square_ / samples_ - (sum_ / samples_).cwiseAbs2());
    result.rms = (error_square_ / samples_).cwiseSqrt();
    result.nrmse = 100.0 * result.rms.cwiseQuotient(variance.cwiseSqrt());
    const Eigen::VectorXd error_variance =
        error_square_ / samples_ - (error_ / samples_).cwiseAbs2();
    result.deviation = error_variance.cwiseMax(0.0).cwiseSqrt();
    result.variance_accounted_for =
        100.0 * (1.0 - error_variance.cwiseQuotient(variance).array()).matrix();
    return result;
  }

 private:
  Eigen::VectorXd error_square_, error_, square_, sum_;
  double samples_ = 0.0;
  bool finite_ = true;
};

// Validation recordings start from the state that their first samples show.
Initial validation_states(const OutputErrorProblem& problem, const Eigen::VectorXd& theta,
                          std::span<const StretchOf> stretches, const OutputErrorOptions& options) {
  Initial initial = initial_states(problem, stretches, options.initial_state);
  if (initial.empty() || options.initial_state != InitialState::kFree) return initial;
  std::vector<StretchOf> beginnings(stretches.begin(), stretches.end());
  for (StretchOf& stretch : beginnings) {
    stretch.stretch.count = std::min(stretch.stretch.count, options.initial_samples);
  }
  const StretchFit fit =
      fit_stretches(problem, beginnings, theta, initial, problem.output_scale(),
                    {.free_parameters = false, .iteration_limit = 30, .tolerance = 1e-10});
  return fit.status == StretchFit::Status::kDiverged ? initial : fit.initial;
}

// Whole recordings of a role, simulated; `each` gets the score of every one.
OutputErrorScore score_role(const OutputErrorProblem& problem, const OutputErrorOptions& options,
                            const Eigen::VectorXd& theta, ExperimentRole role,
                            const Initial* fitted, std::vector<OutputErrorScore>* each) {
  const Eigen::Index ny = problem.output_scale().size();
  const auto stretches = problem.whole_recordings(role);
  const Initial initial =
      fitted != nullptr ? *fitted : validation_states(problem, theta, stretches, options);
  std::vector<Simulated> runs;
  problem.simulate(theta, stretches, initial, false, runs);
  ScoreSum all(ny);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    ScoreSum one(ny);
    for (ScoreSum* sum : {&one, &all}) {
      if (runs[k].finite) {
        sum->add(runs[k].outputs.col(0), problem.measured(stretches[k]));
      } else {
        sum->fail();
      }
    }
    if (each == nullptr) continue;
    each->push_back(one.score(problem.data().recordings[stretches[k].recording].name, role));
  }
  return all.score("", role);
}

void score(const OutputErrorProblem& problem, const OutputErrorOptions& options,
           OutputErrorFit& fit) {
  using enum ExperimentRole;
  fit.estimation = score_role(problem, options, fit.theta, kEstimation, &fit.initial, &fit.scores);
  fit.validation = score_role(problem, options, fit.theta, kValidation, nullptr, &fit.scores);
  for (OutputErrorStart& start : fit.starts) {
    if (!start.origin.starts_with("equation")) continue;
    start.estimation = score_role(problem, options, start.theta, kEstimation, nullptr, nullptr);
    start.validation = score_role(problem, options, start.theta, kValidation, nullptr, nullptr);
  }
}

// ---- the result ---------------------------------------------------------------------------------

void check(const OutputErrorProblem& problem) {
  if (problem.free_parameters().empty()) {
    throw InputError(
        fmt::format("{}: no parameter is free: all are `fixed`", problem.model().name));
  }
  Eigen::Index numbers = 0;
  for (const StretchOf& stretch : problem.whole_recordings(ExperimentRole::kEstimation)) {
    numbers += stretch.stretch.count * problem.output_scale().size();
  }
  const auto unknowns =
      static_cast<Eigen::Index>(problem.free_parameters().size()) +
      problem.initial_size() *
          static_cast<Eigen::Index>(problem.whole_recordings(ExperimentRole::kEstimation).size());
  if (numbers <= unknowns) {
    throw InputError(fmt::format("the recordings have {} samples of outputs for {} unknowns",
                                 numbers, unknowns));
  }
  for (Eigen::Index j = 0; j < problem.output_scale().size(); ++j) {
    if (problem.output_scale()(j) > 0.0) continue;
    throw InputError(fmt::format("output '{}' does not change in any recording",
                                 problem.model().output_names[static_cast<std::size_t>(j)]));
  }
}

void add_uncertainty(const OutputErrorProblem& problem, const std::vector<StretchOf>& whole,
                     const OutputErrorOptions& options, OutputErrorFit& fit) {
  std::vector<Simulated> runs;
  problem.simulate(fit.theta, whole, fit.initial, true, runs);
  const bool initial_is_free = options.initial_state == InitialState::kFree;
  double square = 0.0;
  Eigen::Index numbers = 0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Eigen::VectorXd error = runs[k].outputs.col(0) - problem.measured(whole[k]);
    const Eigen::VectorXd weights =
        fit.noise.cwiseInverse().replicate(error.size() / fit.noise.size(), 1);
    square += weights.cwiseProduct(error).squaredNorm();
    numbers += error.size();
  }
  fit.chi_square = square;
  const Eigen::Index unknowns =
      fit.theta.size() +
      (initial_is_free ? problem.initial_size() * static_cast<Eigen::Index>(whole.size()) : 0);
  fit.degrees_of_freedom = static_cast<std::size_t>(numbers - unknowns);
  const double variance =
      fit.noise_is_known ? 1.0 : square / static_cast<double>(fit.degrees_of_freedom);
  OutputErrorCovariance covariance = output_error_covariance(problem, whole, runs, fit.theta,
                                                             fit.noise, initial_is_free, variance);
  fit.covariance = std::move(covariance.robust);
  fit.white_covariance = std::move(covariance.white);
  fit.identifiability = std::move(covariance.identifiability);
  fit.lag_one_correlation = covariance.lag_one_correlation;
}

OutputErrorStatus status_of(const StretchFit& fit) {
  switch (fit.status) {
    case StretchFit::Status::kConverged:
      return OutputErrorStatus::kConverged;
    case StretchFit::Status::kIterationLimit:
      return OutputErrorStatus::kIterationLimit;
    case StretchFit::Status::kInterrupted:
      return OutputErrorStatus::kInterrupted;
    case StretchFit::Status::kDiverged:
      break;
  }
  return OutputErrorStatus::kDiverged;
}

}  // namespace

std::string_view to_string(OutputErrorStatus status) {
  switch (status) {
    case OutputErrorStatus::kConverged:
      return "converged";
    case OutputErrorStatus::kIterationLimit:
      return "iteration_limit";
    case OutputErrorStatus::kUnidentifiable:
      return "unidentifiable";
    case OutputErrorStatus::kDiverged:
      return "diverged";
    case OutputErrorStatus::kStepLimit:
      return "step_limit";
    case OutputErrorStatus::kInterrupted:
      break;
  }
  return "interrupted";
}

Eigen::VectorXd OutputErrorFit::standard_errors() const {
  return covariance.diagonal().cwiseSqrt();
}

OutputErrorFit fit_output_error(OutputErrorProblem& problem, const OutputErrorOptions& options) {
  check(problem);
  Search search(problem, options);
  StretchFit best = search.run();
  OutputErrorFit fit;
  fit.free = problem.free_parameters();
  fit.starts = std::move(search.starts());
  fit.status = status_of(best);
  fit.theta = fit.status == OutputErrorStatus::kDiverged ? problem.start() : best.theta;
  while (fit.status == OutputErrorStatus::kConverged) {
    fit.step_error = problem.step_error(best.theta, search.whole(), best.initial);
    if (fit.step_error <= options.step_tolerance) break;
    if (2 * problem.steps_per_sample() > options.step_limit) {
      fit.status = OutputErrorStatus::kStepLimit;
      break;
    }
    problem.set_steps_per_sample(2 * problem.steps_per_sample());
    best = search.again(best);
    fit.status = status_of(best);
    fit.theta = best.theta;
  }
  fit.steps_per_sample = problem.steps_per_sample();
  fit.iterations = search.iterations();
  fit.model = problem.model_at(fit.theta);
  fit.noise = search.deviation();
  fit.noise_is_known = problem.data().noise.minCoeff() > 0.0;
  if (fit.status == OutputErrorStatus::kDiverged) {
    const auto p = fit.theta.size();
    fit.identifiability.covariance =
        Eigen::MatrixXd::Constant(p, p, std::numeric_limits<double>::quiet_NaN());
    return fit;
  }
  fit.initial = best.initial;
  add_uncertainty(problem, search.whole(), options, fit);
  if (fit.status == OutputErrorStatus::kConverged && fit.covariance.size() == 0) {
    fit.status = OutputErrorStatus::kUnidentifiable;
  }
  score(problem, options, fit);
  return fit;
}

}  // namespace graybox
