// The checker of designs under constraints (design_constraints.hpp): all criteria.
//
// With M = P + sum_i x_i H_i and G the supergradient of log Phi at M (certificate.hpp), tr(G M) =
// 1, concavity and Euler's identity give for every other design that obeys the constraints
//
//   Phi(M') / Phi(M) <= tr(G M') = tr(G P) + sum_i w_i x'_i,      w_i = tr(G H_i),
//
//   duality_gap = tr(G P) + max_x' sum_i w_i x'_i - 1.
//
// The efficiency Phi(M) / Phi(M*) is at least 1/(1 + duality_gap). The maximum is a linear
// programme. Its multipliers y are found here anew from the w_i, by the programme
// (linear_programme.hpp) and by complementary slackness, and the better ones bound it
// (multiplier_bound.hpp): the design and its constraints are all that is read. With one row sum x =
// 1 and no prior this is the certificate of certify().
//
// For E, G, phi_p and compound criteria the bounds of dual_bound.hpp stand in for tr(G .). The
// matrix Z of E and the weights of G's points are those of the barrier of criterion_frame.hpp at M:
// they are found from the design alone, by a search for the sharpness with the smallest gap.
//
// Arithmetic is that of certificate.hpp: extended precision, and quadruple where that is not
// enough.
//
// The gap is taken at the upper ends of all w_i. The rounding bound is what is left of rounding in
// the sum, and what the allowed violation of the rows is worth.
//
// A design may break limits and rows by a relative 1e-9 (largest_violation()); one that breaks them
// by more is kNotADesign.
//
// Cost O(Q d^2 + Q m + d^3) and a simplex method over Q m numbers, one pass over the set.
#pragma once

#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/constrained/design_constraints.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox {

inline constexpr double kAllowedViolation = 1e-9;

struct ConstrainedCertificate {
  Certificate certificate;  // log_det of M; worst_candidate has the largest w_i - a_i . y
  std::vector<double> multipliers =
      {};                  // y of each row: what one unit more of it is worth, relative
  double violation = 0.0;  // largest_violation()
};

// `efforts`: x, Q numbers. Throws InputError as require_fits() of both.
[[nodiscard]] ConstrainedCertificate certify_constrained(const InformationSet& set,
                                                         std::span<const double> efforts,
                                                         const DesignConstraints& constraints,
                                                         const Criterion& criterion = {},
                                                         double asked_gap = kFinestGap);

}  // namespace graybox
