// The parameters of a model and of laws that fit periodic recordings best, by Levenberg and
// Marquardt's method on the whitened residuals of steady_state.hpp.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"

namespace graybox {

struct PeriodicFitOptions {
  int iteration_limit = 60;
  double tolerance = 1e-5;  // share of chi-square that a step must gain
  int threads = 1;
  std::function<bool()> keep_going;
  // Estimation records that a fit comes near by; empty: telling_recordings() at the first start.
  std::vector<std::size_t> telling = {};
};

struct PeriodicFit {
  bool converged = false;
  std::string trouble;
  Eigen::VectorXd start;        // what it came from, of several
  Eigen::VectorXd parameters;   // of the model
  std::vector<ActingLaw> laws;  // with their estimates
  double chi_square = 0.0;
  Eigen::MatrixXd information;  // J^T J by parameters, then those of the laws
  double unsettled = 0.0;       // largest of all recordings (steady_state.hpp)
  int iterations = 0;
};

// Begins at that of `starts` (parameters of the model) whose chi-square is least.
[[nodiscard]] PeriodicFit fit_periodic(const PlantFamily& family, const PeriodicData& data,
                                       const std::vector<Eigen::VectorXd>& starts,
                                       const std::vector<ActingLaw>& laws,
                                       const PeriodicFitOptions& options);

// Far from the optimum resonances make chi-square rugged, and it has minima where two of them are swapped.
// Data whose noise is raised to a share of the outputs' level are smooth, for everywhere the model is
// allowed to be wrong by that share: from each start the fit goes on from 0.3 of the level to 0.03 and 0.003, on
// the recordings that tell most (telling_recordings.hpp), until one comes near the data; from the best of them
// it ends with all recordings and the noise as it is.
[[nodiscard]] PeriodicFit fit_periodic_gradually(const PlantFamily& family,
                                                 const PeriodicData& data,
                                                 const std::vector<Eigen::VectorXd>& starts,
                                                 const std::vector<ActingLaw>& laws,
                                                 const PeriodicFitOptions& options);

// The same where a start comes near; else it has not converged. A start that ends far off the data at one of
// those shares is given up there.
[[nodiscard]] PeriodicFit fit_periodic_if_near(const PlantFamily& family, const PeriodicData& data,
                                               const std::vector<Eigen::VectorXd>& starts,
                                               const std::vector<ActingLaw>& laws,
                                               const PeriodicFitOptions& options);

// Standard errors: roots of the diagonal of the information's inverse; NaN for parameters that are
// part of a combination the data do not see.
[[nodiscard]] Eigen::VectorXd standard_errors(const Eigen::MatrixXd& information);

}  // namespace graybox
