// The bound from which every proof about exact designs is made: log det over a box of counts, by
// duality with any positive definite W, and what it says about single counts.
//
// Box: whole numbers l_i <= m_i <= u_i, sum_i m_i = M. Let W be any positive definite matrix and
// g_i = tr(W H_i). The arithmetic mean of eigenvalues is at least the geometric one, so
//
//   log det M(m) = -log det W + log det(W^1/2 M(m) W^1/2)
//               <= -log det W + d log(tr(W M(m)) / d),        tr(W M(m)) = sum_i m_i g_i.       (1)
//
// The right side grows with P = max sum_i m_i g_i over the box: a knapsack, solved by filling the
// largest g_i first. With nu the last value filled (its multiplier), linear programming duality
// says
//
//   P = M nu + sum_i [ l_i min(g_i - nu, 0) + u_i max(g_i - nu, 0) ].                           (2)
//
//   bound = d log(P / d) - log det W.                                                           (3)
//
// Nothing about W is assumed, so (3) holds for whatever iterate a solver stopped at; it is sharp
// where W is the inverse of the box's best relaxed information matrix.
//
// Safe elimination. Let T be the value that a better design has to exceed. If m_i >= l_i + k for an
// i with g_i < nu, then l_i may be replaced by l_i + k in (2) and P falls by k (nu - g_i). By (3)
// such a design exceeds T only if P - k (nu - g_i) > P_T, P_T = d exp((T + log det W) / d). Hence
//
//   m_i <= l_i + (P - P_T) / (nu - g_i)   where g_i < nu,                                       (4)
//   m_i >= u_i - (P - P_T) / (g_i - nu)   where g_i > nu.                                       (5)
//
// Before branching l = 0, u = M, W = M(lambda)^-1 / M for the relaxed optimum lambda. So nu = max_i
// w_i / M = d (1 + gap) / M and P = d (1 + gap). With the loss of the incumbent beta = log det
// M(lambda) - log det(M(m) / M), (4) reads: at most
//
//   M (d (1 + gap) - d e^(-beta / d)) / (d (1 + gap) - w_i)  <=  M (beta + d gap) / (d - w_i)   (6)
//
// repetitions of candidate i in any design that is no worse than the incumbent, and none where that
// is below one. It takes no more than the certificate of the relaxed problem and one good design.
// The loss beta is about C / M^2 (second-order loss of rounding), so the budget M beta falls as
// 1 / M: the more experiments there are, the fewer candidates remain. C grows with tr(B_i^2). This
// is small for candidates of full rank and large for those of rank one, of which the rule keeps far
// more.
//
// The trace-free part of H_i, which sharpens screening.hpp, enters through the choice of W: for
// each candidate (3) is evaluated at a W that is optimal, to second order, for the box with m_i >=
// l_i + k (node_relaxation.hpp, "probing").
//
// Rounding. g_i and log det W come from floating-point numbers. With W = X^T X for the computed X,
// log det W is exact up to a few units, and |error of g_i| <= gamma tr(W) ||H_i||_F, gamma =
// (p + 4 d + 32) 2^-53, because sum_k |X_kj X_kl| <= tr(W). Bounds (3) are raised by the effect of
// that on P, `slack` below.
//
// Cost O(n + n' log n) for n candidates, n' of them filled.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace graybox {

struct BoxLimits {
  std::span<std::int32_t> lower;
  std::span<std::int32_t> upper;
};

class BoxBound {
 public:
  explicit BoxBound(std::size_t dimension) : dimension_(static_cast<double>(dimension)) {}

  // (3) for sensitivities g_i known to within `slack`, W of the given log det. Minus infinity where
  // the box holds no design of M experiments.
  double evaluate(std::span<const double> g, std::span<const std::int32_t> lower,
                  std::span<const std::int32_t> upper, std::int64_t experiments,
                  double log_det_dual, double slack);

  [[nodiscard]] double bound() const { return bound_; }
  [[nodiscard]] double multiplier() const { return multiplier_; }  // nu
  [[nodiscard]] double total() const { return total_; }            // P

  // (4) and (5) after evaluate() with the same g. Returns how many limits moved.
  std::size_t tighten(std::span<const double> g, double threshold, BoxLimits limits) const;

 private:
  double dimension_;
  double bound_ = 0.0;
  double multiplier_ = 0.0;
  double total_ = 0.0;
  double log_det_dual_ = 0.0;
  double slack_ = 0.0;
  std::int64_t experiments_ = 0;
  std::vector<std::pair<double, std::int32_t>> heap_;  // (g_i, u_i - l_i)
};

}  // namespace graybox
