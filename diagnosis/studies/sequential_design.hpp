// Sequential design: measure, estimate, design the next experiments with the estimate.
//
// The information matrices H_i(theta) depend on the parameters that are to be found, so a design
// can only be optimal for a guess. In stages of n experiments each,
//
//   1. design  the next n experiments for the present theta_hat: with M_past = sum_i c_i
//              H_i(theta_hat) of the c experiments so far, maximise log det(M_past + sum_i m_i
//              H_i(theta_hat)) over counts m with sum n, by exchange (solvers/exact/exchange.hpp);
//   2. measure in those positions (here: simulate the real robot, response_measurement.hpp);
//   3. fit     theta_hat to all measurements so far (maximum_likelihood.hpp).
//
// The design of step 1 is an ordinary exact design (formula (8)) of the shifted matrices
// H'_i = (M_past + n H_i) / (N + n), N = sum c, because the counts sum to n: sum_i m_i H'_i =
// n (M_past + sum_i m_i H_i) / (N + n). What the first stages missed because their theta_hat was
// wrong, later stages make up for.
//
// Four ways to choose the positions, equal in all else, show what it is worth:
//   sequential  as above, the start theta being wrong
//   fixed       as above, but designed for the wrong start throughout
//   oracle      as above, but designed for the truth throughout
//   random      n positions drawn from the candidates
//
// Judgement of a stage (all information at the truth, on all experiments so far):
//   design_efficiency  (det M / det M*)^(1/d), M = sum_i (c_i/N) H_i, M* the relaxed optimum
//   parameter_error    root mean square over p of theta_hat_p / theta_p - 1
//   expected_error     the same of the Cramer-Rao bound, (tr diag(theta)^-1 H^-1 diag(theta)^-1 /
//                      d)^(1/2)
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "diagnosis/response_fits/maximum_likelihood.hpp"
#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox {

enum class DesignStrategy : std::int8_t { kSequential, kFixed, kOracle, kRandom };
inline constexpr DesignStrategy kDesignStrategies[] = {
    DesignStrategy::kSequential, DesignStrategy::kFixed, DesignStrategy::kOracle,
    DesignStrategy::kRandom};
[[nodiscard]] std::string_view to_string(DesignStrategy strategy);

// Counts of the next `experiments`, one a candidate, for information matrices H_i and the counts of
// the experiments made before (empty: none). Throws InputError where past and new experiments
// together can't make a regular information matrix.
[[nodiscard]] std::vector<std::int64_t> next_experiments(const InformationSet& set,
                                                         std::span<const std::int64_t> past,
                                                         std::int64_t experiments);

struct SequentialOptions {
  int stages = 6;
  std::int64_t experiments_per_stage = 10;
  int repetitions = 50;
  // Every parameter of the start is off by exactly this, up or down with equal probability:
  // theta = 1 +- start_error. At least 0, below 1.
  double start_error = 0.4;
  std::uint64_t seed = 1;  // repetition r of equal seeds has the same start and noise in every run
  int threads = 1;         // repetitions are shared out; results do not depend on it
  // Of every fit; seed, threads and closed_loop_stage are chosen by the study.
  FitOptions fit = {.tolerance = 0.03};
};

struct StageRecord {
  int repetition = 0;
  DesignStrategy strategy = DesignStrategy::kSequential;
  int stage = 0;                 // 1 is the first; 0 is the start, before any experiment
  std::int64_t experiments = 0;  // so far; likewise all below
  std::size_t positions = 0;     // different ones
  double parameter_error = 0.0;
  double largest_error = 0.0;  // max_p |theta_hat_p / theta_p - 1|
  double expected_error = 0.0;
  double design_efficiency = 0.0;
  FitStatus fit_status = FitStatus::kConverged;
  double lack_of_fit = 0.0;
  Eigen::VectorXd theta;  // theta_hat over the truth
};

// Runs the repetitions with `robot` as the truth. The callback on_repetition gets the records of
// one repetition (strategies in order, each with its stages 0, 1, ...) as it is finished, one at a
// time and in any order. Returning false stops the study, and repetitions that are not finished are
// dropped. Throws InputError for options out of range and positions that do not fit the robot.
//
// `on_stage` hears how many of all stages are finished, in all repetitions and strategies. That is
// 0 once the truth's information set is there, then one more after each; one call at a time.
//
// Cost: a repetition computes stages + 1 information sets (60 us a position) and 4 stages fits.
void run_sequential_study(
    const RobotModel& robot, const PositionTable& positions, const SequentialOptions& options,
    const std::function<bool(const std::vector<StageRecord>&)>& on_repetition,
    const std::function<void(std::size_t done, std::size_t total)>& on_stage = {});

// Mean, spread and quartiles of one strategy and stage over the repetitions.
struct StageSummary {
  DesignStrategy strategy = DesignStrategy::kSequential;
  int stage = 0;
  std::int64_t experiments = 0;
  std::size_t repetitions = 0;
  std::size_t rejected_fits = 0;  // not converged, or lack of fit above 4 standard deviations
  struct Spread {
    double mean = 0.0, standard_deviation = 0.0, lower_quartile = 0.0, median = 0.0,
           upper_quartile = 0.0;
  };
  Spread parameter_error, expected_error, design_efficiency;
};
// Ordered by strategy and stage.
[[nodiscard]] std::vector<StageSummary> summarise(std::span<const StageRecord> records);

}  // namespace graybox
