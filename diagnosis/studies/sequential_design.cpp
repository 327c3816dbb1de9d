#include "diagnosis/studies/sequential_design.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "diagnosis/response_fits/response_model.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/quantile.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exact/exchange.hpp"
#include "solvers/exact_bounds/relaxation.hpp"

namespace graybox {
namespace {

constexpr double kDesignGap = 1e-6;  // far below what rounding to a few experiments costs
constexpr double kTruthGap = 1e-8;   // of the optimum that efficiencies are measured against
constexpr double kRejection = 4.0;   // lack of fit from which a fit counts as rejected

using Counts = std::vector<std::int64_t>;
using AfterStage = std::function<void()>;  // called from several threads

std::int64_t total(std::span<const std::int64_t> counts) {
  return std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
}

// sum_i counts_i H_i, packed.
std::vector<double> information(const InformationSet& set, std::span<const std::int64_t> counts) {
  std::vector<double> matrix(set.packed_size(), 0.0);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const auto row = set.information(i);
    for (std::size_t k = 0; k < matrix.size(); ++k) {
      matrix[k] += static_cast<double>(counts[i]) * row[k];
    }
  }
  return matrix;
}

// H'_i = (M_past + n H_i) / (N + n).
InformationSet shifted(const InformationSet& set, std::span<const std::int64_t> past,
                       std::int64_t experiments) {
  const std::vector<double> made = information(set, past);
  const auto n = static_cast<double>(experiments);
  const double scale = 1.0 / (static_cast<double>(total(past)) + n);
  const std::size_t p = set.packed_size();
  AlignedArray rows(set.candidate_count() * p);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto row = set.information(i);
    for (std::size_t k = 0; k < p; ++k) rows[i * p + k] = scale * (made[k] + n * row[k]);
  }
  return InformationSet(set.dimension(), std::move(rows));
}

class Study {
 public:
  Study(const RobotModel& robot, const PositionTable& positions, const SequentialOptions& options)
      : robot_(robot),
        positions_(positions),
        options_(options),
        model_(robot),
        truth_(robot_information_set(robot, positions, {.threads = options.threads})) {
    truth_.validate();
    const Solution best =
        ColumnGeneration().solve(truth_, {.duality_gap = kTruthGap, .threads = options.threads});
    std::vector<double> matrix(truth_.packed_size(), 0.0);
    for (std::size_t i = 0; i < best.design.weights.size(); ++i) {
      const double weight = best.design.weights[i];
      for (std::size_t k = 0; weight > 0.0 && k < matrix.size(); ++k) {
        matrix[k] += weight * truth_.information(i)[k];
      }
    }
    best_log_det_ = InverseCholesky(truth_.dimension()).log_det_of(matrix);
  }

  [[nodiscard]] std::vector<StageRecord> repetition(int number, const AfterStage& after) const;

 private:
  struct State {
    Counts counts;
    std::map<std::size_t, ResponseMeasurement> measurements;  // by candidate
    Eigen::VectorXd theta;
  };

  [[nodiscard]] Eigen::VectorXd wrong_start(int number) const;
  [[nodiscard]] std::uint64_t seed_of(int repetition, int stage, bool random_positions) const;
  [[nodiscard]] std::vector<StageRecord> run(DesignStrategy strategy, int number,
                                             const Eigen::VectorXd& start,
                                             const InformationSet& start_set,
                                             const AfterStage& after) const;
  [[nodiscard]] Counts choose(DesignStrategy strategy, const State& state,
                              const InformationSet& set, Random& random) const;
  void measure(const Counts& chosen, Random& random, State& state) const;
  [[nodiscard]] FitResult fit(const State& state, const Eigen::VectorXd& start, int stage) const;
  [[nodiscard]] std::optional<InformationSet> redesign_set(const Eigen::VectorXd& theta) const;
  void judge(const State& state, StageRecord& record) const;
  [[nodiscard]] Eigen::VectorXd position(std::size_t candidate) const;

  const RobotModel& robot_;
  const PositionTable& positions_;
  const SequentialOptions& options_;
  RobotResponseModel model_;
  InformationSet truth_;
  double best_log_det_ = 0.0;
};

Eigen::VectorXd Study::position(std::size_t candidate) const {
  const auto degrees = positions_.position(candidate);
  const Eigen::Map<const Eigen::VectorXd> row(degrees.data(),
                                              static_cast<Eigen::Index>(degrees.size()));
  return row * (std::numbers::pi / 180.0);
}

// Noise depends on repetition and stage alone, so that all strategies share it as far as they
// choose the same positions.
std::uint64_t Study::seed_of(int repetition, int stage, bool random_positions) const {
  Random mix(options_.seed);
  std::uint64_t seed = mix.next() ^ (static_cast<std::uint64_t>(repetition) << 32U);
  seed ^= static_cast<std::uint64_t>(stage) << 1U;
  return seed ^ static_cast<std::uint64_t>(random_positions);
}

Eigen::VectorXd Study::wrong_start(int number) const {
  Random random(seed_of(number, 0, false));
  Eigen::VectorXd theta(static_cast<Eigen::Index>(truth_.dimension()));
  for (double& value : theta) {
    value = random.uniform() < 0.5 ? 1.0 - options_.start_error : 1.0 + options_.start_error;
  }
  return theta;
}

std::vector<StageRecord> Study::repetition(int number, const AfterStage& after) const {
  const Eigen::VectorXd start = wrong_start(number);
  const InformationSet start_set =
      robot_information_set(with_stiffness_factors(robot_, start), positions_);
  std::vector<StageRecord> records;
  for (const DesignStrategy strategy : kDesignStrategies) {
    const std::vector<StageRecord> stages = run(strategy, number, start, start_set, after);
    records.insert(records.end(), stages.begin(), stages.end());
  }
  return records;
}

std::vector<StageRecord> Study::run(DesignStrategy strategy, int number,
                                    const Eigen::VectorXd& start, const InformationSet& start_set,
                                    const AfterStage& after) const {
  State state{Counts(positions_.count(), 0), {}, start};
  std::vector<StageRecord> records;
  StageRecord record;
  record.repetition = number;
  record.strategy = strategy;
  judge(state, record);
  records.push_back(record);
  std::optional<InformationSet> estimated;  // information at the present estimate
  for (int stage = 1; stage <= options_.stages; ++stage) {
    const bool random_positions = strategy == DesignStrategy::kRandom;
    Random random(seed_of(number, stage, random_positions));
    const InformationSet& set = strategy == DesignStrategy::kOracle ? truth_
                                : estimated.has_value()             ? *estimated
                                                                    : start_set;
    measure(choose(strategy, state, set, random), random, state);
    const FitResult result = fit(state, start, stage);
    record.stage = stage;
    record.fit_status = result.status;
    record.lack_of_fit = result.lack_of_fit();
    if (result.status != FitStatus::kFailed) state.theta = result.theta;
    judge(state, record);
    records.push_back(record);
    after();
    if (strategy == DesignStrategy::kSequential && stage < options_.stages) {
      if (auto next = redesign_set(state.theta)) estimated.emplace(std::move(*next));
    }
  }
  return records;
}

Counts Study::choose(DesignStrategy strategy, const State& state, const InformationSet& set,
                     Random& random) const {
  if (strategy != DesignStrategy::kRandom) {
    return next_experiments(set, state.counts, options_.experiments_per_stage);
  }
  Counts counts(positions_.count(), 0);
  for (std::int64_t k = 0; k < options_.experiments_per_stage; ++k) {
    ++counts[random.below(counts.size())];
  }
  return counts;
}

void Study::measure(const Counts& chosen, Random& random, State& state) const {
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i] == 0) continue;
    stop_if_requested();
    state.counts[i] += chosen[i];
    ResponseMeasurement data =
        simulate_measurement(robot_, position(i), static_cast<double>(chosen[i]), random);
    const auto before = state.measurements.find(i);
    if (before == state.measurements.end()) {
      state.measurements.emplace(i, std::move(data));
    } else {
      merge(before->second, data);
    }
  }
}

// From the last estimate; where that is rejected, from the start again by way of the closed-loop
// stage.
FitResult Study::fit(const State& state, const Eigen::VectorXd& start, int stage) const {
  std::vector<ResponseMeasurement> data;
  data.reserve(state.measurements.size());
  for (const auto& [candidate, measurement] : state.measurements) data.push_back(measurement);
  FitOptions fit_options = options_.fit;
  fit_options.threads = 1;
  fit_options.seed = options_.seed;
  stop_if_requested();
  if (stage > 1) {
    fit_options.closed_loop_stage = false;
    FitResult near = fit_maximum_likelihood(model_, data, state.theta, fit_options);
    if (near.status == FitStatus::kConverged && near.lack_of_fit() < kRejection) return near;
  }
  fit_options.closed_loop_stage = true;
  return fit_maximum_likelihood(model_, data, start, fit_options);
}

// Nothing for an estimate so wrong that the arm has no equilibrium, or the matrices no information.
std::optional<InformationSet> Study::redesign_set(const Eigen::VectorXd& theta) const {
  try {
    InformationSet set = robot_information_set(with_stiffness_factors(robot_, theta), positions_);
    set.validate();
    return set;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void Study::judge(const State& state, StageRecord& record) const {
  record.theta = state.theta;
  const Eigen::ArrayXd error = state.theta.array() - 1.0;
  record.parameter_error = std::sqrt(error.square().mean());
  record.largest_error = error.abs().maxCoeff();
  record.experiments = total(state.counts);
  record.positions = state.measurements.size();
  if (record.experiments == 0) return;
  const std::size_t d = truth_.dimension();
  std::vector<double> matrix = information(truth_, state.counts);
  Eigen::MatrixXd full(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(d));
  unpack(matrix.data(), d, full.data());
  record.expected_error = std::sqrt(full.inverse().trace() / static_cast<double>(d));
  for (double& entry : matrix) entry /= static_cast<double>(record.experiments);
  const double log_det = InverseCholesky(d).log_det_of(matrix);
  record.design_efficiency = std::exp((log_det - best_log_det_) / static_cast<double>(d));
}

void check(const SequentialOptions& options) {
  if (options.stages < 1 || options.experiments_per_stage < 1 || options.repetitions < 1 ||
      options.threads < 1) {
    throw InputError(
        "sequential design: stages, experiments, repetitions and threads must be at least 1");
  }
  if (!(options.start_error >= 0.0) || !(options.start_error < 1.0)) {
    throw InputError(fmt::format("sequential design: start error {} must be at least 0 and below 1",
                                 options.start_error));
  }
}

StageSummary::Spread spread(std::vector<double> values) {
  std::ranges::sort(values);
  const auto n = static_cast<double>(values.size());
  StageSummary::Spread result;
  result.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  for (const double value : values) {
    result.standard_deviation += (value - result.mean) * (value - result.mean);
  }
  result.standard_deviation =
      values.size() > 1 ? std::sqrt(result.standard_deviation / (n - 1.0)) : 0.0;
  result.lower_quartile = quantile(values, 0.25);
  result.median = quantile(values, 0.5);
  result.upper_quartile = quantile(values, 0.75);
  return result;
}

}  // namespace

std::string_view to_string(DesignStrategy strategy) {
  switch (strategy) {
    case DesignStrategy::kSequential:
      return "sequential";
    case DesignStrategy::kFixed:
      return "fixed";
    case DesignStrategy::kOracle:
      return "oracle";
    case DesignStrategy::kRandom:
      return "random";
  }
  return "unknown";
}

std::vector<std::int64_t> next_experiments(const InformationSet& set,
                                           std::span<const std::int64_t> past,
                                           std::int64_t experiments) {
  if (experiments < 1) throw InputError("next experiments: at least one is needed");
  if (!past.empty() && past.size() != set.candidate_count()) {
    throw InputError(fmt::format("next experiments: {} past counts for {} candidates", past.size(),
                                 set.candidate_count()));
  }
  const InformationSet problem = shifted(set, past, experiments);
  const Relaxation relaxation = solve_relaxation(problem, {.duality_gap = kDesignGap});
  ExchangeResult best = search_by_exchange(problem, relaxation, {.experiments = experiments});
  return std::move(best.counts);
}

void run_sequential_study(const RobotModel& robot, const PositionTable& positions,
                          const SequentialOptions& options,
                          const std::function<bool(const std::vector<StageRecord>&)>& on_repetition,
                          const std::function<void(std::size_t, std::size_t)>& on_stage) {
  check(options);
  const Study study(robot, positions, options);
  const std::size_t total = std::size(kDesignStrategies) *
                            static_cast<std::size_t>(options.stages) *
                            static_cast<std::size_t>(options.repetitions);
  std::size_t done = 0;
  const AfterStage after = [&] {
    if (!on_stage) return;
#pragma omp critical(graybox_sequential_stage)
    on_stage(++done, total);
  };
  if (on_stage) on_stage(0, total);
  std::atomic<bool> stopped = false;
  std::exception_ptr failure;
#pragma omp parallel for num_threads(options.threads) schedule(dynamic, 1)
  for (int number = 0; number < options.repetitions; ++number) {
    if (stopped) continue;
    try {
      const std::vector<StageRecord> records = study.repetition(number, after);
#pragma omp critical(graybox_sequential_design)
      if (!stopped && !on_repetition(records)) stopped = true;
    } catch (const Stopped&) {  // in the middle of this repetition; the finished ones stand
      stopped = true;
    } catch (...) {
#pragma omp critical(graybox_sequential_design)
      failure = std::current_exception();
      stopped = true;
    }
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

std::vector<StageSummary> summarise(std::span<const StageRecord> records) {
  std::map<std::pair<DesignStrategy, int>, std::vector<const StageRecord*>> groups;
  for (const StageRecord& record : records) {
    groups[{record.strategy, record.stage}].push_back(&record);
  }
  std::vector<StageSummary> summaries;
  for (const auto& [key, group] : groups) {
    StageSummary summary;
    summary.strategy = key.first;
    summary.stage = key.second;
    summary.experiments = group.front()->experiments;
    summary.repetitions = group.size();
    const auto spread_of = [&](double StageRecord::*field) {
      std::vector<double> values;
      for (const StageRecord* record : group) values.push_back(record->*field);
      return spread(std::move(values));
    };
    summary.parameter_error = spread_of(&StageRecord::parameter_error);
    summary.expected_error = spread_of(&StageRecord::expected_error);
    summary.design_efficiency = spread_of(&StageRecord::design_efficiency);
    summary.rejected_fits =
        static_cast<std::size_t>(std::ranges::count_if(group, [](const StageRecord* record) {
          return record->fit_status != FitStatus::kConverged || record->lack_of_fit >= kRejection;
        }));
    summaries.push_back(summary);
  }
  return summaries;
}

}  // namespace graybox
