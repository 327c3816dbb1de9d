// The checker of exact designs, independent of the methods that make them.
//
// It takes nothing but the counts and an upper bound of log det M(m) over all exact designs. That
// is the relaxation's (relaxation.hpp), which it can always compute for itself, or the one that
// branch and bound has proven. Then
//
//   V(M lambda*) <= V(m*) <= V(m),   V(x) = (det sum_i x_i H_i)^(-1/d)        (paper, Section IV)
//
//   proven_efficiency = exp((log det M(m) - bound) / d) <= (det M(m) / det M(m*))^(1/d),
//
// with log det M(m) from extended precision, lowered by its rounding bound.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/exact/exact_design.hpp"
#include "solvers/exact_bounds/relaxation.hpp"

namespace graybox {

struct ExactCertificate {
  CertificateStatus status = CertificateStatus::kNotADesign;
  std::int64_t experiments = 0;  // M
  std::size_t support_size = 0;  // candidates that are run at least once
  double log_det = -std::numeric_limits<double>::infinity();  // of sum_i m_i H_i
  double rounding_bound = 0.0;                                // |error of log_det| is at most this
  double covariance = std::numeric_limits<double>::infinity();     // V(m)
  double log_det_bound = std::numeric_limits<double>::infinity();  // the smaller of the two bounds
  double covariance_bound = 0.0;                                   // V(m*) is at least this
  double proven_efficiency = 0.0;
  std::string message;  // why it is not certified
};

// kNotADesign: wrong length, a negative count, or counts that do not sum to `experiments`.
// kSingular: sum_i m_i H_i can't estimate all parameters. `log_det_bound` is a bound proven
// elsewhere, infinity if there is none.
[[nodiscard]] ExactCertificate certify_exact(
    const InformationSet& set, const ExactDesign& design, std::int64_t experiments,
    const Relaxation& relaxation, double log_det_bound = std::numeric_limits<double>::infinity());

}  // namespace graybox
