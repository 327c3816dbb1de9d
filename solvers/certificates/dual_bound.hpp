// Bounds of information functions that hold for any matrix Z, and so in any arithmetic: what the
// checker makes of phi_p, of G over a region and of each part of a compound criterion.
//
// Let Phi be an information function (certificate.hpp). For each Z there is a polar value
// Phi'(Z Z^T) with
//
//   Phi(N) Phi'(Z Z^T) <= tr(Z Z^T N)     for every N >= 0                                    (b)
//
// (Pukelsheim 1993, chapter 3). With s = Phi(M) Phi'(Z Z^T) every design N obeys
//
//   Phi(N) / Phi(M) <= max_i tr(Z Z^T H_i) / s.
//
// The best Z makes Z Z^T a multiple of the gradient G; any other one loosens the bound and does not
// break it. Only s has to be known from below. With X the computed inverse factor
// (extended_information.hpp), ||X M X^T - I|| <= delta, M^-1 = X^T T X, ||T - I|| <= eta:
//
//   D      Z = X^T. tr >= d (det det)^(1/d): s = d det(X M X^T)^(1/d), within 1 -+ delta of d.
//   Ds     Z the last s rows of X, transposed, nuisance first. With Z_s its rows of interest,
//          Z^T N Z >= Z_s^T S(N) Z_s as the Schur complement is the least quadratic form; the rest
//          as for D.
//   trace  tr(K^T N^-1 K) tr(Z^T N Z) >= tr(K^T Z)^2 by Cauchy and Schwarz, so that
//          s = tr(K^T Z)^2 / tr(K^T M^-1 K), at Z = X^T X K.
//   phi_p  tr(A N) >= d (tr(N^-p)/d)^(-1/p) (tr(A^q)/d)^(1/q), q = p/(p + 1): Hoelder's inequality
//          (Pukelsheim 1993, section 6.12). Z = V diag(sigma)^((p+1)/2) from the singular values
//          sigma^(1/2) of X. Relative errors of the eigenvalues of M^-1 and Z Z^T carry over to
//          Phi and Phi' with a factor of one, whatever p.
//   E      tr(Z^T N Z) >= lambda_min(N) tr(Z Z^T): s = lambda_min(M) tr(Z Z^T). Any Z is the
//          caller's; what is handed out has none, and scale = lambda_min(M).
//   G      max_j tr(J_j N^-1 J_j^T) sum mu >= tr(K^T N^-1 K) with the columns of K the
//          sqrt(mu_j) J_j^T, mu >= 0; the rest as for traces:
//          s = tr(K^T Z)^2 / (sum mu max_j tr(J_j M^-1 J_j^T)).
//
// Compound: with shares a_k of sum one and by the inequality of weighted means
//
//   prod_k (Phi_k(N)/Phi_k(M))^a_k <= sum_k a_k Phi_k(N)/Phi_k(M)
//                                  <= max_i tr(sum_k a_k Z_k Z_k^T/s_k H_i).
#pragma once

#include <Eigen/Core>
#include <boost/multiprecision/eigen.hpp>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/conditioning/quadruple.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox {

template <class Real>
struct DualBound {
  Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic> z;
  Real scale{0};    // s
  Real error{0};    // of s, relative
  Real log_phi{0};  // log Phi(M), within `error`
};

// `information`: M, eliminated in elimination_order(). `dual_weights`: mu of G, one for each point.
// Not for compound, nor for G without a region.
template <class Real>
[[nodiscard]] DualBound<Real> dual_bound(const Criterion& criterion, std::size_t dimension,
                                         const InformationIn<Real>& information,
                                         const std::vector<double>& dual_weights = {});

}  // namespace graybox
