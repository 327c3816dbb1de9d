#include "diagnosis/runs/answer_advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/units.hpp"
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

// Laws of the position found in one sweep at about one speed, where position and time are one.
void tell_laws_of_one_sweep(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  constexpr double kOneSpeed = 2.0;  // fastest over slowest
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& law = hypotheses[effect.law.hypothesis];
    if (std::ranges::find(kSprings, law.law) == kSprings.end()) continue;
    const std::string moving = law.place.substr(0, law.place.find('.'));
    for (const CheckedRange::Span& span : diagnosis.checked.recorded) {
      if (span.quantity != "velocity of " + moving || !(span.from * span.to > 0.0)) continue;
      const double slow = std::min(std::abs(span.from), std::abs(span.to)),
                   fast = std::max(std::abs(span.from), std::abs(span.to));
      if (fast > kOneSpeed * slow) continue;
      diagnosis.assumptions.push_back(fmt::format(
          "{} went one way at about one speed: what is said to depend on its position ({}) may as "
          "well change with time. Record it going back, and at other speeds.",
          moving, law.law));
    }
  }
}

bool has_spring(const std::vector<Element>& parts, const std::string& place) {
  return std::ranges::any_of(parts, [&](const Element& part) {
    return part.location.name == place &&
           std::ranges::find(kSprings, part.law_name) != kSprings.end();
  });
}

const std::string kNamelessUnit = "drive units";

bool is_force(const std::string& unit) { return unit == "N m" || unit == "N"; }

// One recorded unit stands for 1 N m or 1 N.
bool has_no_gain(const Channel& channel) {
  const Unit* recorded = find_unit(channel.recorded_unit);
  return recorded != nullptr && recorded->base != channel.unit && std::abs(channel.factor) == 1.0;
}

// A goal of a servo in rad, and what has no unit, are no sizes of a force that anyone would name.
std::string named_drive_unit(const std::string& recorded) {
  const Unit* unit = find_unit(recorded);
  const bool is_named = unit != nullptr && recorded != "1" && unit->base != "rad" &&
                        unit->base != "m" && unit->base != "rad/s" && unit->base != "m/s";
  return is_named ? recorded : kNamelessUnit;
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

void advise_on_rivals(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  std::string advice;
  for (const FoundEffect& effect : diagnosis.effects) {
    for (const Rival& rival : effect.rivals) {
      const std::string more =
          advice_for(hypotheses[effect.law.hypothesis], hypotheses[rival.law.hypothesis]);
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

void require_confirmed_laws(Diagnosis& diagnosis) {
  if (!has_no_confirmed_law(diagnosis) || diagnosis.reasons.empty()) return;
  VerdictReason reason;
  reason.test = "laws told that are confirmed";
  reason.value = 0.0;
  reason.limit = 1.0;
  reason.is_lower_limit = true;
  reason.passed = false;
  reason.otherwise = Verdict::kUnknown;
  reason.next =
      "record more, and other motion: the sizes of these laws are not told, or they gain nothing "
      "in recordings kept out";
  diagnosis.reasons.insert(diagnosis.reasons.begin(), std::move(reason));
  diagnosis.verdict = verdict_of(diagnosis.reasons);
}

void tell_one_way_forces(std::span<const Hypothesis> hypotheses, Diagnosis& diagnosis) {
  tell_laws_of_one_sweep(hypotheses, diagnosis);
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
    for (const CheckedRange::Span& span : diagnosis.checked.recorded) {
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

void tell_clipped_inputs(std::span<const std::string> inputs, Diagnosis& diagnosis) {
  if (diagnosis.effects.empty()) return;
  for (const std::string& input : inputs) {
    diagnosis.assumptions.push_back(fmt::format(
        "The recorded {} has flat tops. Where the drive itself ends there, state its range (range: "
        "in campaign.yaml). Where only its sensor or channel does, more acts than was recorded, "
        "and what was found may stand in for that.",
        input));
  }
}

bool estimates_drive_gains(const std::filesystem::path& model) {
  return YamlField::load(model).at("format").text() == "graybox-rigid-robot/1" &&
         load_rigid_robot(model).channels.unknown_drive_gains;
}

std::string drive_unit_of(const Campaign& campaign) {
  std::set<std::string> units;
  for (const Channel& channel : campaign.channels) {
    if (channel.role != ChannelRole::kInput || !is_force(channel.unit)) continue;
    if (!has_no_gain(channel)) return "";
    units.insert(named_drive_unit(channel.recorded_unit));
  }
  return units.empty() ? "" : units.size() == 1 ? *units.begin() : kNamelessUnit;
}

void tell_unknown_gains(const Campaign& campaign, Diagnosis& diagnosis) {
  constexpr std::size_t kFew = 2;
  std::map<std::string, std::vector<std::string>> columns;
  for (const Channel& channel : campaign.channels) {
    if (channel.role != ChannelRole::kInput || !has_no_gain(channel)) continue;
    columns[named_drive_unit(channel.recorded_unit)].push_back(
        channel.column.empty() ? channel.name : channel.column);
  }
  for (const auto& [unit, names] : columns) {
    std::string of;
    for (std::size_t k = 0; k < std::min(kFew, names.size()); ++k) {
      of += (k == 0 ? "'" : ", '") + names[k] + "'";
    }
    if (names.size() > kFew) of += fmt::format(" and {} more", names.size() - kFew);
    diagnosis.assumptions.push_back(fmt::format(
        "Sizes are in units of the drive{}{}: of {} no gain is stated. With {} true gain (gain: in "
        "campaign.yaml) masses and forces scale.",
        names.size() > 1 ? "s" : "", unit == kNamelessUnit ? "" : ", " + unit, of,
        names.size() > 1 ? "each" : "its"));
  }
}

}  // namespace graybox
