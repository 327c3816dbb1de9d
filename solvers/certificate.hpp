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
// Arithmetic: sums in extended precision (64-bit significand), and `rounding_bound`, an
// a-posteriori bound on the error of duality_gap (extended_information.hpp). Cost O(Q d^2 + d^3), one
// pass over the set.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "graybox/problems/information_set.hpp"
#include "graybox/solvers/design.hpp"

namespace graybox {

enum class CertificateStatus {
  kCertified,   // the figures below hold
  kSingular,    // M is not numerically positive definite: gap and log det are infinite
  kNotADesign,  // wrong length, a NaN, a weight below -1e-12, or |sum - 1| > 1e-9
};
[[nodiscard]] std::string_view to_string(CertificateStatus status);

struct Certificate {
  CertificateStatus status = CertificateStatus::kNotADesign;
  double duality_gap = 0.0;         // max_i tr(M^-1 H_i)/d - 1, after clipping and renormalising
  double rounding_bound = 0.0;      // |error of duality_gap| is at most this
  double log_det = 0.0;             // log det M
  double log_det_gap = 0.0;         // d log(1 + duality_gap): how far log det M can be from optimal
  double efficiency = 0.0;          // at least 1/(1 + duality_gap)
  std::size_t worst_candidate = 0;  // where the maximum sensitivity stands
  std::size_t support_size = 0;     // weights above zero, after clipping
  double clipped = 0.0;             // sum of the negative weights set to zero, as a positive number
  double renormalised = 0.0;        // sum of the weights minus one, before renormalising
  std::string message;              // why it is not certified
};

[[nodiscard]] Certificate certify(const InformationSet& set, const Design& design);

}  // namespace graybox
