#include "graybox/diagnosis/force_balance/force_balance_laws.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

bool is_inertia(const LawEntry& entry) { return entry.use == LawUse::kInertia; }

}  // namespace

std::vector<std::size_t> PlacedLaw::linear() const {
  std::vector<std::size_t> result;
  if (is_inertia(*entry)) return {0};
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    if (entry->parameters[i].is_linear) result.push_back(i);
  }
  return result;
}

std::vector<std::size_t> PlacedLaw::refined() const {
  std::vector<std::size_t> result;
  if (is_inertia(*entry)) return result;
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    const LawParameter& parameter = entry->parameters[i];
    const bool is_scale =
        parameter.name == "anchor_distance" || parameter.name == "reference_velocity";
    if (!parameter.is_linear && !is_scale) result.push_back(i);
  }
  return result;
}

Eigen::VectorXd shape_rows(const CandidatePlace& place, const LawEntry& entry,
                           std::span<const double> parameters, const ForceBalanceRows& rows) {
  if (is_inertia(entry)) return parameters[0] * inertia_rows(place, rows);
  return law_rows(place, *entry.make(parameters), rows);
}

Eigen::MatrixXd linear_columns(const PlacedLaw& law, const ForceBalanceRows& rows) {
  const std::vector<std::size_t> linear = law.linear();
  Eigen::MatrixXd columns(rows.base.torque.size(), static_cast<Eigen::Index>(linear.size()));
  for (std::size_t k = 0; k < linear.size(); ++k) {
    std::vector<double> unit = law.parameters;
    for (const std::size_t other : linear) unit[other] = 0.0;
    unit[linear[k]] = 1.0;
    columns.col(static_cast<Eigen::Index>(k)) = shape_rows(*law.place, *law.entry, unit, rows);
  }
  return columns;
}

Eigen::VectorXd force_rows(const PlacedLaw& law, const ForceBalanceRows& rows) {
  return shape_rows(*law.place, *law.entry, law.parameters, rows);
}

std::vector<const LawEntry*> force_balance_laws(const CandidatePlace& place) {
  std::vector<const LawEntry*> laws;
  for (const LawEntry& entry : law_catalogue()) {
    if (entry.use != LawUse::kForce && entry.use != LawUse::kInertia) continue;
    // A hidden mass on a spring needs its own motion, which a force balance does not follow.
    if (entry.name == "mode") continue;
    if (entry.name == "balancer" && !place.turns) continue;
    laws.push_back(&entry);
  }
  return laws;
}

MotionScale motion_scale(const CandidatePlace& place, const ForceBalanceRows& rows) {
  MotionScale scale;
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const Motion& piece : rows.pieces) {
    const PlaceMotion motion = motion_at(place, piece);
    for (Eigen::Index t = 0; t < motion.deflection.size(); ++t) {
      scale.deflections.push_back(std::abs(motion.deflection(t)));
      scale.rates.push_back(std::abs(motion.rate(t)));
      lowest = std::min(lowest, motion.deflection(t));
      highest = std::max(highest, motion.deflection(t));
    }
  }
  std::sort(scale.deflections.begin(), scale.deflections.end());
  std::sort(scale.rates.begin(), scale.rates.end());
  scale.range = highest - lowest;
  return scale;
}

}  // namespace graybox
