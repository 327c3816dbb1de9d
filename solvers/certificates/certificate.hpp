// The checker. It alone decides whether an answer is right; no solver's word and no reference
// solution is needed.
//
// Kiefer-Wolfowitz equivalence theorem: with M = sum_i lambda_i H_i and the sensitivities
// w_i = tr(M^-1 H_i), the design lambda is D-optimal exactly where max_i w_i = d. In general, with
// duality_gap = max_i w_i / d - 1, weak duality with W = M^-1 d / max_i w_i in the paper's dual
// (10) gives
//
//   0 <= log det M* - log det M <= d log(1 + duality_gap),   D-efficiency >= 1 / (1 + duality_gap).
//
// The other criteria (criterion.hpp) have theorems of the same kind, from one lemma. Let Phi(M) be
// concave and positively homogeneous, Phi(t M) = t Phi(M). With a supergradient G of log Phi at M,
// tr(G M) = 1 by Euler, and for every design N = sum_i n_i H_i
//
//   Phi(N) <= Phi(M) + Phi(M) tr(G (N - M)) = Phi(M) tr(G N) <= Phi(M) max_i tr(G H_i),     (a)
//
// so that with duality_gap = max_i tr(G H_i) - 1 the efficiency Phi(M) / Phi(M*) is at least
// 1/(1 + duality_gap). This one gap, which for D is the one above, is what "gap" means throughout:
//
//        Phi(M)                     G                                  w_i
//   D    (det M)^(1/d)              M^-1 / d                           tr(M^-1 H_i)
//   A,L  1 / phi, phi = tr(W M^-1)  M^-1 W M^-1 / phi                  tr(M^-1 W M^-1 H_i)
//   Ds   (det S)^(1/s)              (M^-1 - [M_nn^-1 in n, else 0])/s  tr(M^-1 H_i)
//                                                                      - tr(M_nn^-1 H_i,nn)
//   E    lambda_min(M)              E / lambda_min(M)                  tr(E H_i)
//   phi_p  (tr(M^-p)/d)^(-1/p)      M^-(p+1) / tr M^-p                 tr(M^-(p+1) H_i)
//   G    1 / max_j tr(R_j M^-1)     that of L, W = sum_j mu_j R_j      that of L
//   compound  prod_k Phi_k^a_k      sum_k a_k G_k                      tr(G H_i)
//
// At the optimum max_i w_i is d, phi, s, lambda_min, tr M^-p, phi and 1. I and c are L with their
// W.
//
//   A, L   1/phi is concave: phi(M) = tr(K^T M^-1 K), W = K K^T, is the sum over the columns k of K
//          of 1/g_k with g_k(M) = 1/(k^T M^-1 k) = min {x^T M x : k^T x = 1}, a minimum of linear
//          functions; the harmonic sum of concave positive functions is concave. The efficiency is
//          phi(M*) / phi(M): gap 0.01 says that phi is at most 1 % above the best.
//   Ds     S = M_ss - M_sn M_nn^-1 M_ns is concave in the Loewner order (x^T S x is the minimum
//          over y of the quadratic form of M at (x, y)) and det^(1/s) is concave and increasing. By
//          the Schur determinant log det S = log det M - log det M_nn, whence G; s tr(G H_i) is
//          w_i. The log det gap is s log(1 + gap).
//   E      lambda_min(M) = min {tr(E M) : E >= 0, tr E = 1}: (a) holds for any such E, that is
//          lambda_min(M*) <= max_i tr(E H_i). E is the design's dual_matrix, made positive
//          semidefinite and of trace one here (dual_repair says by how much), or where it has none
//          that of the best design, which is looked for (criterion_column_generation.hpp). A wrong
//          E can only loosen the bound.
//   phi_p, compound  Proofs in dual_bound.hpp.
//   G      R_j = J_j^T J_j. A minimum of the information functions of L with W = R_j. As for E the
//          gradient is not unique: any weights mu of sum one will do, since the largest of the
//          tr(R_j N^-1) is no less than their mean. They are the design's dual_weights, or those
//          of the best design. Over the candidates themselves the gap is that of D.
//
// M must be regular, for L and Ds as well, whose optimum may be singular: designs arbitrarily close
// to it are regular and have gaps arbitrarily close to zero (smooth_restricted_problem.hpp).
//
// Arithmetic. Sums in extended precision (64-bit significand), and `rounding_bound`, an
// a-posteriori bound on the error of duality_gap (extended_information.hpp). With it the true gap
// lies in
//
//   [duality_gap - rounding_bound, duality_gap + rounding_bound],
//
// and everything that is promised (proves(), log_det_gap, efficiency) holds at its upper end. A gap
// below minus its rounding bound can't be: the arithmetic broke, and nothing is proven.
//
// The bound grows with the condition of M. It stands in the way where the gap asked lies in the
// interval or the bound exceeds a tenth of max(duality_gap, asked gap). Then D, A, L and Ds are
// done again in quadruple precision (113 bits, quadruple.hpp). M and its factor are computed in
// O(support p + d^3), the sensitivities only of candidates that may attain the maximum. Those are
// found from the first pass: with an upper bound u_i and a lower bound l_i of each w_i, i is in
// question where u_i >= max_k l_k. A design that is singular in extended precision counts as
// singular unless quadruple precision proves its gap to be at most 1. A well-conditioned problem
// never comes here.
//
// Cost O(Q d^2 + d^3), one pass over the set.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

enum class CertificateStatus {
  kCertified,   // the figures below hold
  kSingular,    // M is not numerically positive definite: gap and log det are infinite
  kNotADesign,  // wrong length, a NaN, a weight below -1e-12, or |sum - 1| > 1e-9
};
[[nodiscard]] std::string_view to_string(CertificateStatus status);

struct Certificate {
  CertificateStatus status = CertificateStatus::kNotADesign;
  double duality_gap = 0.0;         // max_i tr(G H_i) - 1, after clipping and renormalising
  double rounding_bound = 0.0;      // |error of duality_gap| is at most this
  double log_det = 0.0;             // log det M
  double criterion_value = 0.0;     // D: log det M; A: tr M^-1; E: lambda_min(M); L: tr(W M^-1),
                                    // so c, I; Ds: log det S; phi_p: (tr(M^-p)/d)^(1/p);
                                    // G: the largest variance; compound: log Phi
  double log_det_gap = 0.0;         // D, Ds: d (s) log(1 + duality_gap + rounding_bound), how far
                                    // log det M (S) can be from optimal; NaN for the others
  double efficiency = 0.0;          // at least 1/(1 + duality_gap + rounding_bound)
  std::size_t worst_candidate = 0;  // where the maximum sensitivity stands
  std::size_t support_size = 0;     // weights above zero, after clipping
  double clipped = 0.0;             // sum of the negative weights set to zero, as a positive number
  double renormalised = 0.0;        // sum of the weights minus one, before renormalising
  double dual_repair = 0.0;  // E: trace norm of what was changed of the design's dual_matrix;
                             // NaN where it has none
  std::string message;       // why it is not certified
};

// The finest gap that anyone asks for without saying so.
inline constexpr double kFinestGap = 1e-9;

// `asked_gap`: what the design is to be held to. Throws InputError where the criterion does not fit
// the set's dimension.
[[nodiscard]] Certificate certify(const InformationSet& set, const Design& design,
                                  const Criterion& criterion = {}, double asked_gap = kFinestGap);

// The rule behind every "solved": the gap is at most `asked_gap` for certain, rounding included.
[[nodiscard]] bool proves(const Certificate& certificate, double asked_gap);

// True where the gap is negative beyond its rounding bound, which exact arithmetic excludes.
[[nodiscard]] bool arithmetic_broke(const Certificate& certificate);

// The largest that the gap can be: max(duality_gap, 0) + rounding_bound.
[[nodiscard]] double largest_gap(const Certificate& certificate);

// Fills in log_det_gap and efficiency. `factors`: of the determinant in which the criterion
// measures, NaN where it does not.
void state_bounds(double factors, Certificate& certificate);

// Phi(M) / Phi(M*) from the criterion_value of two designs: how many experiments with the better
// one do the work of one with the other.
[[nodiscard]] double relative_efficiency(const InformationSet& set, const Criterion& criterion,
                                         double value, double best_value);

}  // namespace graybox
