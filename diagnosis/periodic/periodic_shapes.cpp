#include "diagnosis/periodic/periodic_shapes.hpp"

#include <cmath>

namespace graybox {
namespace {

using Eigen::VectorXd;

std::vector<LawShape> mode(const FrequencyBand& band) {
  constexpr int kFrequencies = 24;
  std::vector<LawShape> shapes;
  for (int i = 0; i <= kFrequencies; ++i) {
    const double share = static_cast<double>(i) / kFrequencies;
    const double frequency = band.lowest * std::pow(1.5 * band.highest / band.lowest, share);
    shapes.push_back(single_amplitude({1.0, frequency, 0.03}, 0, true));
  }
  return shapes;
}

std::vector<LawShape> payload() {
  std::vector<LawShape> shapes;
  for (const double x : {-0.25, 0.0, 0.25}) {
    for (const double y : {-0.25, 0.0, 0.25}) {
      for (const double z : {0.0, 0.25}) {
        shapes.push_back(single_amplitude({1.0, x, y, z}, 0, true));
      }
    }
  }
  return shapes;
}

// At robots' arms, where the angle differs between positions by what a balancer turns.
bool differs_between_positions(const CandidatePlace& place, std::size_t positions) {
  return place.shifts_rest && place.turns && positions > 1;
}

// Elsewhere one turn or a good part of it in each recording is needed to tell a balancer from a
// spring.
std::vector<LawShape> balancer(const CandidatePlace& place, const MotionScale& scale) {
  constexpr double kRangeToBeSeen = 0.3;  // rad
  if (!place.shifts_rest && scale.range < kRangeToBeSeen) return {};
  return balancer_shapes({0.2, 0.5, 0.8}, {0.0, 0.4, 0.8}, 12);
}

// Laws without amplitude: as they are.
LawShape as_it_is(std::vector<double> parameters) {
  LawShape shape;
  shape.basis = {parameters};
  shape.parameters = [parameters](const VectorXd& a) {
    return a(0) > 0.0 ? parameters : std::vector<double>();
  };
  return shape;
}

// First order in a short time, which is its amplitude.
LawShape short_time() {
  constexpr double kShort = 1e-6;  // s
  LawShape shape;
  shape.basis = {{kShort}};
  shape.parameters = [](const VectorXd& a) {
    if (!(a(0) > 0.0)) return std::vector<double>();
    return std::vector<double>{kShort * a(0)};
  };
  return shape;
}

std::vector<LawShape> signal_shapes(const LawEntry& entry, const MotionScale& scale) {
  if (entry.name == "gain") return {single_amplitude({1.0}, 0, false)};
  if (entry.name == "lag" || entry.name == "delay") return {short_time()};
  std::vector<LawShape> shapes;
  if (entry.name == "saturation") {
    constexpr double kCorner = 0.03;  // of the limit: derivatives by a sharp one are zero
    for (const double share : {0.999, 0.98, 0.9, 0.7, 0.5}) {
      if (scale.deflection(share) > 0.0) {
        shapes.push_back(as_it_is({scale.deflection(share), kCorner * scale.deflection(share)}));
      }
    }
  } else if (entry.name == "dead_zone") {
    for (const double share : {0.01, 0.05, 0.15, 0.4, 0.7}) {
      if (scale.deflection(share) > 0.0) {
        shapes.push_back(as_it_is({scale.deflection(share)}));
      }
    }
  }
  return shapes;
}

}  // namespace

std::vector<LawShape> periodic_shapes(const LawEntry& entry, const CandidatePlace& place,
                                      const MotionScale& scale, const FrequencyBand& band) {
  if (!entry.definition.empty()) return law_shapes(entry, place, scale);
  if (place.location.kind != LocationKind::kElement) return signal_shapes(entry, scale);
  if (entry.name == "payload") return payload();
  if (entry.name == "mode") return mode(band);
  if (entry.name == "balancer") return balancer(place, scale);
  if (entry.name == "offset") return {single_amplitude({1.0}, 0, false)};
  return law_shapes(entry, place, scale);
}

bool has_many_valleys(const LawEntry& entry) {
  return entry.name == "balancer" || entry.name == "saturation";
}

std::vector<const LawEntry*> hypothetical_laws(const CandidatePlace& place, std::size_t positions) {
  const Location& location = place.location;
  std::vector<const LawEntry*> laws;
  for (const LawEntry& entry : law_catalogue()) {
    const std::string& name = entry.name;
    if (name == "asymmetric_coulomb" || name == "gravity") continue;  // a spring, about a place
    const bool may_balance = place.turns && !place.is_coupling;
    if (name == "balancer" &&
        !(place.shifts_rest ? differs_between_positions(place, positions) : may_balance)) {
      continue;
    }
    // Between gearbox and arm it makes no difference: the motor is held.
    if (name == "offset" && !(place.shifts_rest && place.turns)) continue;
    const bool is_signal = entry.use == LawUse::kSignal || entry.use == LawUse::kDelay;
    if (is_signal != (location.kind != LocationKind::kElement)) continue;
    if ((entry.use == LawUse::kPayload) != location.is_flange && !is_signal) continue;
    if (entry.use == LawUse::kInertia && (!location.takes_inertia || place.has_free_inertia)) {
      continue;
    }
    if (place.is_coupling && name != "stiffness" && name != "viscous" && name != "coulomb" &&
        name != "ripple") {
      continue;
    }
    if (!place.is_coupling) {
      if (name == "stiffness" && place.has_free_stiffness) continue;
      if (name == "viscous" && place.has_free_damping) continue;
      // With a free spring at hand a stop and a play are the same law; without a spring there is
      // none to have play.
      if (name == "dead_zone" && place.has_free_stiffness) continue;
      if (name == "backlash" && !place.has_free_stiffness) continue;
    }
    laws.push_back(&entry);
  }
  return laws;
}

const LawEntry* twin_of(const LawEntry& entry, const CandidatePlace& place, std::size_t positions) {
  if (place.location.kind != LocationKind::kElement || place.is_coupling) return nullptr;
  if (entry.name == "backlash" && place.has_free_stiffness) return find_law("dead_zone", false);
  if (entry.name == "coulomb") return find_law("asymmetric_coulomb", false);
  if (entry.name == "stiffness" && place.location.units.deflection == "rad" &&
      !differs_between_positions(place, positions)) {
    return find_law("balancer", false);
  }
  return nullptr;
}

}  // namespace graybox
