// The stationary Kalman gain of a predictor (predictor.hpp), its model taken linear: white force noise
// of intensity q at every free mass, white sensor noise.
//
//   P = A (P - P C' (C P C' + R)^-1 C P) A' + Q,     K = P C' (C P C' + R)^-1,
//
// by structured doubling (Chu, Fan, Lin and Wang, International Journal of Control 77, 2004): quadratic
// convergence, a few products of small matrices. Friction and all other laws that are not linear are
// left out; lags and delays of sensors are in.
#pragma once

#include <Eigen/Core>

#include "graybox/diagnosis/prediction_error/predictor.hpp"

namespace graybox {

// P of A, C, Q and R (all positive semidefinite, R positive definite and diagonal: its variances).
// Directions that are neither seen nor die away are held bounded by scaling A by 1 - 1e-6.
[[nodiscard]] Eigen::MatrixXd stationary_covariance(const Eigen::MatrixXd& a,
                                                    const Eigen::MatrixXd& c,
                                                    const Eigen::MatrixXd& q,
                                                    const Eigen::VectorXd& r);

// `intensity`: N s^0.5 (or N m s^0.5), `noise`: standard deviations of the outputs, above zero. States
// x outputs; zero where no gain is found.
[[nodiscard]] Eigen::MatrixXd stationary_gain(Predictor& predictor, const LumpedModel& model,
                                              double sample_time, double intensity,
                                              const Eigen::VectorXd& noise);

}  // namespace graybox
