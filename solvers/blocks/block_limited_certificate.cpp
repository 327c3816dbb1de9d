#include "solvers/blocks/block_limited_certificate.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/conditioning/extended_information.hpp"

namespace graybox {
namespace {

// The gap and how far it can be off: each sensitivity is known to within the factor
// 1/(1 -+ residual) and the rounding of its trace, and the gap is a mean of sensitivities. A design
// that breaks the limit by `excess` is one of the problem with the limit raised by it, whose mean
// is larger by at most excess times the sum of the filled blocks' maxima.
void price(const InformationSet& set, const CandidateBlocks& blocks, double limit, double excess,
           const ExtendedInformation& information, Certificate& certificate) {
  const auto d = static_cast<Extended>(set.dimension());
  std::vector<Extended> maxima(blocks.count, 0);
  Extended largest = 0, magnitude = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const Extended sensitivity = information.sensitivity(set.information(i));
    magnitude = std::max(magnitude, information.magnitude(set.information(i)));
    Extended& block_maximum = maxima[blocks.label[i]];
    block_maximum = std::max(block_maximum, sensitivity);
    if (sensitivity > largest) {
      largest = sensitivity;
      certificate.worst_candidate = i;
    }
  }
  const Extended mean = largest_limited_mean(std::span(maxima), limit);
  const Extended delta = information.residual();
  certificate.duality_gap = static_cast<double>(mean / d - 1);
  const Extended filled = std::min<Extended>(maxima.size(), 1 / static_cast<Extended>(limit) + 1);
  certificate.rounding_bound =
      static_cast<double>((mean * delta / (1 - delta) + information.trace_unit() * magnitude +
                           excess * filled * largest) /
                              d +
                          std::numeric_limits<double>::epsilon() * std::abs(mean / d - 1));
}

std::string broken_limit(const CandidateBlocks& blocks, const std::vector<double>& shares,
                         double limit) {
  for (std::size_t b = 0; b < blocks.count; ++b) {
    if (shares[b] > limit + kShareTolerance) {
      return fmt::format("block {} has the share {:.12g}, more than the limit {:.12g}", b,
                         shares[b], limit);
    }
  }
  return {};
}

}  // namespace

Certificate certify_block_limited(const InformationSet& set, const Design& design,
                                  const CandidateBlocks& blocks, double limit) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  check_blocks(set, blocks);
  check_block_limit(blocks, limit);
  Certificate certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  const CheckedWeights checked(set, design);
  certificate.support_size = checked.support_size;
  certificate.clipped = checked.clipped;
  certificate.renormalised = checked.renormalised;
  certificate.message = checked.message;
  if (!certificate.message.empty()) return certificate;
  const std::vector<double> shares = block_shares(blocks, design.weights);
  certificate.message = broken_limit(blocks, shares, limit);
  if (!certificate.message.empty()) return certificate;
  const ExtendedInformation information(set, checked.weights);
  if (!information.regular()) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message = "the design's information matrix is singular";
    return certificate;
  }
  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = certificate.criterion_value = static_cast<double>(information.log_det());
  const double excess = std::max(*std::ranges::max_element(shares) - limit, 0.0);
  price(set, blocks, limit, excess, information, certificate);
  state_bounds(static_cast<double>(set.dimension()), certificate);
  return certificate;
}

}  // namespace graybox
