// The three passes over the set from which first-order methods are made, on the packed layout and
// with the processor's widest vectors (problems/kernels/kernels.hpp). One pass costs 2 Q p flops
// and is bound by memory. Results do not depend on the number of threads.
#pragma once

#include <span>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// M = sum_i weights_i H_i, packed (p numbers). Candidates of weight zero are not read.
void information_matrix(const InformationSet& set, std::span<const double> weights,
                        std::span<double> packed);

// Factor of a packed positive definite matrix: W = M^-1 in trace-dual packing (off-diagonal
// entries doubled, so that w_i = W . h_i) and log det M. Returns false if M is not numerically
// positive definite (after scaling to unit diagonal).
struct InverseFactor {
  std::vector<double> trace_dual;  // p
  double log_det = 0.0;
};
[[nodiscard]] bool invert(std::span<const double> packed, std::size_t dimension,
                          InverseFactor& factor);

// log det sum_i weights_i H_i for any weights >= 0, so that (det M^-1)^(1/d) = exp(-log det / d) is
// the covariance of the paper's Table I; minus infinity where M is not numerically positive
// definite.
[[nodiscard]] double log_det_information(const InformationSet& set,
                                         std::span<const double> weights);

// Sensitivities w_i = tr(M^-1 H_i) for all candidates.
void sensitivities(const InformationSet& set, std::span<const double> trace_dual,
                   std::span<double> out);

// max_i tr(M^-1 H_i)/d - 1 for given weights, in plain double precision; infinity if M is singular.
// For judging answers use certify(), which bounds its own rounding.
[[nodiscard]] double duality_gap(const InformationSet& set, std::span<const double> weights);

}  // namespace graybox
