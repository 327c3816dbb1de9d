// The stationary Kalman gain of a predictor (predictor.hpp), its model taken linear: white force
// noise of intensity q at every free mass, the predictor's disturbance, white sensor noise.
//
//   P = A (P - P C' (C P C' + R)^-1 C P) A' + Q,     K = P C' (C P C' + R)^-1,
//
// by structured doubling (Chu, Fan, Lin and Wang, International Journal of Control 77, 2004):
// quadratic convergence, a few products of small matrices. Friction and all other laws that are not
// linear are left out; lags and delays of sensors are in.
#pragma once

#include <Eigen/Core>

#include "diagnosis/predictor/predictor.hpp"

namespace graybox {

// P of A, C, Q and R (all positive semidefinite, R positive definite and diagonal: its variances).
// Directions that are neither seen nor die away are held bounded by scaling A by 1 - 1e-6.
[[nodiscard]] Eigen::MatrixXd stationary_covariance(const Eigen::MatrixXd& a,
                                                    const Eigen::MatrixXd& c,
                                                    const Eigen::MatrixXd& q,
                                                    const Eigen::VectorXd& r);

// `intensity`: N s^0.5 (or N m s^0.5), `noise`: standard deviations of the outputs, above zero.
// States x outputs; zero where no gain is found.
[[nodiscard]] Eigen::MatrixXd stationary_gain(Predictor& predictor, const LumpedModel& model,
                                              double sample_time, double intensity,
                                              const Eigen::VectorXd& noise);

// A model taken linear, a sample: x_(k+1) = A x_k + B d_k, y_k = C x_k, d the force on a
// coordinate.
struct LinearPredictor {
  Eigen::MatrixXd a, c;
  Eigen::VectorXd b;  // zero without a coordinate
};
[[nodiscard]] LinearPredictor linear_predictor(Predictor& predictor, Eigen::Index pushed = -1);

// What sensor noise, and a disturbance, do to predictions: rms of each output's error over the
// samples 1 ... h after the last one seen, for an estimate that has seen samples with this gain for
// long. With x the error before a correction and d the disturbance,
//
//   x_(k+1) = A ((I - K C) x_k - K v_k) + B d_k,     var_i = C A^i S A'^i C' + R without d.
//
// An error near that has nothing left to explain. `horizon` 0: in free run, of a plant that forgets
// (without a disturbance, the noise itself).
[[nodiscard]] Eigen::VectorXd error_by_noise(Predictor& predictor, const Eigen::MatrixXd& gain,
                                             const Eigen::VectorXd& noise, Eigen::Index horizon,
                                             double sample_time,
                                             const DisturbanceForce& disturbance = {});

}  // namespace graybox
