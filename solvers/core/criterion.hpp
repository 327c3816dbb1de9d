// Criterion: what makes a design good. With M the information matrix of a design, so that M^-1 is
// the covariance of the estimated parameters (Pukelsheim 1993):
//
//   D   log det M, to be as large as possible: the volume of the confidence ellipsoid.
//   A   tr(M^-1), as small as possible: the sum of the variances.
//   E   lambda_min(M), as large as possible: the variance of the worst normalised combination.
//   L   tr(W M^-1), as small as possible, W >= 0: a weighted sum of (co)variances. W = c c^T is the
//       variance of one combination c^T theta (c-optimality); W = I is A.
//   Ds  log det (M_ss - M_sn M_nn^-1 M_ns), as large as possible: the volume of the confidence
//       ellipsoid of s parameters of interest, n being the others ("nuisance"). All of interest: D.
//   c   L with W = sum_j c_j c_j^T: the sum of the variances of linear functions c_j^T theta.
//   I   L with W = mean_j J_j^T J_j: the mean variance of the predictions J_j theta of a region.
//   phi_p  ((tr M^-p)/d)^(1/p), p > 0, as small as possible (Kiefer 1974): the mean of the p-th
//       powers of the variances along the axes of the ellipsoid. p = 0 is D, 1 is A, infinity E.
//   G   max_j tr(J_j M^-1 J_j^T), as small as possible: the largest prediction variance of a
//       region, summed over the responses of a point. Over the candidates themselves it is
//       max_i tr(M^-1 H_i), whose minimum d the D-optimal designs reach, and no others do (Kiefer
//       and Wolfowitz 1960).
//   compound  sum_k a_k log Phi_k, a_k > 0 of sum one, as large as possible: the weighted mean of
//       the logarithms of the efficiencies under several criteria, E at most once.
//
// D and Ds do not depend on the units of the parameters, nor does G, and I only through those of
// the predictions. A, E, L and phi_p do: a variance in (N m/rad)^2 outweighs one of a relative
// stiffness; parameters should be scaled so that their errors compare.
//
//   const graybox::Criterion gearboxes = graybox::Criterion::ds({0, 1, 2});
//   const graybox::Solution answer = solver.solve(set, {.criterion = gearboxes});
//   const graybox::Certificate proof = graybox::certify(set, answer.design, gearboxes);
//
// D, A, L, I, c and Ds have one form. They look at C = K^T M^-1 K with a d x k factor K (A: I; L,
// I, c: W = K K^T; Ds: the columns of I that are of interest). A, L, I and c look at tr C, D and
// Ds at log det C.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/prediction_region.hpp"

namespace graybox {

enum class CriterionKind : std::int8_t { kD, kA, kE, kL, kDs, kC, kI, kPhiP, kG, kCompound };
// "D", "A", "E", "L", "Ds", "c", "I", "phi_p", "G", "compound".
[[nodiscard]] std::string_view to_string(CriterionKind kind);
// The inverse. Throws InputError for another name.
[[nodiscard]] CriterionKind criterion_kind(std::string_view name);

struct CriterionPart;

class Criterion {
 public:
  Criterion();  // D
  [[nodiscard]] static Criterion a();
  [[nodiscard]] static Criterion e();
  // W as a packed lower triangle (packed_matrix.hpp). Throws InputError unless it is finite, not
  // zero and positive semidefinite. That is decided on W scaled to unit diagonal: eigenvalues
  // within 1e-9 of the largest below zero, and those below 1e-14 d of it, count as zero. From then
  // on W is what K K^T makes of it.
  [[nodiscard]] static Criterion l(std::vector<double> weights);
  // Indices of the parameters of interest, counted from zero, in any order. Throws InputError if
  // there are none or one stands there twice.
  [[nodiscard]] static Criterion ds(std::vector<std::size_t> interest);

  // W as for l(), under the names c and I.
  [[nodiscard]] static Criterion c(std::vector<double> weights);
  [[nodiscard]] static Criterion i(std::vector<double> weights);
  // p = 0 gives D and p = infinity E. Throws InputError for p < 0 and for no number.
  [[nodiscard]] static Criterion phi_p(double p);
  // Over the candidates; over a region. Throws InputError for a region without points.
  [[nodiscard]] static Criterion g();
  [[nodiscard]] static Criterion g(PredictionRegion region);
  // The shares are divided by their sum. Throws InputError where there are none, a share is not
  // positive, E stands there twice, or a part is compound itself.
  [[nodiscard]] static Criterion compound(std::vector<CriterionPart> parts);

  [[nodiscard]] CriterionKind kind() const { return kind_; }
  // A, L, I, c: the criterion is tr(W M^-1).
  [[nodiscard]] bool is_trace() const { return kind_ == CriterionKind::kA || has_weights(); }
  [[nodiscard]] bool has_weights() const {
    return kind_ == CriterionKind::kL || kind_ == CriterionKind::kC || kind_ == CriterionKind::kI;
  }
  // Whether the criterion is of those that the methods for constraints and for whole numbers of
  // experiments know: D, A, L, I, c, Ds.
  [[nodiscard]] bool has_factor() const {
    return is_trace() || kind_ == CriterionKind::kD || kind_ == CriterionKind::kDs;
  }
  // D, and G over the candidates.
  [[nodiscard]] bool is_solved_as_d() const {
    return kind_ == CriterionKind::kD || (kind_ == CriterionKind::kG && region_.count() == 0);
  }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }         // L, I, c: W
  [[nodiscard]] double p() const { return p_; }                                      // phi_p
  [[nodiscard]] const PredictionRegion& region() const { return region_; }           // G
  [[nodiscard]] std::span<const CriterionPart> parts() const;                        // compound
  [[nodiscard]] std::span<const std::size_t> interest() const { return interest_; }  // Ds

  // K, column-major d x k; has_factor() must hold.
  [[nodiscard]] std::vector<double> factor(std::size_t dimension) const;

  // Throws InputError where W or a parameter of interest does not fit the set's dimension.
  void require_fits(const InformationSet& set) const;

  friend bool operator==(const Criterion& a, const Criterion& b);

 private:
  explicit Criterion(CriterionKind kind);
  [[nodiscard]] static Criterion weighted(CriterionKind kind, std::vector<double> weights);

  CriterionKind kind_ = CriterionKind::kD;
  std::vector<double> weights_;        // L, I, c: packed W
  std::vector<double> weight_factor_;  // L, I, c: K
  std::vector<std::size_t> interest_;  // Ds, ascending
  double p_ = 0.0;                     // phi_p
  PredictionRegion region_;            // G; without points: the candidates
  std::vector<CriterionPart> parts_;   // compound
};

// One of several criteria, and its share of the whole.
struct CriterionPart {
  double share = 1.0;
  Criterion criterion;

  friend bool operator==(const CriterionPart& a, const CriterionPart& b) {
    return a.share == b.share && a.criterion == b.criterion;
  }
};

// What needs the size of a part.
inline Criterion::Criterion() = default;
inline Criterion::Criterion(CriterionKind kind) : kind_(kind) {}
inline Criterion Criterion::a() { return Criterion(CriterionKind::kA); }
inline Criterion Criterion::e() { return Criterion(CriterionKind::kE); }
inline Criterion Criterion::g() { return Criterion(CriterionKind::kG); }
inline std::span<const CriterionPart> Criterion::parts() const { return parts_; }

// The parameters named, as indices: each name is a parameter of the set or, where no parameter has
// that name, its index counted from zero. Throws InputError for one that is neither, listing the
// set's parameters.
[[nodiscard]] std::vector<std::size_t> parameter_indices(const InformationSet& set,
                                                         std::span<const std::string> names);

}  // namespace graybox
