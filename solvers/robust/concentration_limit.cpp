#include "solvers/robust/concentration_limit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The uniform design on the k best candidates: its concentration g_k and its mean gain A_k.
struct LevelPoint {
  Extended concentration;
  Extended gain;
};

// (1, A_1) and (r/k, A_k) for k > r. Mixtures never need 1 < k <= r: the concentration is 1 as for
// k = 1 and the gain no larger.
std::vector<LevelPoint> level_points(std::span<const Extended> gains, std::size_t positions) {
  std::vector<Extended> sorted(gains.begin(), gains.end());
  std::ranges::sort(sorted, std::greater<>());
  std::vector<LevelPoint> points{{1, sorted[0]}};
  Extended sum = 0;
  for (std::size_t k = 1; k <= sorted.size(); ++k) {
    sum += sorted[k - 1];
    if (k <= positions) continue;
    const auto size = static_cast<Extended>(k);
    points.push_back({static_cast<Extended>(positions) / size, sum / size});
  }
  return points;
}

Extended slope(const LevelPoint& right, const LevelPoint& left) {
  return (right.gain - left.gain) / (right.concentration - left.concentration);
}

// The slope of the upper concave envelope at `share`; the points go from right to left.
Extended envelope_slope(const std::vector<LevelPoint>& points, Extended share) {
  std::vector<LevelPoint> hull;
  for (const LevelPoint& point : points) {
    while (hull.size() > 1 &&
           slope(hull[hull.size() - 2], hull.back()) >= slope(hull[hull.size() - 2], point)) {
      hull.pop_back();
    }
    hull.push_back(point);
  }
  if (hull.size() == 1) return 0;
  std::size_t k = 1;
  while (k + 1 < hull.size() && hull[k].concentration > share) ++k;
  return slope(hull[k - 1], hull[k]);
}

}  // namespace

ConcentrationLimit concentration_limit(double largest_share, double of_positions,
                                       std::size_t candidate_count) {
  if (!(largest_share > 0.0 && largest_share <= 1.0)) {
    throw InputError(fmt::format("largest share {} must be above 0 and at most 1", largest_share));
  }
  if (!(of_positions > 0.0 && of_positions <= 1.0)) {
    throw InputError(
        fmt::format("fraction of positions {} must be above 0 and at most 1", of_positions));
  }
  constexpr double kRounding = 1e-12;  // 0.07 * 100 is below 7 in floating point
  const auto count = static_cast<double>(candidate_count);
  const double positions = std::floor(of_positions * count * (1.0 + kRounding));
  if (positions < 1.0) {
    throw InputError(fmt::format("{} of {} positions is less than one; give at least {:.3g}",
                                 of_positions, candidate_count, 1.0 / count));
  }
  if (largest_share < positions / count * (1.0 - kRounding)) {
    throw InputError(
        fmt::format("no design puts at most {} of its experiments in any {} of {} positions: even "
                    "equal weights "
                    "put {:.6g} there; raise the share or take fewer positions",
                    largest_share, positions, candidate_count, positions / count));
  }
  return {largest_share, static_cast<std::size_t>(positions)};
}

double concentration(std::span<const double> weights, std::size_t positions) {
  std::vector<double> sorted(weights.begin(), weights.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(positions);
  std::nth_element(sorted.begin(), middle - 1, sorted.end(), std::greater<>());
  Extended sum = 0;
  std::for_each(sorted.begin(), middle, [&](double weight) { sum += weight; });
  return static_cast<double>(sum);
}

LinearMaximum maximise_over_limit(std::span<const Extended> gains,
                                  const ConcentrationLimit& limit) {
  const std::vector<LevelPoint> points = level_points(gains, limit.positions);
  LinearMaximum maximum;
  maximum.price = std::max(envelope_slope(points, limit.share), Extended{0});
  for (const LevelPoint& point : points) {
    const Extended excess = limit.share - point.concentration;
    maximum.value = std::max(maximum.value, point.gain + maximum.price * excess);
  }
  return maximum;
}

ConcentrationCertificate certify_concentrated(const InformationSet& set, const Design& design,
                                              const ConcentrationLimit& limit) {
  ConcentrationCertificate answer;
  Certificate& certificate = answer.certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  const CheckedWeights checked(set, design);
  certificate.support_size = checked.support_size;
  certificate.clipped = checked.clipped;
  certificate.renormalised = checked.renormalised;
  certificate.message = checked.message;
  if (!certificate.message.empty()) return answer;

  answer.concentration = concentration(
      std::vector<double>(checked.weights.begin(), checked.weights.end()), limit.positions);
  if (answer.concentration > limit.share + 1e-9) {
    certificate.message =
        fmt::format("the {} heaviest positions hold {:.12g} of the weight; the limit is {}",
                    limit.positions, answer.concentration, limit.share);
    return answer;
  }
  const ExtendedInformation information(set, checked.weights);
  if (!information.regular()) {
    certificate.status = CertificateStatus::kSingular;
    certificate.message =
        "the design's information matrix is singular: it can't estimate all parameters";
    return answer;
  }

  std::vector<Extended> sensitivity(set.candidate_count());
  Extended magnitude = 0;
  for (std::size_t i = 0; i < sensitivity.size(); ++i) {
    sensitivity[i] = information.sensitivity(set.information(i));
    magnitude = std::max(magnitude, information.magnitude(set.information(i)));
  }
  const LinearMaximum maximum = maximise_over_limit(sensitivity, limit);
  const auto d = static_cast<Extended>(set.dimension());
  const Extended delta = information.residual();
  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = certificate.criterion_value = static_cast<double>(information.log_det());
  certificate.worst_candidate =
      static_cast<std::size_t>(std::ranges::max_element(sensitivity) - sensitivity.begin());
  certificate.duality_gap = static_cast<double>(maximum.value / d - 1);
  // The maximum is a mean of sensitivities: monotone in them, and moved by no more than they are.
  // As a function of the share it is concave with slope `price`: a design above the limit is one of
  // a problem whose maximum is larger by no more than that.
  const Extended excess = std::max<Extended>(answer.concentration - limit.share, 0);
  certificate.rounding_bound =
      static_cast<double>((maximum.value * delta / (1 - delta) +
                           information.trace_unit() * magnitude + maximum.price * excess) /
                              d +
                          std::numeric_limits<double>::epsilon() * std::abs(maximum.value / d - 1));
  state_bounds(static_cast<double>(d), certificate);
  answer.price = static_cast<double>(maximum.price);
  return answer;
}

}  // namespace graybox
