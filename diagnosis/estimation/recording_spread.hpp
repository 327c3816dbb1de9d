// Standard errors that allow for what differs between recordings: temperature, load, wear, the
// machine's mood.
//
// An estimate x is the sum of what the samples add to its error. Summed by recording, u_g = C sum
// over t in g of J_t^T r_t, the recordings are independent where samples are not, whatever happens
// within one:
//
//   V = f^2 G/(G - 1) sum over g of u_g u_g^T,        f = t_0.975(G - 1) / 1.96
//
// (Liang and Zeger, Biometrika 73, 1986; the correction and Student's factor for few recordings:
// Cameron and Miller, J. Human Resources 50, 2015, section VI). f makes +-1.96 errors a 95 %
// interval although G is small. From three recordings on the larger of V and of the covariance
// within recordings is taken, parameter by parameter; correlations are those within. With fewer
// there is nothing to tell the spread by.
#pragma once

#include <Eigen/Core>

namespace graybox {

inline constexpr Eigen::Index kFewestRecordings = 3;

// Square roots of the diagonal of V; zeros for fewer recordings. `influences`: u_g, a row each
// recording.
[[nodiscard]] Eigen::VectorXd deviations_between(const Eigen::MatrixXd& influences);

// The covariance with deviations that are at least these.
[[nodiscard]] Eigen::MatrixXd widened(const Eigen::MatrixXd& covariance,
                                      const Eigen::VectorXd& deviations);

}  // namespace graybox
