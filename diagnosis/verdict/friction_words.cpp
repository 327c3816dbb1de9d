#include "diagnosis/verdict/friction_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/verdict/law_words.hpp"

namespace graybox {
namespace {

constexpr double kSameInBothDirections = 0.05;
constexpr std::array<double, 3> kSpeeds{0.01, 0.1, 1.0};  // of the highest
constexpr double kNext = 0.7;                             // of the highest
constexpr std::array<std::string_view, 5> kDry{"coulomb", "asymmetric_coulomb", "stribeck",
                                               "sublinear_friction", "dahl"};
constexpr std::array<std::string_view, 3> kSmooth{"viscous", "asymmetric_viscous",
                                                  "quadratic_drag"};
// No one curve over the speed tells the force of these.
constexpr std::array<std::string_view, 4> kWithoutCurve{"lugre", "bouc_wen", "play_and_slip",
                                                        "driven_viscous"};

template <std::size_t size>
bool is_among(const std::array<std::string_view, size>& laws, const std::string& law) {
  return std::ranges::find(laws, law) != laws.end();
}

struct Place {
  std::string name;
  std::vector<const FittedLaw*> laws;
  bool is_dry = false, has_no_curve = false;
  double own_damping = 0.0;  // of the model
};

// Also in a drive's own unit (drive_units.hpp).
bool is_unit_of_mass(const std::string& unit) {
  return unit == "kg" || unit == "kg m^2" || unit.ends_with(" s^2/rad") || unit.ends_with(" s^2/m");
}

// The damping that the model itself has at the place, as it was fitted beside the laws: of a single
// mass, to which every damping belongs. Of several the estimates' names do not tell whose it is.
double own_damping(const Diagnosis& diagnosis, const Place& place) {
  const LawParameterEstimate* mass = nullptr;
  double damping = 0.0;
  for (const LawParameterEstimate& each : diagnosis.after.model_parameters) {
    if (each.name.ends_with(".damping")) damping += each.value;
    if (!is_unit_of_mass(each.unit)) continue;
    if (mass != nullptr) return 0.0;
    mass = &each;
  }
  const bool is_its = mass != nullptr && mass->name.starts_with(place.name + ".");
  return is_its ? damping : 0.0;
}

std::vector<Place> places_with_friction(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses) {
  std::vector<Place> places;
  for (const FoundEffect& effect : diagnosis.effects) {
    const Hypothesis& hypothesis = hypotheses[effect.law.hypothesis];
    const bool is_dry = is_among(kDry, hypothesis.law),
               has_no_curve = is_among(kWithoutCurve, hypothesis.law);
    if (!is_dry && !has_no_curve && !is_among(kSmooth, hypothesis.law)) continue;
    auto place = std::ranges::find(places, hypothesis.place, &Place::name);
    if (place == places.end()) {
      place = places.insert(places.end(), Place{.name = hypothesis.place, .laws = {}});
    }
    place->laws.push_back(&effect.law);
    place->is_dry = place->is_dry || is_dry;
    place->has_no_curve = place->has_no_curve || has_no_curve;
  }
  for (Place& place : places) place.own_damping = own_damping(diagnosis, place);
  return places;
}

double force_at(const Place& place, std::span<const Hypothesis> hypotheses, double speed) {
  double sum = place.own_damping * speed;
  for (const FittedLaw* law : place.laws) {
    sum += sliding_force(*law, hypotheses[law->hypothesis].law, speed);
  }
  return sum;
}

// "velocity of elbow" for the place "elbow.arm", of what was checked, else of what was recorded.
const CheckedRange::Span* velocity_at(const Diagnosis& diagnosis, const Place& place) {
  const std::string name = "velocity of " + place.name.substr(0, place.name.find('.'));
  for (const auto* spans : {&diagnosis.checked.spans, &diagnosis.checked.recorded}) {
    const auto found = std::ranges::find(*spans, name, &CheckedRange::Span::quantity);
    if (found != spans->end()) return &*found;
  }
  return nullptr;
}

// The unit of the force recorded there, else of a friction's level: N m, N or a drive's own.
std::string force_unit(const Diagnosis& diagnosis, const Place& place) {
  const std::string axis = place.name.substr(0, place.name.find('.'));
  for (const CheckedRange::Span& span : diagnosis.checked.spans) {
    if (span.quantity == "torque of " + axis || span.quantity == "force of " + axis)
      return span.unit;
  }
  for (const FittedLaw* law : place.laws) {
    for (const LawParameterEstimate& each : law->parameters) {
      if (each.name.find("level") != std::string::npos) return each.unit;
    }
  }
  return "";
}

// Two digits, "1200" and not "1.2e+03".
std::string two_digits(double value) {
  constexpr double kPlain = 1e5;
  if (!(std::abs(value) >= 100.0 && std::abs(value) < kPlain)) return fmt::format("{:.2g}", value);
  const double unit = std::pow(10.0, std::floor(std::log10(std::abs(value))) - 1.0);
  return fmt::format("{:.0f}", unit * std::round(value / unit));
}

// The slowest speed of motion that goes one way, or that lasted; 0: it turns, or stands.
double slowest(const CheckedRange::Span& velocity) {
  if (velocity.from * velocity.to <= 0.0) return velocity.slowest;
  return std::max(velocity.slowest, std::min(std::abs(velocity.from), std::abs(velocity.to)));
}

// "It stood still under 0 to 185 N m."
std::string standing_words(const Diagnosis& diagnosis, const Place& place) {
  const auto& standing = diagnosis.checked.standing;
  if (!standing || standing->axis != place.name.substr(0, place.name.find('.'))) return "";
  return fmt::format(" It stood still under {} at one place.", standing->drive_words());
}

std::string force_words(double forward, double backward, const std::string& unit) {
  const double larger = std::max(std::abs(forward), std::abs(backward));
  if (std::abs(forward - backward) <= kSameInBothDirections * larger) {
    return two_digits(0.5 * (forward + backward)) + unit;
  }
  return fmt::format("{}{} forward and {} backward", two_digits(forward), unit,
                     two_digits(backward));
}

}  // namespace

std::vector<std::string> friction_lines(const Diagnosis& diagnosis,
                                        std::span<const Hypothesis> hypotheses) {
  std::vector<std::string> lines;
  for (const Place& place : places_with_friction(diagnosis, hypotheses)) {
    const auto* velocity = velocity_at(diagnosis, place);
    const std::string unit = force_unit(diagnosis, place);
    if (!place.is_dry || place.has_no_curve || velocity == nullptr || unit.empty()) continue;
    const double highest = std::max(std::abs(velocity->from), std::abs(velocity->to));
    const double lowest = slowest(*velocity);
    std::string curve;
    for (const double share : kSpeeds) {
      const double speed = std::max(share * highest, lowest);
      if (share < 1.0 && speed > kNext * highest) continue;      // as good as the highest
      if (!curve.empty() && share * highest < lowest) continue;  // said
      const bool is_first = curve.empty();
      curve +=
          fmt::format("{}{} at {}{}", is_first ? "" : ", ",
                      force_words(force_at(place, hypotheses, speed),
                                  -force_at(place, hypotheses, -speed), is_first ? " " + unit : ""),
                      two_digits(speed), is_first ? " " + velocity->unit : "");
    }
    lines.push_back(fmt::format("Friction of {}: {}.{}", place_words(place.name), curve,
                                standing_words(diagnosis, place)));
  }
  return lines;
}

}  // namespace graybox
