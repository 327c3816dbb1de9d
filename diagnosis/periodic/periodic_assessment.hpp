// How a model does on periodic recordings, those of its fit and others.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Chi-square and errors over some recordings, `parameters` of which were fitted to them.
[[nodiscard]] Assessment assess_records(const PlantFamily& family, const PeriodicData& data,
                                        const ModelState& model,
                                        const std::vector<MeasuredRecord>& records,
                                        std::size_t parameters, int threads);

// What the fit makes of recordings kept out, the errors of its parameters counted as noise.
// `values`: of all parameters, the model's, then the laws'.
// With C the parameters' covariance, residuals r with derivatives J have the covariance 1 + J C
// J^T:
//   chi^2 = r^T r - b^T (C^-1 + J^T J)^-1 b,   b = J^T r,
//   log det(1 + J C J^T) = log det(C^-1 + J^T J) - log det C^-1.
// Cost: a steady state and its derivatives for each record.
[[nodiscard]] HeldOutPrediction predict_held_out(const PlantFamily& family,
                                                 const PeriodicData& data, const ModelState& model,
                                                 const Eigen::VectorXd& values, int threads);

// Information^+ scores, parameters scaled alike.
[[nodiscard]] Eigen::MatrixXd solve_information(const Eigen::MatrixXd& information,
                                                const Eigen::MatrixXd& scores);

// log det(1 + D S D), D the parameters' values: of information and a prior as wide as these, over
// the prior's.
[[nodiscard]] double log_determinant_with_prior(const Eigen::MatrixXd& information,
                                                const Eigen::VectorXd& values);

}  // namespace graybox
