#include "diagnosis/evidence/holding_friction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

constexpr std::array<std::string_view, 5> kSliding{"coulomb", "asymmetric_coulomb", "stribeck",
                                                   "sublinear_friction", "load_dependent_friction"};
constexpr std::array<std::string_view, 4> kHolding{"dahl", "lugre", "bouc_wen", "play_and_slip"};

double largest_parameter(const FittedLaw& law, std::string_view part_of_name) {
  double largest = 0.0;
  for (const LawParameterEstimate& each : law.parameters) {
    if (each.name.find(part_of_name) != std::string::npos) {
      largest = std::max(largest, std::abs(each.value));
    }
  }
  return largest;
}

double held_by(const FittedLaw& law, const Hypothesis& hypothesis, double speed, double drive) {
  if (hypothesis.place.starts_with("actuator ")) {
    return hypothesis.law == "dead_zone" ? law.parameters.front().value : 0.0;
  }
  if (std::ranges::count(kHolding, hypothesis.law) > 0) {
    return std::max(largest_parameter(law, "level"), largest_parameter(law, "force"));
  }
  if (std::ranges::count(kSliding, hypothesis.law) == 0) return 0.0;
  if (hypothesis.law == "load_dependent_friction") {
    return std::abs(find_law(hypothesis.law, false)->make(law.values())->force(drive, speed, {}));
  }
  return std::max(std::abs(sliding_force(law, hypothesis.law, speed)),
                  std::abs(sliding_force(law, hypothesis.law, -speed)));
}

double highest_speed(const CheckedRange& range, const std::string& axis) {
  double highest = 0.0;
  for (const auto* spans : {&range.spans, &range.recorded}) {
    for (const CheckedRange::Span& span : *spans) {
      if (span.quantity != "velocity of " + axis) continue;
      highest = std::max({highest, std::abs(span.from), std::abs(span.to)});
    }
  }
  return highest;
}

}  // namespace

double sliding_force(const FittedLaw& law, const std::string& name, double speed) {
  if (name == "dahl") return std::copysign(largest_parameter(law, "level"), speed);
  return find_law(name, false)->make(law.values())->force(0.0, speed, {});
}

void add_holding_friction(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  constexpr double kSlow = 0.01;
  if (!diagnosis.checked.standing) return;
  CheckedRange::Standing& standing = *diagnosis.checked.standing;
  const double speed = kSlow * highest_speed(diagnosis.checked, standing.axis);
  const double drive = standing.drive.held();
  standing.holds = 0.0;
  for (const FoundEffect& effect : diagnosis.effects) {
    standing.holds += held_by(effect.law, hypotheses[effect.law.hypothesis], speed, drive);
  }
}

std::optional<VerdictReason> holding_reason(const CheckedRange& range) {
  constexpr double kLeast = 0.5;
  if (!range.standing || std::isnan(range.standing->holds)) return {};
  const CheckedRange::Standing& standing = *range.standing;
  VerdictReason reason;
  reason.test = fmt::format("{} that the laws found hold at standstill, where {} stood under {}",
                            standing.unit, standing.axis, standing.drive_words());
  reason.value = standing.holds;
  reason.limit = kLeast * standing.drive.held();
  reason.is_lower_limit = true;
  reason.passed = standing.holds >= reason.limit;
  if (!reason.passed) {
    reason.next =
        "dry friction holds it there, a brake, or a drive that does nothing below a threshold: "
        "record slow motion, and starts under a drive that rises slowly";
  }
  return reason;
}

}  // namespace graybox
