#include "diagnosis/hypotheses/next_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"

namespace graybox {
namespace {

constexpr double kPowerQuantile = 1.2815515655446004;  // of the normal distribution, 90 %
constexpr double kGap = 1e-6;
constexpr double kSmallestShare = 0.01;

}  // namespace

double distance_that_excludes(double margin) {
  const double root = kPowerQuantile + std::sqrt(kPowerQuantile * kPowerQuantile + margin);
  return root * root;
}

std::optional<NextExperiment> next_experiment(const RivalExperiments& rivals,
                                              double exclusion_margin) {
  const Criterion step = Criterion::ds({rivals.information.dimension() - 1});
  const Solution solution =
      ColumnGeneration().solve(rivals.information, {.duality_gap = kGap, .criterion = step});
  if (solution.status == SolveStatus::kUnsupported) return {};
  const Certificate proof = certify(rivals.information, solution.design, step);
  if (proof.status != CertificateStatus::kCertified) return {};
  NextExperiment next;
  next.duality_gap = proof.duality_gap;
  next.distance_now = rivals.distance_now;
  next.distance_then = std::exp(proof.criterion_value);
  next.recordings = rivals.recordings;
  for (std::size_t i = 0; i < rivals.options.size(); ++i) {
    const double weight = solution.design.weights[i];
    if (weight >= kSmallestShare) next.shares.push_back({rivals.options[i], weight});
  }
  std::ranges::stable_sort(next.shares, std::greater<>(), &NextExperiment::Share::weight);
  const double gain = next.distance_then - next.distance_now;
  next.distance_needed = distance_that_excludes(exclusion_margin);
  const double missing = std::max(0.0, next.distance_needed - next.distance_now);
  next.recordings_needed = gain > 0.0 ? std::ceil(rivals.recordings * missing / gain)
                                      : std::numeric_limits<double>::infinity();
  return next;
}

}  // namespace graybox
