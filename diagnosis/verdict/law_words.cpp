#include "diagnosis/verdict/law_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "diagnosis/evidence/number_words.hpp"

namespace graybox {
namespace {

struct Predicate {
  std::string_view law;
  bool at_signal = false;
  std::string_view words;
  std::string_view if_negative = {};  // of its stiffness, or first parameter; empty: the same
};

constexpr std::array<Predicate, 35> kPredicates{{
    {"stiffness", false, "is stiffer than modelled", "is softer than modelled"},
    {"cubic_spring", false, "hardens", "softens"},
    {"backlash", false, "has play"},
    {"dead_zone", false, "is held back beyond a clearance (a stop, or a spring with slack)",
     "loses stiffness beyond a clearance"},
    {"ripple", false, "has a force that comes back with the position (ripple, cogging)"},
    {"balancer", false, "is balanced by a spring"},
    {"gravity", false, "lifts a weight"},
    {"offset", false, "carries a constant force"},
    {"viscous", false, "has more viscous friction than modelled",
     "has less viscous friction than modelled"},
    {"asymmetric_viscous", false, "has viscous friction that differs between the directions"},
    {"driven_viscous", false, "is braked differently while nothing drives it"},
    {"coulomb", false, "has dry friction"},
    {"asymmetric_coulomb", false, "has dry friction that differs between the directions"},
    {"stribeck", false, "has dry friction"},
    {"load_dependent_friction", false, "has dry friction that grows with the load that it carries"},
    {"sublinear_friction", false, "has friction that grows less than speed does"},
    {"quadratic_drag", false, "has drag that grows with the square of speed"},
    {"deflection_damping", false, "is damped the more, the further it is deflected"},
    {"dahl", false, "has friction that gives way like a spring before it slides (Dahl)"},
    {"lugre", false, "has friction that gives way before it slides"},
    {"bouc_wen", false, "has a spring that yields (hysteresis, Bouc-Wen)"},
    {"play_and_slip", false, "has play, and slips beyond a force"},
    {"mode", false, "carries something that swings (a flexible mode)"},
    {"inertia", false, "has more inertia than modelled", "has less inertia than modelled"},
    {"payload", false, "carries a payload"},
    {"saturation", true, "saturates"},
    {"dead_zone", true, "does not answer to small values (dead zone)"},
    {"lag", true, "follows late (first-order lag)"},
    {"delay", true, "is delayed"},
    {"gain", true, "gives more than it should", "gives less than it should"},
    {"curved_gain", true, "gives the more for each unit, the more is asked of it",
     "gives the less for each unit, the more is asked of it"},
    {"rate_limit", true, "can't change faster than a limit"},
    {"offset", true, "is off by a constant"},
    {"rectifier", true, "reads no sign"},
    {"resonance", true, "reads what swings where it is measured, too (a flexible mode)"},
}};

const LawParameterEstimate* parameter(const FittedLaw& law, std::string_view name) {
  const auto found = std::ranges::find(law.parameters, name, &LawParameterEstimate::name);
  return found == law.parameters.end() ? nullptr : &*found;
}

double error_of(const LawParameterEstimate& estimate) {
  return estimate.standard_error > 0.0 ? estimate.standard_error : 0.0;
}

// How one parameter stands to another, beyond their errors: -1, 0 or 1.
int compared(const LawParameterEstimate& a, const LawParameterEstimate& b) {
  constexpr double kErrorsApart = 2.0;
  const double difference = a.value - b.value;
  if (std::abs(difference) <= kErrorsApart * std::hypot(error_of(a), error_of(b))) return 0;
  return difference < 0.0 ? -1 : 1;
}

// Friction at standstill against friction when it slides; its viscous part may turn that round at
// high speed.
std::string course_words(const FittedLaw& law, std::string_view name) {
  const LawParameterEstimate *still = parameter(law, "static_level"),
                             *sliding = parameter(law, "level");
  if (still == nullptr || sliding == nullptr) return "";
  if (is_unseen_static_level(law, *still)) return "";  // the curve says it (friction_words.hpp)
  constexpr double kHardly = 0.15;                     // of the sliding level
  switch (compared(*still, *sliding)) {
    case 1:
      return fmt::format(" that falls with speed ({})", name);
    case -1:
      return " that rises with speed";
    default:
      return std::abs(still->value - sliding->value) <= kHardly * std::abs(sliding->value)
                 ? " that hardly depends on speed"
                 : "";
  }
}

// "carries 1.2 kg, 0.07 m off along x": the axes along which it stands off beyond its errors.
std::string payload_words(const FittedLaw& law) {
  const LawParameterEstimate* mass = parameter(law, "mass");
  if (mass == nullptr) return "";
  std::string off;
  for (const char* axis : {"x", "y", "z"}) {
    const LawParameterEstimate* place = parameter(law, axis);
    if (place == nullptr || compared(*place, {"", "", 0.0, 0.0}) == 0) continue;
    off += fmt::format("{}{:.2g} m along {}", off.empty() ? ", off by " : ", ", place->value, axis);
  }
  return fmt::format("carries a payload of {:.3g} kg{}", mass->value, off);
}

constexpr std::string_view kWithLoad = " with load ";

bool is_with_load(const std::string& place) { return place.find(kWithLoad) != std::string::npos; }

// "lifts a weight, 9.8 N m at most, at 1.57 rad": where f = s sin z + c cos z is largest.
std::string gravity_words(const Hypothesis& hypothesis, const FittedLaw& law) {
  const LawParameterEstimate *sine = parameter(law, "sine"), *cosine = parameter(law, "cosine");
  if (sine == nullptr || cosine == nullptr) return "";
  const double most = std::hypot(sine->value, cosine->value);
  const std::string words =
      fmt::format("{} {} at most, where it stands at {:.3g} rad", three_digits(most), sine->unit,
                  std::atan2(sine->value, cosine->value));
  if (!is_with_load(hypothesis.place)) return "lifts a weight: " + words;
  constexpr double kGravity = 9.81;
  return fmt::format(
      "lifts the load: {}; about a level axis that is {:.3g} kg m, of which one joint can't tell "
      "mass and lever",
      words, most / kGravity);
}

// "carries the load: 1.74 kg m^2".
std::string inertia_words(const Hypothesis& hypothesis, const FittedLaw& law) {
  if (!is_with_load(hypothesis.place) || law.parameters.empty()) return "";
  const LawParameterEstimate& inertia = law.parameters.front();
  if (inertia.value < 0.0) return "";
  return fmt::format("carries the load's inertia: {} {}", three_digits(inertia.value),
                     inertia.unit);
}

// A damping for each direction, of which the model has a part already: so one may be negative.
std::string direction_words(const LawParameterEstimate& forward,
                            const LawParameterEstimate& backward) {
  const double more = forward.value - backward.value;
  return fmt::format("moves harder {} than {}, by {} {} of viscous friction",
                     more > 0.0 ? "forward" : "backward", more > 0.0 ? "backward" : "forward",
                     three_digits(std::abs(more)), forward.unit);
}

// By how much a bridge that lets its motor go, or shorts it, changes what brakes it.
std::string driven_words(const FittedLaw& law) {
  const LawParameterEstimate *driven = parameter(law, "driven_damping"),
                             *undriven = parameter(law, "undriven_damping");
  if (driven == nullptr || undriven == nullptr) return "";
  const double more = driven->value - undriven->value;
  return fmt::format(
      "is braked {} while nothing drives it, by {} {} of viscous friction (as by a bridge that {} "
      "its motor)",
      more > 0.0 ? "less" : "more", three_digits(std::abs(more)), driven->unit,
      more > 0.0 ? "lets go of" : "shorts");
}

// What the numbers say in place of the law's usual words; empty: those.
std::string words_by_numbers(const Hypothesis& hypothesis, const FittedLaw& law) {
  if (hypothesis.law == "stribeck") {
    return fmt::format("has dry friction{}", course_words(law, "Stribeck"));
  }
  if (hypothesis.law == "lugre") {
    const std::string course = course_words(law, "LuGre");
    return fmt::format("has friction that gives way before it slides{}{}",
                       course.empty() ? "" : ",", course);
  }
  if (hypothesis.law == "driven_viscous") return driven_words(law);
  if (hypothesis.law == "payload") return payload_words(law);
  if (hypothesis.law == "gravity") return gravity_words(hypothesis, law);
  if (hypothesis.law == "inertia") return inertia_words(hypothesis, law);
  if (hypothesis.law == "sublinear_friction") {
    const LawParameterEstimate* exponent = parameter(law, "exponent");
    if (exponent != nullptr && compared(*exponent, {"", "", 1.0, 0.0}) == 0) {
      return "has viscous friction";
    }
  }
  for (const std::string_view kind : {"damping", "level"}) {
    const LawParameterEstimate *forward = parameter(law, fmt::format("forward_{}", kind)),
                               *backward = parameter(law, fmt::format("backward_{}", kind));
    if (forward == nullptr || backward == nullptr) continue;
    const bool has_negative = forward->value < 0.0 || backward->value < 0.0;
    if (kind == "damping" && has_negative) return direction_words(*forward, *backward);
    if (compared(*forward, *backward) == 0) {
      constexpr double kAlike = 0.25;  // of the larger one
      const double larger = std::max(std::abs(forward->value), std::abs(backward->value));
      const bool are_alike = std::abs(forward->value - backward->value) <= kAlike * larger;
      return fmt::format("has {} friction, {}", kind == "level" ? "dry" : "viscous",
                         are_alike ? "the same in both directions"
                                   : "whose sizes in the two directions are not told apart");
    }
  }
  return "";
}

bool is_signal(const std::string& place) {
  return place.starts_with("sensor ") || place.starts_with("actuator ");
}

}  // namespace

std::string place_words(const std::string& place) {
  if (is_signal(place) || place.starts_with("flange")) return "the " + place;
  if (const std::size_t load = place.find(kWithLoad); load != std::string::npos) {
    return place_words(place.substr(0, load)) + place.substr(load);
  }
  const std::size_t dot = place.find('.');
  // Couplings and places of lumped models have names that say it all.
  if (dot == std::string::npos || place.find(' ') != std::string::npos ||
      place.find('-') != std::string::npos) {
    return place;
  }
  const std::string axis = place.substr(dot + 1);
  return fmt::format("the {} of {}", axis == "arm" ? "arm axis" : axis, place.substr(0, dot));
}

bool is_unseen_static_level(const FittedLaw& law, const LawParameterEstimate& estimate) {
  if (estimate.name != "static_level") return false;
  const LawParameterEstimate* sliding = parameter(law, "level");
  const double error = error_of(estimate), size = std::abs(estimate.value);
  if (error > size) return true;
  // Between a level far above that of sliding and none there is all that a curve may do.
  return sliding != nullptr && error > 0.5 * size &&
         error > std::abs(estimate.value - sliding->value);
}

std::string advice_for(const Hypothesis& found, const Hypothesis& rival) {
  if (found.law == "curved_gain" || rival.law == "curved_gain") {
    return "Switch the drive off while it moves: drag brakes what coasts, and a drive does not.";
  }
  if (rival.law == "stribeck" || rival.law == "dahl" || rival.law == "lugre") {
    return "Record slow motion, from rest and through it: there they differ.";
  }
  if (rival.law == "sublinear_friction" || rival.law == "quadratic_drag" ||
      rival.law == "viscous") {
    return "Record a wide range of steady speeds, slow and fast: there they differ.";
  }
  if (rival.law.starts_with("asymmetric_") || rival.law == "offset") {
    return "Record both directions for equally long, at several speeds: there they differ.";
  }
  return "";
}

std::string effect_sentence(const Hypothesis& hypothesis, const FoundEffect& effect) {
  const bool is_first_spring = hypothesis.law == "stiffness" && effect.is_first_of_its_kind &&
                               !effect.law.parameters.empty();
  if (!is_first_spring) return law_sentence(hypothesis, effect.law);
  const LawParameterEstimate& stiffness = effect.law.parameters.front();
  if (stiffness.value >= 0.0) {
    const bool turns = stiffness.unit.ends_with("/rad");
    return fmt::format("something pulls {} back to where it stands, as a spring does{}",
                       place_words(hypothesis.place), turns ? ", or a weight that hangs" : "");
  }
  return fmt::format("something pushes {} away from where it stands, the more the further",
                     place_words(hypothesis.place));
}

std::string law_sentence(const Hypothesis& hypothesis, const FittedLaw& law) {
  const std::string place = place_words(hypothesis.place);
  if (const std::string words = words_by_numbers(hypothesis, law); !words.empty()) {
    return fmt::format("{} {}", place, words);
  }
  const auto* known = std::ranges::find_if(kPredicates, [&](const Predicate& predicate) {
    return predicate.law == hypothesis.law && predicate.at_signal == is_signal(hypothesis.place);
  });
  if (known == kPredicates.end())
    return fmt::format("{} follows the law {}", place, hypothesis.law);
  const LawParameterEstimate* size = parameter(law, "stiffness");  // a clearance comes before it
  if (size == nullptr && !law.parameters.empty()) size = &law.parameters.front();
  const bool is_negative = size != nullptr && size->value < 0.0;
  const bool other = is_negative && !known->if_negative.empty();
  return fmt::format("{} {}", place, other ? known->if_negative : known->words);
}

}  // namespace graybox
