#include "solvers/floors/efficiency_floor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/error.hpp"
#include "solvers/certificates/criterion_certificate.hpp"
#include "solvers/certificates/dual_bound.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/core/candidate_region.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kUp = 1.0 + 1e-14;  // more than what conversions to double lose

void require_single(const Criterion& criterion) {
  if (criterion.kind() != CriterionKind::kCompound) return;
  throw InputError(
      "a compound criterion can't be combined with floors: give one criterion, and a floor for "
      "each of the others");
}

// G over the candidates has the least largest variance d (Kiefer and Wolfowitz 1960); the points
// that stand for them are within rounding of them.
BestLogPhi best_over_candidates(const InformationSet& set) {
  const double best = -std::log(static_cast<double>(set.dimension()));
  constexpr double kRounding = 1e-13;
  return {best - kRounding, best + kRounding};
}

// Gap and rounding bound of (1) from those of the compound criterion and the slack of the floors.
void join(std::span<const EfficiencyFloor> floors, double slack, Certificate& certificate) {
  double all = 1.0;
  for (const EfficiencyFloor& floor : floors) all += floor.multiplier;
  const auto gap_of = [&](double gap) {
    return std::expm1(all * std::log1p(std::max(gap, 0.0)) + slack);
  };
  const double most = kUp * gap_of(largest_gap(certificate));
  certificate.duality_gap = gap_of(certificate.duality_gap);
  certificate.rounding_bound = std::max(most - certificate.duality_gap, 0.0);
}

}  // namespace

LogPhi log_phi_of(const InformationSet& set, const Design& design, const Criterion& criterion) {
  const CheckedWeights checked(set, design);
  if (!checked.message.empty()) return {-kInfinity, 0.0};
  const ExtendedInformation information(set, checked.weights, elimination_order(set, criterion));
  if (!information.regular()) return {-kInfinity, 0.0};
  const Criterion resolved = over_candidates(criterion, set);
  // The largest variance does not depend on the weights of the points.
  std::vector<double> points(resolved.region().count(), 1.0);
  const DualBound<Extended> bound = dual_bound(resolved, set.dimension(), information, points);
  const auto value = static_cast<double>(bound.log_phi);
  return {value, kUp * static_cast<double>(-std::log1p(-std::min<Extended>(bound.error, 0.5L))) +
                     1e-15 * std::abs(value)};
}

BestLogPhi best_log_phi(const InformationSet& set, const Criterion& criterion) {
  if (criterion.kind() == CriterionKind::kG && criterion.is_solved_as_d()) {
    return best_over_candidates(set);
  }
  const Solution best =
      ColumnGeneration().solve(set, {.duality_gap = kFinestGap, .criterion = criterion});
  const Certificate proof = certify(set, best.design, criterion);
  if (proof.status != CertificateStatus::kCertified) return {-kInfinity, kInfinity};
  const LogPhi reached = log_phi_of(set, best.design, criterion);
  return {reached.value - reached.error,
          reached.value + reached.error + kUp * std::log1p(largest_gap(proof))};
}

Criterion compound_of(const Criterion& objective, std::span<const EfficiencyFloor> floors) {
  std::vector<CriterionPart> parts{{1.0, objective}};
  for (const EfficiencyFloor& floor : floors) {
    if (floor.multiplier > 0.0) parts.push_back({floor.multiplier, floor.criterion});
  }
  return parts.size() == 1 ? objective : Criterion::compound(std::move(parts));
}

void require_fits(const Criterion& objective, std::span<const EfficiencyFloor> floors,
                  const InformationSet& set) {
  require_single(objective);
  objective.require_fits(set);
  int with_eigenvalue = objective.kind() == CriterionKind::kE ? 1 : 0;
  for (const EfficiencyFloor& floor : floors) {
    require_single(floor.criterion);
    if (floor.criterion.kind() == CriterionKind::kE && ++with_eigenvalue > 1) {
      throw InputError("floor E: E is the objective, or has a floor, already; leave one out");
    }
    floor.criterion.require_fits(set);
    if (!(floor.share > 0.0 && floor.share < 1.0)) {
      throw InputError(fmt::format("floor {}={}: the efficiency must lie between 0 and 1",
                                   to_string(floor.criterion.kind()), floor.share));
    }
    if (!(floor.multiplier >= 0.0) || !std::isfinite(floor.multiplier)) {
      throw InputError(fmt::format("floor {}: the multiplier {} must be finite and not negative",
                                   to_string(floor.criterion.kind()), floor.multiplier));
    }
  }
}

FlooredCertificate certify_floored(const InformationSet& set, const Design& design,
                                   const Criterion& objective,
                                   std::span<const EfficiencyFloor> floors, double asked_gap,
                                   std::vector<BestLogPhi> best) {
  require_fits(objective, floors, set);
  FlooredCertificate out{.certificate = certify(set, design, compound_of(objective, floors),
                                                std::min(asked_gap, kFinestGap)),
                         .efficiencies = {}};
  Certificate& certificate = out.certificate;
  if (certificate.status != CertificateStatus::kCertified) return out;
  if (best.empty()) {
    for (const EfficiencyFloor& floor : floors) best.push_back(best_log_phi(set, floor.criterion));
  }
  double slack = 0.0;
  for (std::size_t k = 0; k < floors.size(); ++k) {
    const LogPhi phi = log_phi_of(set, design, floors[k].criterion);
    const double level = std::log(floors[k].share);
    out.efficiencies.push_back(std::exp(phi.value - phi.error - best[k].most));
    if (phi.value - phi.error < level + best[k].most && certificate.message.empty()) {
      certificate.message = fmt::format(
          "it reaches only {:.8g} of the best under criterion {}, less than the floor {:.8g}",
          out.efficiencies.back(), to_string(floors[k].criterion.kind()), floors[k].share);
    }
    if (floors[k].multiplier > 0.0) {
      slack += floors[k].multiplier * (phi.value + phi.error - level - best[k].least);
    }
  }
  join(floors, slack, certificate);
  certificate.criterion_value = certify(set, design, objective).criterion_value;
  state_bounds(log_det_size(set, objective), certificate);
  if (!certificate.message.empty()) {
    certificate.status = CertificateStatus::kNotADesign;
    certificate.duality_gap = certificate.rounding_bound = certificate.log_det_gap = kInfinity;
    certificate.efficiency = 0.0;
  }
  return out;
}

}  // namespace graybox
