#include "diagnosis/runs/answer_advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {
namespace {

constexpr std::array<std::string_view, 5> kSprings{"stiffness", "cubic_spring", "balancer",
                                                   "gravity", "dead_zone"};

// Of one mass or a rigid machine; a flexible robot has a spring at every joint.
std::vector<Element> parts_of(const std::filesystem::path& model, const std::string& format) {
  if (format == "graybox-lumped/1") return load_lumped_model(model).parts;
  return load_rigid_robot(model).elements;
}

bool has_spring(const std::vector<Element>& parts, const std::string& place) {
  return std::ranges::any_of(parts, [&](const Element& part) {
    return part.location.name == place &&
           std::ranges::find(kSprings, part.law_name) != kSprings.end();
  });
}

}  // namespace

void mark_first_springs(const std::filesystem::path& model, std::span<const Hypothesis> hypotheses,
                        Diagnosis& diagnosis) {
  const auto is_spring = [&](const FoundEffect& effect) {
    return hypotheses[effect.law.hypothesis].law == "stiffness";
  };
  if (std::ranges::none_of(diagnosis.effects, is_spring)) return;
  const std::string format = YamlField::load(model).at("format").text();
  if (format == "graybox-robot/1") return;
  const std::vector<Element> parts = parts_of(model, format);
  for (FoundEffect& effect : diagnosis.effects) {
    if (!is_spring(effect)) continue;
    effect.is_first_of_its_kind = !has_spring(parts, hypotheses[effect.law.hypothesis].place);
  }
}

bool is_of_a_machine(const Diagnosis& diagnosis) {
  const bool loses_the_mass = std::ranges::any_of(diagnosis.implausible, [](const auto& flaw) {
    return flaw.rule == PlausibilityRule::kZero &&
           (flaw.quantity.ends_with(".mass") || flaw.quantity.ends_with(".inertia"));
  });
  return excluding(diagnosis.implausible) == 0 && !loses_the_mass;
}

double shortfall_of(const Diagnosis& diagnosis) {
  constexpr double kOfCount = 3.0, kWithoutLaws = 1e3;
  double most = 0.0;
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (!has_failed(reason)) continue;
    double own = kOfCount;
    const bool is_of_sizes = reason.test.starts_with("masses and springs");
    if (reason.otherwise == Verdict::kAmbiguous || is_of_sizes) {
      own = 1.0;
    } else if (reason.is_lower_limit) {
      own = kWithoutLaws;
    } else if (reason.value && reason.limit > 0.0) {
      own = *reason.value / reason.limit;
    }
    most = std::max(most, own);
  }
  return most;
}

std::optional<double> force_left(const Diagnosis& diagnosis) {
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (reason.test.starts_with("force left at")) return reason.value;
  }
  return {};
}

bool has_signal_laws_only(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  constexpr std::array<std::string_view, 4> kSignals{"delay", "lag", "mode", "resonance"};
  return !diagnosis.effects.empty() &&
         std::ranges::all_of(diagnosis.effects, [&](const FoundEffect& effect) {
           return std::ranges::count(kSignals, hypotheses[effect.law.hypothesis].law) > 0;
         });
}

std::vector<std::size_t> rotors_to_leave_out(const Diagnosis& diagnosis) {
  constexpr std::string_view kTest = "parameters that are not determined", kName = "rotor_inertia_";
  if (diagnosis.verdict != Verdict::kAmbiguous) return {};
  const bool is_alone = std::ranges::all_of(diagnosis.reasons, [&](const VerdictReason& reason) {
    return reason.passed || !reason.not_tested.empty() || reason.test == kTest;
  });
  if (!is_alone) return {};
  std::vector<std::size_t> joints;
  for (const Implausibility& flaw : diagnosis.implausible) {
    if (flaw.rule != PlausibilityRule::kZero || !flaw.quantity.starts_with(kName)) return {};
    joints.push_back(std::stoul(flaw.quantity.substr(kName.size())) - 1);
  }
  return joints;
}

void advise_on_rivals(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  std::string advice;
  for (const FoundEffect& effect : diagnosis.effects) {
    for (const Rival& rival : effect.rivals) {
      const std::string more = advice_for(hypotheses[rival.law.hypothesis]);
      if (more.empty() || advice.find(more) != std::string::npos) continue;
      advice += (advice.empty() ? "" : " ") + more;
    }
  }
  if (advice.empty()) return;
  constexpr std::string_view kTest = "other explanations that are not excluded";
  for (VerdictReason& reason : diagnosis.reasons) {
    if (reason.test != kTest || reason.passed || !reason.not_tested.empty()) continue;
    // A designed experiment is better advice.
    if (reason.next.find("larger and faster") == std::string::npos) continue;
    reason.next = advice.substr(0, advice.size() - 1);  // its end is the line's
  }
}

void tell_one_way_forces(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  constexpr double kBack = 0.05;  // of the fastest motion
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& force = hypotheses[effect.law.hypothesis];
    const auto is_friction = [&](const FittedLaw& law) {
      const Hypothesis& other = hypotheses[law.hypothesis];
      return other.place == force.place && is_dry_friction(other.law);
    };
    const bool is_told = std::ranges::any_of(effect.rivals, is_friction, &Rival::law) ||
                         std::ranges::any_of(diagnosis.effects, is_friction, &FoundEffect::law);
    if (force.law != "offset" || is_told) continue;
    const std::string moving = force.place.substr(0, force.place.find('.'));
    for (const CheckedRange::Span& span : diagnosis.checked.spans) {
      if (span.quantity != "velocity of " + moving) continue;
      const double fastest = std::max(-span.from, span.to);
      if (std::min(-span.from, span.to) > kBack * fastest) continue;
      diagnosis.assumptions.push_back(fmt::format(
          "{} moves one way: its constant force may as well be dry friction. Record it going back, "
          "too.",
          moving));
    }
  }
}

}  // namespace graybox
