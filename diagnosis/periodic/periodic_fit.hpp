// The parameters of a model and of laws that fit periodic recordings best, by Levenberg and
// Marquardt's method on the whitened residuals of steady_state.hpp.
//
// Valleys of chi-square between parameters that do nearly the same are narrow and bend: a step
// along one ends beside it, and is not better. Where the next step from there promises to lead down
// further than this one came up, both count as one. Where steps are no longer worth taking but
// would be with less damping, it is lifted first.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {

struct PeriodicFitOptions {
  int iteration_limit = 60;
  double tolerance = 1e-5;  // share of chi-square that a step must gain
  int threads = 1;
  std::function<bool()> keep_going;
  // A chi-square that is known: a fit that creeps so that it would not get below that within the
  // limit, each step as good as the best of its last five, is given up. It has not converged then.
  double to_beat = std::numeric_limits<double>::infinity();
  // Estimation records that a fit comes near by; empty: telling_recordings() at the first start.
  std::vector<std::size_t> telling = {};
  // Where any force (or signal) may act, another at each line: residuals count only beside what it
  // does.
  const Location* freed = nullptr;
};

struct PeriodicFit {
  bool converged = false;
  std::string trouble;
  Eigen::VectorXd start;        // what it came from, of several
  Eigen::VectorXd parameters;   // of the model
  std::vector<ActingLaw> laws;  // with their estimates
  double chi_square = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd information;       // J^T J by parameters, then those of the laws
  Eigen::MatrixXd record_gradients;  // J^T r of each record (rows), likewise
  bool has_steady_state =
      false;  // under the laws (rms over the recordings); a fit without one has not converged
  int iterations = 0;
  // The model's parameters that a force at the freed place imitates (springs and dampers beside
  // it). They stay as they were. Empty if no place is freed.
  std::vector<bool> imitated{};
};

// Of the numbers in recordings those that a freed force leaves: it takes one output's of each line.
[[nodiscard]] double share_beside_freed(const PeriodicData& data);

// Begins at that of `starts` (parameters of the model) whose chi-square is least.
[[nodiscard]] PeriodicFit fit_periodic(const PlantFamily& family, const PeriodicData& data,
                                       const std::vector<Eigen::VectorXd>& starts,
                                       const std::vector<ActingLaw>& laws,
                                       const PeriodicFitOptions& options);

// Parameters of the model, then of each law.
[[nodiscard]] Eigen::VectorXd values_of(const PeriodicFit& fit);

// Standard errors: roots of the diagonal of the information's inverse; NaN for parameters that are
// part of a combination the data do not see.
[[nodiscard]] Eigen::VectorXd standard_errors(const Eigen::MatrixXd& information);
// Those of a fit, at least as wide as the spread between its records (recording_spread.hpp).
[[nodiscard]] Eigen::VectorXd standard_errors(const PeriodicFit& fit);

}  // namespace graybox
