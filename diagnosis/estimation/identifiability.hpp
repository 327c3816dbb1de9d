// Which parameters do the data determine, and which combinations of parameters do they not see?
//
// H is the information of the data about theta, C = H^-1 its covariance (maximum_likelihood.hpp).
// All is judged relative to the parameters' sizes: with D = diag(scale), the eigenvalues of
//
//   P = D^-1 C D^-1,   P v = s^2 v,
//
// are squared relative standard errors: if theta_p changes by the share v_p (|v| = 1) along
// direction v, the data tell by how much to within the share s. 1/s are the singular values of the
// whitened Jacobian in relative parameters. A direction with s > 1 is *unseen*: the data do not
// even give its order of magnitude.
//
// Where H is singular. With S = diag(H)^-1/2, R = S H S has unit diagonal; eigenvalues of R below
// 1e-12 are zero but for rounding. Their eigenvectors u give unseen directions D^-1 S u with s =
// infinity; the rest of R is inverted on its range, which gives the covariance of every parameter
// that has no part in such a direction. (A parameter with H_pp = 0 is an unseen direction alone.)
//
// A parameter *has a standard error* if it has no part in a direction with s = infinity and its own
// relative standard error is at most 1. The others have none: rows and columns of `covariance` are
// NaN, and `unseen` says why.
//
//   const Identifiability seen = examine_identifiability(fit.information, fit.theta, names);
//   for (const UnseenCombination& each : seen.unseen) fmt::print("{}\n", each.words);
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace graybox {

struct UnseenCombination {
  // Relative changes of the parameters that change nothing in the data; the largest is 1.
  Eigen::VectorXd direction;
  double relative_standard_error = 0.0;  // s, may be infinite
  std::string words;                     // "a and b are seen only through their sum", for people
};

struct Identifiability {
  Eigen::VectorXd relative_standard_errors;  // s of all directions, decreasing
  Eigen::MatrixXd covariance;                // NaN where there is no standard error
  std::vector<UnseenCombination> unseen;
  std::vector<std::string> weak;  // parameters with a relative standard error above 20 %, in words

  [[nodiscard]] bool determined(Eigen::Index p) const;  // has a standard error
  // Correlation; NaN like the covariance.
  [[nodiscard]] Eigen::MatrixXd correlation() const;
};

// `values`: theta; zero entries are judged on the scale 1. Throws InputError for sizes that differ
// and numbers that are not finite. O(d^3).
[[nodiscard]] Identifiability examine_identifiability(const Eigen::MatrixXd& information,
                                                      const Eigen::VectorXd& values,
                                                      const std::vector<std::string>& names);

}  // namespace graybox
