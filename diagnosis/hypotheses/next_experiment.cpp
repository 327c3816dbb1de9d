#include "graybox/diagnosis/hypotheses/next_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "graybox/solvers/certificate.hpp"
#include "graybox/solvers/column_generation.hpp"

namespace graybox {
namespace {

// Non-centrality that a test at level 5 % with one degree of freedom needs for a power of 90 %:
// (z_0.975 + z_0.9)^2.
constexpr double kNeeded = 10.507;
constexpr double kGap = 1e-6;
constexpr double kSmallestShare = 0.01;

}  // namespace

std::optional<NextExperiment> next_experiment(const RivalExperiments& rivals) {
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
  const double missing = std::max(0.0, kNeeded - next.distance_now);
  next.recordings_needed = gain > 0.0 ? std::ceil(rivals.recordings * missing / gain)
                                      : std::numeric_limits<double>::infinity();
  return next;
}

}  // namespace graybox
