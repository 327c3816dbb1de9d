// ResponseMeasurement: an estimated frequency response at one position, with its uncertainty: what
// formula (2) of the paper (Assumption 1) calls a measurement,
//
//   G_hat(w) = G(w; theta) + eta(w),
//
// eta zero-mean, circular complex normal, independent between frequencies and experiments.
//
// Uncertainty. The covariance of vec(eta) (columns stacked) has the Kronecker form that every
// estimate G_hat = Y U^-1 has,
//
//   Lambda = [(U U^H)^-1]^T (x) Phi_v,
//
// of which formula (12) is the case (U U^H)^-1 = (n_y / Phi_r) (G + F^-1)^H (G + F^-1). It is kept
// as two small matrices, `left` = Phi_v^(-1/2) and `right` = U, so that
//
//   left * eta * right    has independent entries z with E |z|^2 = 1, and
//   vec(E)^H Lambda^-1 vec(E) = |left E right|_F^2
//
// (vec(A X B) = (B^T (x) A) vec X): no n_y n_u x n_y n_u matrix is ever factored.
//
//   Random random(1);
//   const ResponseMeasurement data = simulate_measurement(robot, position, 3.0, random);
#pragma once

#include <Eigen/Core>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// The covariance of an estimated response at one frequency, by its whitening factors.
struct ResponseNoise {
  Eigen::MatrixXcd left;   // n_y x n_y
  Eigen::MatrixXcd right;  // n_u x n_u
  // Complex degrees of freedom q of an estimated Phi_v, with left^H left scaled to E = Phi_v^-1; 0:
  // Phi_v is known.
  double degrees_of_freedom = 0.0;

  [[nodiscard]] Eigen::MatrixXcd covariance() const;  // Lambda, n_y n_u x n_y n_u
};

// The noise that formula (12) predicts where the response is `response`: left = (C_v w^2)^(-1/2) I,
// right = (Phi_r / n_y)^(1/2) (G + F^-1)^-1.
[[nodiscard]] ResponseNoise closed_loop_noise(const RobotModel& robot, double w,
                                              const Eigen::MatrixXcd& response);

struct ResponseMeasurement {
  Eigen::VectorXd position;                 // commanded joint angles, rad
  double experiments = 1.0;                 // `responses` are the mean of so many: Lambda over it
  std::vector<double> frequencies;          // rad/s
  std::vector<Eigen::MatrixXcd> responses;  // G_hat at each, n_y x n_u
  // Of one experiment, at each frequency. Empty: to be predicted by the model that is fitted.
  std::vector<ResponseNoise> noise;

  [[nodiscard]] std::size_t channel_count() const;  // sum over the frequencies of n_y n_u
};

// The mean of `experiments` measurements of this robot at its own parameters and frequencies, with
// the noise (12) and its factors, which an experiment knows from the inputs U that it measured.
// (The mean is all that the likelihood (7) uses of experiments at one position.) Throws InputError
// for a position that the robot can't take and for less than one experiment.
[[nodiscard]] ResponseMeasurement simulate_measurement(const RobotModel& robot,
                                                       const Eigen::VectorXd& position,
                                                       double experiments, Random& random);

// Adds `more`, made in the same position with the same noise, to `measurement`: the mean of both.
// Throws InputError where position or frequencies differ.
void merge(ResponseMeasurement& measurement, const ResponseMeasurement& more);

}  // namespace graybox
