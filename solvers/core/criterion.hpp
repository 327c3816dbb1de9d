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
//
// D and Ds do not depend on the units of the parameters. A, E and L do: a variance in (N m/rad)^2
// outweighs one of a relative stiffness; parameters should be scaled so that their errors compare.
//
//   const graybox::Criterion gearboxes = graybox::Criterion::ds({0, 1, 2});
//   const graybox::Solution answer = solver.solve(set, {.criterion = gearboxes});
//   const graybox::Certificate proof = graybox::certify(set, answer.design, gearboxes);
//
// All but E have one form. They look at C = K^T M^-1 K with a d x k factor K (A: I; L: W = K K^T;
// Ds: the columns of I that are of interest). L and A look at tr C, D and Ds at log det C.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

enum class CriterionKind : std::int8_t { kD, kA, kE, kL, kDs };
[[nodiscard]] std::string_view to_string(CriterionKind kind);  // "D", "A", "E", "L", "Ds"
// The inverse. Throws InputError for another name.
[[nodiscard]] CriterionKind criterion_kind(std::string_view name);

class Criterion {
 public:
  Criterion() = default;  // D
  [[nodiscard]] static Criterion a() { return Criterion(CriterionKind::kA); }
  [[nodiscard]] static Criterion e() { return Criterion(CriterionKind::kE); }
  // W as a packed lower triangle (packed_matrix.hpp). Throws InputError unless it is finite, not
  // zero and positive semidefinite. That is decided on W scaled to unit diagonal: eigenvalues
  // within 1e-9 of the largest below zero, and those below 1e-14 d of it, count as zero. From then
  // on W is what K K^T makes of it.
  [[nodiscard]] static Criterion l(std::vector<double> weights);
  // Indices of the parameters of interest, counted from zero, in any order. Throws InputError if
  // there are none or one stands there twice.
  [[nodiscard]] static Criterion ds(std::vector<std::size_t> interest);

  [[nodiscard]] CriterionKind kind() const { return kind_; }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }         // L: W
  [[nodiscard]] std::span<const std::size_t> interest() const { return interest_; }  // Ds

  // K, column-major d x k; A, L, D and Ds only.
  [[nodiscard]] std::vector<double> factor(std::size_t dimension) const;

  // Throws InputError where W or a parameter of interest does not fit the set's dimension.
  void require_fits(const InformationSet& set) const;

  friend bool operator==(const Criterion& a, const Criterion& b) {
    return a.kind_ == b.kind_ && a.weights_ == b.weights_ && a.interest_ == b.interest_;
  }

 private:
  explicit Criterion(CriterionKind kind) : kind_(kind) {}

  CriterionKind kind_ = CriterionKind::kD;
  std::vector<double> weights_;        // L: packed W
  std::vector<double> weight_factor_;  // L: K
  std::vector<std::size_t> interest_;  // Ds, ascending
};

// The parameters named, as indices: each name is a parameter of the set or, where no parameter has
// that name, its index counted from zero. Throws InputError for one that is neither, listing the
// set's parameters.
[[nodiscard]] std::vector<std::size_t> parameter_indices(const InformationSet& set,
                                                         std::span<const std::string> names);

}  // namespace graybox
