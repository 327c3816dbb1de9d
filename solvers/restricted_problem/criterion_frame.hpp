// CriterionFrame: the coordinates in which a smooth criterion (A, L, I, c, Ds, phi_p, and G made
// smooth; D is the case K = I of Ds) is diagonal at an information matrix M. With K of
// criterion.hpp, C = K^T M^-1 K of s columns,
//
//   f(M) = log tr C  (A, L, I, c),   (log det C)/s  (Ds),   (log tr C^p)/p  (phi_p, K = I).
//
// Take X with X M X^T = I (inverse_cholesky.hpp), P = X K, and an orthogonal U with
//
//   trace  P P^T = U diag(sigma) U^T,  D = sigma / sum sigma;
//   Ds     P = U_1 R (QR),             D = 1/s on the range of P, zero beside it;
//   phi_p  P = U diag(sigma)^(1/2) V^T (singular values), D = sigma^p / sum sigma^p.
//
// Then, with the axes X^ = U^T X, the gradient of -f is G = X^^T diag(D) X^, tr(G M) = sum D = 1:
// the matrix of certificate.hpp. With B_i = X^ H_i X^^T and w_i = tr(G H_i) the second derivative
// of f along H_i and H_j is
//
//   sum_ab Omega_ab (B_i)_ab (B_j)_ab - r w_i w_j,
//
//   trace  Omega_ab = D_a + D_b,  r = 1: the second derivative of tr C is
//          2 tr(M^-1 K K^T M^-1 H_i M^-1 H_j);
//   Ds     Omega_ab = max(D_a, D_b),  r = 0: tr(B_i B_j)/s, less the same for the block of B beside
//          the range of P, whose determinant is what log det M has more than log det C^-1;
//   phi_p  Omega_ab = (sigma_a^(p+1) - sigma_b^(p+1)) / ((sigma_a - sigma_b) sum sigma^p),  r = p:
//          divided differences of the derivative of sigma^-p (Daleckii and Krein 1965).
//
// G over a region is max_j g_j with g_j = tr(J_j M^-1 J_j^T). Made smooth with a sharpness b,
// f = (log sum_j g_j^b)/b lies at most (log of the number of points)/b above log max_j g_j. It is
// convex as a log sum exp of the convex b log g_j (certificate.hpp), and f(t M) = f(M) - log t.
// With pi_j = g_j^b / sum g^b its gradient is that of L with W = sum_j (pi_j/g_j) J_j^T J_j, and
//
//   second derivative   that of L without - w_i w_j,
//                       + sum_j (b - 1) pi_j v_ji v_jj' - b w_i w_j',
//                       v_ji = tr(M^-1 J_j^T J_j M^-1 H_i)/g_j.
//
// E, and G where it is asked for, are made smooth by a barrier of weight tau = 1/b: with the
// eigenvalues l_a of M, or l_j = 1/g_j,
//
//   -f = max_t [log t + tau sum_a log(1 - t/l_a)],     D_a = tau u_a/(1 - u_a),   u_a = t/l_a.
//
// At the best t sum D = 1, and D_a are the shares. log min_a l_a is at most (number of the a) tau
// above -f. Newton's method bears a barrier better than a norm: f/tau is self-concordant for E. The
// second derivative has, with q = sum_a D_a (1 + D_a/tau) d log l_a, the term
//
//   - q q^T / (1 + sum D_a^2/tau)   beside   Omega_ab = D_a + D_b + D_a D_b/tau          (E),
//                                            that of L and sum_j D_j^2/tau v_j v_j^T     (G).
//
// O(d^3), for G and m rows of the region O(m d^2).
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cstddef>
#include <span>
#include <vector>

#include "solvers/core/criterion.hpp"
#include "solvers/core/inverse_cholesky.hpp"

namespace graybox {

class CriterionFrame {
 public:
  // coefficient v v^T, part of the second derivative; v_i = tr(dual H_i).
  struct OuterTerm {
    double coefficient = 0.0;
    std::vector<double> dual;  // in trace-dual packing
  };

  // In the coordinates H_i -> R H_i R^T, R d x d row-major (the identity if empty), K becomes R K,
  // and J_j^T R J_j^T. Not for compound, nor for G without a region.
  CriterionFrame(const Criterion& criterion, std::size_t dimension,
                 std::span<const double> coordinates);

  // f at the M that `inverse` has factorised; the frame stays where it is.
  [[nodiscard]] double value(const InverseCholesky& inverse);
  // f of the criterion itself at that M, where value() has E or G made smooth.
  [[nodiscard]] double sharp_value(const InverseCholesky& inverse);
  // Moves the frame to that M and returns f.
  double compute(const InverseCholesky& inverse);

  [[nodiscard]] const Eigen::MatrixXd& axes() const { return axes_; }         // X^
  [[nodiscard]] const Eigen::VectorXd& shares() const { return shares_; }     // D
  [[nodiscard]] std::span<const double> trace_dual() const { return dual_; }  // G
  [[nodiscard]] bool is_trace() const { return form_ == Form::kTrace; }       // A, L, I, c
  // Whether K has d columns, so that every optimum is regular.
  [[nodiscard]] bool complete() const { return complete_; }

  [[nodiscard]] double omega(Eigen::Index a, Eigen::Index b) const;
  [[nodiscard]] double rank_one() const { return rank_one_; }  // r
  // G: those of the points whose pi_j matters. With a barrier the last one is -q q^T.
  [[nodiscard]] std::span<const OuterTerm> outer_terms() const { return outer_; }

  // phi_p: min(p, limit) in place of p.
  void set_power_at_most(double limit);
  // G and E: b, 1 at first.
  void set_sharpness(double sharpness);
  // G by the barrier, as E.
  void smooth_by_barrier() { barrier_ = true; }
  [[nodiscard]] bool is_smoothed() const {
    return form_ == Form::kRegion || form_ == Form::kEigenvalue;
  }
  [[nodiscard]] std::size_t point_count() const { return row_counts_.size(); }
  // G: mu_j = (pi_j/g_j) / sum, the weights of the points in the dual problem.
  [[nodiscard]] std::vector<double> point_weights() const;
  // G: max_j g_j sum_j pi_j/g_j >= 1, by which the gap of the largest variance exceeds that of f.
  // E: the same with 1/l_a in place of g_j.
  [[nodiscard]] double smoothing_factor() const { return smoothing_factor_; }

 private:
  enum class Form { kTrace, kDeterminant, kPower, kRegion, kEigenvalue };

  void whiten(const InverseCholesky& inverse);
  double power_value();
  double largest_variance();
  double region_value();
  double eigenvalue_value();
  double barrier_value(std::span<const double> relative);
  void collect_outer_terms();
  void collect_eigenvalue_term();

  Form form_;
  double full_power_ = 1.0;  // p
  double power_ = 1.0;       // no larger than p
  double rank_one_ = 0.0;
  bool complete_ = false;
  Eigen::MatrixXd k_, x_, whitened_, axes_, dual_matrix_;
  Eigen::VectorXd shares_;
  Eigen::VectorXd relative_;  // phi_p: sigma over its largest
  double power_sum_ = 1.0;    // phi_p: sum of their p-th powers
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;
  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
  Eigen::JacobiSVD<Eigen::MatrixXd> svd_;
  std::vector<double> dual_;

  bool barrier_ = false;  // G and E, like all below
  double sharpness_ = 1.0;
  double smoothing_factor_ = 1.0;
  std::vector<std::size_t> row_counts_;   // rows of a point are columns of K
  std::vector<double> variance_, share_;  // g_j and pi_j
  std::vector<OuterTerm> outer_;
};

}  // namespace graybox
